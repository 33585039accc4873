//! Scatter of the railpads' damping, estimated from a recording.
//!
//! Railpads of one type differ in damping. On a line, where damping and stiffness of a railpad have the same size at the
//! compared frequencies, a scatter of 10 % that a model lacks is enough for cracks that do not exist.

use super::Quadratic;
use crate::baseline::Unknowns;
use crate::calibration::{CalibrationError, Problem};
use crate::null_model::NullModel;
use crate::observation::Observation;
use crate::prepared_recording::PreparedRecording;
use nalgebra::DVector;

/// Deviations of the logarithm that are tried.
const DEVIATIONS: [f64; 7] = [0.02, 0.04, 0.07, 0.1, 0.14, 0.2, 0.3];

/// Log-normal prior of the deviation: median, and standard deviation of its logarithm.
const MEDIAN: f64 = 0.1;
const SPREAD: f64 = 0.8;

/// Sets the deviation of the railpads' damping to the one with the greatest evidence.
pub fn learn_railpad_damping(unknowns: &mut Unknowns, data: &Quadratic) {
    let mut tried = unknowns.clone();
    let mut log_evidence = |deviation: f64| {
        tried.railpad_damping_deviation = deviation;
        let prior = -0.5 * ((deviation / MEDIAN).ln() / SPREAD).powi(2);
        data.log_evidence(&tried) + prior
    };
    let evidence = DEVIATIONS.map(|deviation| (deviation, log_evidence(deviation)));
    let best = evidence.into_iter().max_by(|one, other| one.1.total_cmp(&other.1));
    unknowns.railpad_damping_deviation = best.expect("some are tried").0;
}

impl PreparedRecording {
    /// Fits the baseline from the values `start` and estimates the scatter of the railpads' damping from the fit. Returns
    /// the values of the fit.
    ///
    /// # Errors
    /// [`CalibrationError`] if the fit fails.
    pub fn learn_railpad_damping(
        &mut self,
        null: &NullModel,
        start: DVector<f64>,
    ) -> Result<DVector<f64>, CalibrationError> {
        let (log_power, covariance) = (self.expected_log_power(null), self.covariance(null));
        let observation = Observation::new(log_power, &covariance, |_| false)
            .ok_or(CalibrationError::NotFinite)?;
        let forward = &self.forward;
        let problem = Problem { forward, observation: &observation, candidates: &[] };
        let calibration = problem.calibrate_widely(start)?;
        let data = Quadratic::new(&calibration, forward.unknowns.typical(), &[])
            .ok_or(CalibrationError::NotFinite)?;
        learn_railpad_damping(&mut self.forward.unknowns, &data);
        Ok(calibration.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::forward::Forward;
    use crate::section::Section;
    use nalgebra::DMatrix;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use tracktwin_parameters::TrackDesign;

    /// Deviation that is estimated from dampings with this deviation, each measured to 5 %.
    fn estimated(deviation: f64) -> f64 {
        let section = Section::new(TrackDesign::v_track(), 40, 1.0);
        let mut unknowns =
            Forward::new(section, Bands::new(200.0, 800.0), &[13.0], vec![0.0]).unknowns;
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut found = DVector::zeros(unknowns.count());
        let mut information = DMatrix::zeros(unknowns.count(), unknowns.count());
        for index in unknowns.railpad_damping() {
            found[index] = deviation * normal() + 0.05 * normal();
            information[(index, index)] = 0.05f64.powi(-2);
        }
        let slope = &information * found;
        let data = Quadratic { information, slope, mean: unknowns.typical() };
        learn_railpad_damping(&mut unknowns, &data);
        unknowns.railpad_damping_deviation
    }

    #[test]
    fn railpads_that_differ_are_told_from_equal_ones() {
        assert!(estimated(0.0) < 0.05, "{}", estimated(0.0));
        assert!((0.14..=0.3).contains(&estimated(0.2)), "{}", estimated(0.2));
    }
}
