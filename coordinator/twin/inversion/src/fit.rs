//! The fit of one section of track.

use crate::variation::{Quadratic, learn};
use nalgebra::DVector;
use tracktwin_diagnosis::{
    Calibration, CalibrationError, NullModel, Observation, PreparationError, PreparedRecording,
    Problem, Unknowns, Variation,
};
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::Recording;

/// Times that the variation is learned and the track fitted anew.
const ROUNDS: usize = 2;

/// Mean square of a sleeper's residual where the model holds: below one, for the fit takes up a part and
/// the covariance allows for an error of the prediction.
const EXPECTED: f64 = 0.7;

/// Error of the predicted levels that all sleepers share, in nats: 0.4 dB, by which two simulators of
/// one track differ (docs/accuracy.md).
const RESPONSE: f64 = 0.09;

/// Part of the variation along the track that a sleeper's estimate misplaces beside its posterior, for
/// the model is not nature's; measured with `tracktwin coverage --method inversion`.
const MISPLACED: f64 = 0.35;

/// Sleepers of a section, and sleepers that two neighbouring sections share.
const LENGTH: usize = 24;
const OVERLAP: usize = 8;

/// A track that explains a section of a recording.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Where each value stands, and the variation that was learned.
    pub unknowns: Unknowns,
    /// Logarithms of the values of greatest posterior probability. A level is that of a surface of
    /// eq. B.6 (Shen et al. 2023) whose power is, in the mean over wave numbers, the one found.
    pub values: DVector<f64>,
    /// Standard deviations of these logarithms.
    pub deviations: DVector<f64>,
    /// Sum of squares of each sleeper's whitened residual over the number of its log powers: one on
    /// average where the model holds.
    pub misfit: Vec<f64>,
}

/// A recording in sections that are fitted one by one.
///
/// # Errors
/// [`PreparationError`] says what the recording lacks.
pub fn sections(
    recording: &Recording,
    design: &TrackDesign,
) -> Result<Vec<PreparedRecording>, PreparationError> {
    PreparedRecording::sections(recording, design, LENGTH, OVERLAP)
}

/// Fits a section; `start` is [`tracktwin_diagnosis::first_calibration`]'s answer, and the subject's
/// forward model allows for what lies beyond.
///
/// # Errors
/// [`CalibrationError`] when the model breaks down on the way.
pub fn fit(
    prepared: &PreparedRecording,
    null: &NullModel,
    start: DVector<f64>,
) -> Result<Fitted, CalibrationError> {
    let plain =
        Observation::new(prepared.expected_log_power(null), &prepared.covariance(null), |_| false)
            .ok_or(CalibrationError::NotFinite)?;
    let mut forward = prepared.forward.clone();
    forward.unknowns.response_deviation = RESPONSE;
    let mut factors = vec![1.0; forward.section.sleepers];
    let fit = |forward: &_, factors: &[f64], start| {
        let observation = &plain.clone().with_factors(factors);
        Problem { forward, observation, candidates: &[] }.calibrate(start)
    };
    let mut calibration = fit(&forward, &factors, start)?;
    for _ in 0..ROUNDS {
        factors = misfit(&calibration, &factors).into_iter().map(factor).collect();
        calibration = fit(&forward, &factors, calibration.values)?;
        let data = Quadratic::new(&calibration, forward.unknowns.typical());
        learn(&mut forward.unknowns, &data);
        let start = data.best(&forward.unknowns).ok_or(CalibrationError::NotFinite)?;
        calibration = fit(&forward, &factors, start)?;
    }
    Ok(Fitted::of(forward.unknowns, calibration, &factors))
}

/// Sum of squares of each sleeper's residual over the number of its log powers, with the covariance as it
/// was before it was multiplied by `factors`.
fn misfit(calibration: &Calibration, factors: &[f64]) -> Vec<f64> {
    let each = calibration.residual.len() / factors.len();
    let of = |(sleeper, factor): (usize, &f64)| {
        factor * calibration.residual.rows(sleeper * each, each).norm_squared() / each as f64
    };
    factors.iter().enumerate().map(of).collect()
}

/// What a sleeper's covariance is multiplied by where the model explains it badly: the weight of a
/// multivariate Student distribution, whose scale is learned sleeper by sleeper.
fn factor(misfit: f64) -> f64 {
    (misfit / EXPECTED).max(1.0)
}

impl Fitted {
    fn of(unknowns: Unknowns, calibration: Calibration, factors: &[f64]) -> Self {
        let misfit = misfit(&calibration, factors);
        let covariance = calibration.precision.inverse();
        let (mut values, mut deviations) = (calibration.values, covariance.diagonal());
        // The spectrum's mean and the level are one quantity: the surface's power.
        let spectrum = unknowns.spectrum();
        let share = 1.0 / spectrum.len() as f64;
        let mean = share * values.rows(spectrum.start, spectrum.len()).sum();
        let knots = covariance.rows(spectrum.start, spectrum.len());
        let own = share.powi(2) * knots.columns(spectrum.start, spectrum.len()).sum();
        for index in unknowns.level() {
            values[index] += mean;
            deviations[index] += own + 2.0 * share * knots.column(index).sum();
        }
        let fields = [unknowns.ballast(), unknowns.railpad()];
        for (range, Variation { smooth, independent, .. }) in
            fields.into_iter().zip(unknowns.variation)
        {
            let misplaced = (MISPLACED * smooth.hypot(independent)).powi(2);
            range.for_each(|index| deviations[index] += misplaced);
        }
        let deviations = deviations.map(f64::sqrt);
        Self { unknowns, values, deviations, misfit }
    }
}
