//! Evidence in closed form for an unknown dynamic stiffness at one place.

use super::place::PortPlace;
use super::prior::Prior;
use crate::behaviour::{Behaviour, PortEvidence};
use crate::calibration::Calibration;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Signature of an unknown dynamic stiffness at one port.
pub(super) struct Trace {
    /// Port.
    pub(super) place: PortPlace,
    /// Change of the whitened log powers from the two parts of each basis function: `[row][2 × bump +
    /// part]`.
    pub(super) columns: DMatrix<f64>,
    /// Receptance in m/N to which the heights of the basis functions refer, as mean over each function.
    pub(super) receptance: Vec<f64>,
}

/// Data for the evidence at one port.
pub(super) struct Filter {
    pub(super) trace: Trace,
    /// Factor that projects a residual onto the part of the columns that the baseline reproduces.
    imitated: DMatrix<f64>,
    /// Squared columns minus the part that the baseline reproduces.
    square: DMatrix<f64>,
    /// Priors of the heights, each with the Cholesky factor of its posterior precision.
    priors: Vec<(Prior, Cholesky<f64, Dyn>)>,
}

impl Filter {
    /// `None` if a precision is not positive definite.
    pub(super) fn new(
        trace: Trace,
        current: &Calibration,
        jacobian_transposed: &DMatrix<f64>,
    ) -> Option<Self> {
        let columns = &trace.columns;
        // What the baseline imitates is taken out of columns and residual.
        let shared = jacobian_transposed * columns;
        let imitated = current.precision.solve(&shared);
        let square = columns.transpose() * columns - shared.transpose() * &imitated;
        let posterior = |prior: Prior| {
            let precision = Cholesky::new(&square + &prior.precision)?;
            Some((prior, precision))
        };
        let priors = Prior::all().into_iter().map(posterior).collect::<Option<_>>()?;
        Some(Self { trace, imitated, square, priors })
    }

    /// Element that the dynamic stiffness with these heights resembles.
    pub(super) fn behaviour(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
        heights: &DVector<f64>,
        centres_hz: &[f64],
    ) -> Option<Behaviour> {
        let along = &self.along(residual, projected_gradient);
        let Self { trace: Trace { receptance, .. }, square, .. } = self;
        PortEvidence { along, square, receptance, centres_hz }.behaviour(0.5 * along.dot(heights))
    }

    /// Derivative of the log likelihood with respect to the heights.
    fn along(&self, residual: &DVector<f64>, projected_gradient: &DVector<f64>) -> DVector<f64> {
        self.trace.columns.tr_mul(residual) - self.imitated.tr_mul(projected_gradient)
    }

    /// Log evidence averaged over the priors, and the most probable heights.
    pub(super) fn evidence(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
    ) -> (f64, DVector<f64>) {
        let along = self.along(residual, projected_gradient);
        let of_prior = |(prior, precision): &(Prior, Cholesky<f64, Dyn>)| {
            let heights = precision.solve(&along);
            let log_evidence = 0.5 * along.dot(&heights) - 0.5 * precision.ln_determinant()
                + prior.half_ln_determinant;
            (log_evidence, heights)
        };
        let mut all: Vec<_> = self.priors.iter().map(of_prior).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let highest = all[all.len() - 1].0;
        let sum: f64 = all.iter().map(|(evidence, _)| (evidence - highest).exp()).sum();
        let (_, heights) = all.swap_remove(self.priors.len() - 1);
        (highest + (sum / self.priors.len() as f64).ln(), heights)
    }
}
