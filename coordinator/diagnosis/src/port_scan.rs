//! What a recording says where no name fits: an unknown dynamic stiffness under one rail seat.
//!
//! Whatever a sleeper, its railpad or its ballast have that the model lacks acts on the rail as an
//! additional dynamic stiffness at the rail seat, free in every frequency. Its trace is linear in
//! that stiffness, so that the evidence for it has a closed form (mismatch design, eq. 9).

use crate::calibration::{Calibration, CalibrationError, Problem};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

/// Bumps over the logarithm of the frequency that the stiffness is made of.
const BUMPS: usize = 14;

/// Prior deviations of a bump's height over the track's own stiffness there.
const SCALES: [f64; 3] = [0.1, 0.3, 1.0];

/// Evidence for an unknown dynamic stiffness under a sleeper.
#[derive(Clone, Debug)]
pub struct Port {
    /// The compared sleeper; none for the same stiffness under all of them.
    pub sleeper: Option<usize>,
    /// Logarithm of the evidence against the model without it, in nats.
    pub log_evidence: f64,
    /// The dynamic stiffness over the rail's own at the seat, at the bumps' frequencies.
    pub stiffness_ratio: Vec<(f64, Complex64)>,
}

/// Columns of all ports: the change of the whitened residual by each bump's two parts.
pub struct PortScan {
    /// By compared sleeper: `[row][2 × bump + part]`, whitened.
    columns: Vec<DMatrix<f64>>,
    centres_hz: Vec<f64>,
}

impl PortScan {
    /// Works out the traces on a calibrated track.
    ///
    /// # Errors
    /// [`CalibrationError`] when the calibrated track makes no model.
    pub fn new(problem: &Problem<'_>, current: &Calibration) -> Result<Self, CalibrationError> {
        let (forward, observation) = (problem.forward, problem.observation);
        let extensions = problem.extensions(&current.values)?;
        let lines = forward.bands.lines_hz();
        let (from, to) = (lines[0].ln(), lines[lines.len() - 1].ln());
        let width = (to - from) / (BUMPS - 1) as f64;
        let centres: Vec<f64> = (0..BUMPS).map(|bump| from + width * bump as f64).collect();
        let bump = |centre: f64, hz: f64| (1.0 - ((hz.ln() - centre) / width).abs()).max(0.0);
        let shapes: Vec<Vec<Complex64>> = centres
            .iter()
            .flat_map(|&centre| {
                let shape: Vec<f64> = lines.iter().map(|&hz| bump(centre, hz)).collect();
                [Complex64::ONE, Complex64::I]
                    .map(|part| shape.iter().map(|height| part * height).collect())
            })
            .collect();
        let columns = forward.port_columns(&current.values, &extensions, &shapes)?;
        let whiten =
            |columns: DMatrix<f64>| observation.fitted_rows(&observation.whiten_matrix(&columns));
        let columns = columns.into_iter().map(whiten).collect();
        Ok(Self { columns, centres_hz: centres.into_iter().map(f64::exp).collect() })
    }

    /// The best port for a whitened residual; `felt` is its product with the baseline's
    /// derivatives.
    pub fn best(
        &self,
        current: &Calibration,
        residual: &DVector<f64>,
        felt: &DVector<f64>,
    ) -> Option<Port> {
        let everywhere =
            self.columns.iter().skip(1).fold(self.columns.first()?.clone(), |a, b| a + b);
        let single = self.columns.iter().enumerate().map(|(sleeper, c)| (Some(sleeper), c));
        let all: Vec<_> = single.chain([(None, &everywhere)]).collect();
        let ports = all.into_par_iter().filter_map(|(sleeper, columns)| {
            let (log_evidence, heights) = evidence(current, columns, residual, felt)?;
            let ratio = |(pair, &hz): (&[f64], &f64)| (hz, Complex64::new(pair[0], pair[1]));
            let stiffness_ratio =
                heights.as_slice().chunks_exact(2).zip(&self.centres_hz).map(ratio).collect();
            Some(Port { sleeper, log_evidence, stiffness_ratio })
        });
        ports.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
    }
}

/// Log evidence of the columns, averaged over the prior's scales, and their most probable heights.
fn evidence(
    current: &Calibration,
    columns: &DMatrix<f64>,
    residual: &DVector<f64>,
    felt: &DVector<f64>,
) -> Option<(f64, DVector<f64>)> {
    // What the baseline imitates is taken out of columns and residual.
    let shared = current.jacobian.tr_mul(columns);
    let imitated = current.precision.solve(&shared);
    let square = columns.tr_mul(columns) - shared.tr_mul(&imitated);
    let along = columns.tr_mul(residual) - imitated.tr_mul(felt);
    let mut best: Option<(f64, DVector<f64>)> = None;
    let mut sum = 0.0;
    for scale in SCALES {
        let precision =
            &square + DMatrix::identity(square.nrows(), square.ncols()) / (scale * scale);
        let factor = Cholesky::new(precision)?;
        let heights = factor.solve(&along);
        let log_evidence = 0.5 * along.dot(&heights)
            - 0.5 * factor.ln_determinant()
            - square.nrows() as f64 * f64::ln(scale);
        sum += log_evidence.min(600.0).exp();
        if best.as_ref().is_none_or(|(known, _)| log_evidence > *known) {
            best = Some((log_evidence, heights));
        }
    }
    let (_, heights) = best?;
    Some(((sum / SCALES.len() as f64).ln(), heights))
}
