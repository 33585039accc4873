//! Receptance: displacement per unit harmonic force.

use crate::model::{Matrices, Port, TrackModel};
use faer::MatMut;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Point where the force acts or the displacement is observed. Both are positive downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReceptancePoint {
    /// The rail at this position along the track in m.
    Rail(f64),
    /// The rail seat of the sleeper of this index, from 0.
    SleeperSeat(usize),
    /// The free end of the sleeper of this index, from 0.
    SleeperTip(usize),
}

/// Why a receptance cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FrequencyError {
    /// The place does not belong to the track.
    #[error("{place:?} is not on this track of {length_m} m and {sleepers} sleepers")]
    OffTrack {
        /// The place.
        place: ReceptancePoint,
        /// Length of the track in m.
        length_m: f64,
        /// Number of sleepers of the track.
        sleepers: usize,
    },
    /// A frequency is negative, NaN or infinite.
    #[error("{0} Hz is not a valid excitation frequency")]
    Frequency(f64),
    /// The dynamic stiffness is singular at this frequency in Hz: an undamped resonance.
    #[error("the track has an undamped resonance at {0} Hz")]
    Singular(f64),
}

/// Receptance in m/N from a unit force at `excite` to the displacement at `observe`: one value per
/// frequency, in the convention `exp(+i w t)`.
///
/// Solves `(K + i w C - w^2 M) u = b` with the matrices of the model. If `excite` and `observe` are the
/// same point of the rail, the function adds the static flexibility that the shape functions of the
/// element omit. Without this term a point between nodes is too stiff.
///
/// # Errors
/// [`FrequencyError`] names the invalid place or frequency.
pub fn receptance(
    model: &TrackModel,
    excite: ReceptancePoint,
    observe: ReceptancePoint,
    frequencies_hz: &[f64],
) -> Result<Vec<Complex64>, FrequencyError> {
    let force = port(model, excite)?;
    let motion = port(model, observe)?;
    let local = match excite {
        ReceptancePoint::Rail(x_m) if excite == observe => {
            model.layout().rail_point(x_m).local_flexibility
        }
        _ => 0.0,
    };
    let dynamic_stiffness = DynamicStiffness::new(model.matrices());
    let at = |&frequency_hz: &f64| {
        let displacement = dynamic_stiffness.solve(&force, frequency_hz)?;
        let observed = motion.entries().iter().map(|&(dof, weight)| weight * displacement[dof]);
        Ok(observed.sum::<Complex64>() + local)
    };
    frequencies_hz.iter().map(at).collect()
}

/// The relative motion that a force at the place works on.
fn port(model: &TrackModel, place: ReceptancePoint) -> Result<Port, FrequencyError> {
    let layout = model.layout();
    let (length_m, sleepers) = (layout.length_m(), layout.sleepers());
    let sleeper = |index: usize| sleepers.get(index).map(|sleeper| (index, sleeper));
    let found = match place {
        ReceptancePoint::Rail(x_m) => {
            (0.0..=length_m).contains(&x_m).then(|| layout.rail_port(x_m))
        }
        ReceptancePoint::SleeperSeat(index) => {
            sleeper(index).map(|(index, sleeper)| layout.sleeper_port(index, sleeper.seat_node))
        }
        ReceptancePoint::SleeperTip(index) => {
            sleeper(index).map(|(index, sleeper)| layout.sleeper_port(index, sleeper.tip_node()))
        }
    };
    found.ok_or(FrequencyError::OffTrack { place, length_m, sleepers: sleepers.len() })
}

/// `K + i w C - w^2 M` at any `w`, its pattern analysed once.
struct DynamicStiffness<'a> {
    matrices: &'a Matrices,
    pattern: SymbolicSparseColMatRef<'a, usize>,
    symbolic: SymbolicLu<usize>,
}

impl<'a> DynamicStiffness<'a> {
    fn new(matrices: &'a Matrices) -> Self {
        let size = matrices.size();
        // Rows are columns: the matrices are symmetric and stored in full.
        let pattern = SymbolicSparseColMatRef::new_checked(
            size,
            size,
            matrices.row_starts(),
            None,
            matrices.columns(),
        );
        let symbolic = SymbolicLu::try_new(pattern).expect("a track's pattern fits into memory");
        Self { matrices, pattern, symbolic }
    }

    /// Displacements under a unit force on the port.
    fn solve(&self, force: &Port, frequency_hz: f64) -> Result<Vec<Complex64>, FrequencyError> {
        if !(frequency_hz.is_finite() && frequency_hz >= 0.0) {
            return Err(FrequencyError::Frequency(frequency_hz));
        }
        let values = self.values(TAU * frequency_hz);
        let matrix = SparseColMatRef::new(self.pattern, &values);
        let factor = Lu::try_new_with_symbolic(self.symbolic.clone(), matrix)
            .map_err(|_| FrequencyError::Singular(frequency_hz))?;
        let mut displacement = vec![Complex64::ZERO; self.matrices.size()];
        for &(dof, weight) in force.entries() {
            displacement[dof] += weight;
        }
        let rows = displacement.len();
        factor.solve_in_place(MatMut::from_column_major_slice_mut(&mut displacement, rows, 1));
        if displacement.iter().all(|value| value.is_finite()) {
            Ok(displacement)
        } else {
            Err(FrequencyError::Singular(frequency_hz))
        }
    }

    fn values(&self, omega: f64) -> Vec<Complex64> {
        let elastic = self.matrices.combination(-omega * omega, 0.0, 1.0);
        let damping = self.matrices.damping();
        elastic.iter().zip(damping).map(|(k, c)| Complex64::new(*k, omega * c)).collect()
    }
}
