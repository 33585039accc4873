//! The likelihood near a fitted track, which gives the evidence of any Gaussian prior in closed form (Laplace), without
//! the forward model.

use crate::baseline::Unknowns;
use crate::calibration::Calibration;
use crate::candidate::Candidate;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Quadratic log likelihood near a fitted track, integrated over the parameters of known physics:
/// `-0.5 x' H x + b' x` plus a constant.
#[derive(Clone, Debug)]
pub struct Quadratic {
    pub(super) information: DMatrix<f64>,
    pub(super) slope: DVector<f64>,
    pub(super) mean: DVector<f64>,
}

impl Quadratic {
    /// Makes it from the whitened residual and derivatives of a fit with `known` physics; `x` is the distance
    /// from the prior's mean, in natural logarithms. `None` if the information on the known physics is not positive
    /// definite.
    pub fn new(calibration: &Calibration, mean: DVector<f64>, known: &[Candidate]) -> Option<Self> {
        let jacobian = &calibration.jacobian;
        let priors = |candidate: &Candidate| -> Vec<(f64, f64)> {
            candidate.free.iter().map(|parameter| candidate.prior(parameter)).collect()
        };
        let priors: Vec<(f64, f64)> = known.iter().flat_map(priors).collect();
        let (count, further) = (mean.len(), priors.len());
        let means = priors.iter().map(|(mean, _)| *mean);
        let all = DVector::from_iterator(count + further, mean.iter().copied().chain(means));
        let at_mean = &calibration.residual + jacobian * (&calibration.values - all);
        let information = jacobian.transpose() * jacobian;
        let slope = jacobian.tr_mul(&at_mean);
        if further == 0 {
            return Some(Self { information, slope, mean });
        }
        // A Gaussian integral over the last parameters with their prior: the Schur complement.
        let mut own = information.view((count, count), (further, further)).into_owned();
        for (index, (_, deviation)) in priors.iter().enumerate() {
            own[(index, index)] += deviation.powi(-2);
        }
        let own = Cholesky::new(own)?;
        let both = information.view((0, count), (count, further)).into_owned();
        let rest = slope.rows(count, further).into_owned();
        Some(Self {
            information: information.view((0, 0), (count, count))
                - &both * own.solve(&both.transpose()),
            slope: slope.rows(0, count) - both * own.solve(&rest),
            mean,
        })
    }

    /// Log evidence of a prior in nats, up to a constant of the data; negative infinity if a precision is not positive
    /// definite.
    pub fn log_evidence(&self, unknowns: &Unknowns) -> f64 {
        let precision = unknowns.precision();
        let Some(prior) = Cholesky::new(precision.clone()) else { return f64::NEG_INFINITY };
        let Some(posterior) = Cholesky::new(precision + &self.information) else {
            return f64::NEG_INFINITY;
        };
        let gain = 0.5 * self.slope.dot(&posterior.solve(&self.slope));
        gain + 0.5 * (prior.ln_determinant() - posterior.ln_determinant())
    }

    /// Increase of the log evidence in nats if the prior includes one more variation, along each of `directions`, whose
    /// amplitude has a standard deviation of one.
    pub(super) fn gains(
        &self,
        unknowns: &Unknowns,
        directions: &[DVector<f64>],
    ) -> Option<Vec<f64>> {
        let posterior = Cholesky::new(unknowns.precision() + &self.information)?.inverse();
        // Of the amplitude alone, after integration over all unknowns.
        let information = &self.information - &self.information * &posterior * &self.information;
        let slope = &self.slope - &self.information * (&posterior * &self.slope);
        let gain = |direction: &DVector<f64>| {
            let precision = 1.0 + direction.dot(&(&information * direction));
            0.5 * (slope.dot(direction).powi(2) / precision - precision.ln())
        };
        Some(directions.iter().map(gain).collect())
    }

    /// Mean and covariance of the posterior under a prior, as natural logarithms in the order of the unknowns. `None` if
    /// its precision is not positive definite.
    pub fn posterior(&self, unknowns: &Unknowns) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let posterior = Cholesky::new(unknowns.precision() + &self.information)?;
        Some((&self.mean + posterior.solve(&self.slope), posterior.inverse()))
    }

    /// The values of greatest posterior probability under a prior, as [`Quadratic::posterior`].
    pub fn best(&self, unknowns: &Unknowns) -> Option<DVector<f64>> {
        let posterior = Cholesky::new(unknowns.precision() + &self.information)?;
        Some(&self.mean + posterior.solve(&self.slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::forward::Forward;
    use crate::section::Section;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use tracktwin_parameters::TrackDesign;
    use tracktwin_track::extension::{ExtensionInstance, Kind};

    #[test]
    fn parameters_of_known_physics_are_integrated_out() {
        let section = Section::new(TrackDesign::v_track(), 24, 1.0);
        let unknowns = Forward::new(section, Bands::new(200.0, 800.0), &[13.0], vec![0.0]).unknowns;
        let (count, rows) = (unknowns.count(), 3 * unknowns.count());
        let kind = Kind::from_name("sleeper_bolt").unwrap();
        let candidate = Candidate {
            kind,
            extension: ExtensionInstance::new("sleeper_bolt"),
            free: vec![kind.parameter("stiffness_N_per_m").unwrap()],
            trials: vec![vec![3e7]],
            length_ratio: 1.0,
            choice_nats: 0.0,
        };
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut normal = || StandardNormal.sample(&mut random);
        let jacobian = DMatrix::from_fn(rows, count + 1, |_, _| normal());
        let residual = DVector::from_fn(rows, |_, _| normal());
        let (mean, deviation) = candidate.prior(candidate.free[0]);
        let mut precision = DMatrix::zeros(count + 1, count + 1);
        precision.view_mut((0, 0), (count, count)).copy_from(&unknowns.precision());
        precision[(count, count)] = deviation.powi(-2);
        let mut at = DVector::from_fn(count + 1, |_, _| 0.0);
        at.rows_mut(0, count).copy_from(&unknowns.typical());
        at[count] = mean;
        // The fit is somewhere near.
        let values = &at + DVector::from_fn(count + 1, |_, _| 0.1);
        let posterior = Cholesky::new(precision + jacobian.transpose() * &jacobian).unwrap();
        let right = jacobian.tr_mul(&(&residual + &jacobian * (&values - &at)));
        let expected = &at + posterior.solve(&right);
        let calibration = Calibration {
            gradient: DVector::zeros(count + 1),
            values,
            residual,
            jacobian,
            precision: posterior,
            objective: 0.0,
            log_evidence: 0.0,
            others: Vec::new(),
        };
        let data = Quadratic::new(&calibration, unknowns.typical(), &[candidate]).unwrap();
        let best = data.best(&unknowns).unwrap();
        assert!((best - expected.rows(0, count)).amax() < 1e-8);
    }
}
