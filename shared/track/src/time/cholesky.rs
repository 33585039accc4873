//! Sparse Cholesky factorisation of a matrix on the track's pattern.

use crate::model::{Matrices, Port};
use crate::time::PassError;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{MatMut, Side};

/// Factor of one matrix, ready to solve with.
pub(super) struct Cholesky {
    factor: Llt<usize, f64>,
    size: usize,
}

impl Cholesky {
    /// Factorises the matrix of these `values` on the pattern of `matrices`.
    pub(super) fn new(matrices: &Matrices, values: &[f64]) -> Result<Self, PassError> {
        let size = matrices.size();
        // Rows are columns: the matrix is symmetric and stored in full.
        let pattern = SymbolicSparseColMatRef::new_checked(
            size,
            size,
            matrices.row_starts(),
            None,
            matrices.columns(),
        );
        let factor = SparseColMatRef::new(pattern, values).sp_cholesky(Side::Lower);
        factor.map(|factor| Self { factor, size }).map_err(|_| PassError::Unstable)
    }

    /// Replaces a right-hand side by the solution.
    pub(super) fn solve(&self, vector: &mut [f64]) {
        let rows = vector.len();
        self.factor.solve_in_place(MatMut::from_column_major_slice_mut(vector, rows, 1));
    }

    /// Displacements under a unit force on a port.
    pub(super) fn solve_port(&self, port: &Port) -> Vec<f64> {
        let mut displacement = vec![0.0; self.size];
        for &(dof, weight) in port.entries() {
            displacement[dof] += weight;
        }
        self.solve(&mut displacement);
        displacement
    }
}
