//! A Cholesky factor that takes the place of its matrix.
//!
//! faer's own `Llt` copies the matrix and clears its upper half, which for 5000 entries moves more
//! memory than the factorisation itself.

use crate::Error;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, inverse};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Mat, MatRef, get_global_parallelism};

/// Columns that are eliminated at once. Each block reads and writes all that is left of the matrix:
/// faer's own 128 take a tenth longer for 5000 entries.
const BLOCK: usize = 512;

/// `A = L L'`. Entries above the diagonal of `L` are undefined and never read.
pub(crate) struct Cholesky {
    lower: Mat<f64>,
}

impl Cholesky {
    /// Factorises a symmetric matrix of which only the lower triangle is read.
    pub(crate) fn new(mut matrix: Mat<f64>) -> Result<Self, Error> {
        let (n, par) = (matrix.nrows(), get_global_parallelism());
        let mut blocks = faer::Spec::<factor::LltParams, f64>::default();
        blocks.block_size = BLOCK;
        let scratch = factor::cholesky_in_place_scratch::<f64>(n, par, blocks);
        factor::cholesky_in_place(
            matrix.as_mut(),
            factor::LltRegularization::default(),
            par,
            MemStack::new(&mut MemBuffer::new(scratch)),
            blocks,
        )
        .map_err(|_| Error::NotPositiveDefinite { entries: n })?;
        Ok(Self { lower: matrix })
    }

    /// `ln|A|`.
    pub(crate) fn log_determinant(&self) -> f64 {
        2.0 * (0..self.lower.nrows()).map(|i| self.lower[(i, i)].ln()).sum::<f64>()
    }

    /// `L⁻¹ B`.
    pub(crate) fn half_solve(&self, mut right: Mat<f64>) -> Mat<f64> {
        let par = get_global_parallelism();
        solve_lower_triangular_in_place(self.lower.as_ref(), right.as_mut(), par);
        right
    }

    /// `L'⁻¹ B`.
    pub(crate) fn other_half_solve(&self, mut right: Mat<f64>) -> Mat<f64> {
        let par = get_global_parallelism();
        solve_upper_triangular_in_place(self.lower.transpose(), right.as_mut(), par);
        right
    }

    /// `A⁻¹ B`.
    pub(crate) fn solve(&self, right: MatRef<'_, f64>) -> Mat<f64> {
        self.other_half_solve(self.half_solve(right.to_owned()))
    }

    /// `A⁻¹`, of which only the lower triangle is filled.
    pub(crate) fn inverse(&self) -> Mat<f64> {
        let (n, par) = (self.lower.nrows(), get_global_parallelism());
        let mut out = Mat::zeros(n, n);
        let mut scratch = MemBuffer::new(inverse::inverse_scratch::<f64>(n, par));
        inverse::inverse(out.as_mut(), self.lower.as_ref(), par, MemStack::new(&mut scratch));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_inverse_and_determinant_are_those_of_the_matrix() {
        let a =
            Mat::from_fn(3, 3, |i, j| [[4.0, 2.0, 0.0], [2.0, 5.0, 2.0], [0.0, 2.0, 5.0]][i][j]);
        let cholesky = Cholesky::new(a.clone()).unwrap();
        // 4 (25 - 4) - 2 (10) = 64, and factors of small whole numbers: only the logarithm rounds.
        assert!((cholesky.log_determinant() - 64f64.ln()).abs() < 1e-14);
        let x = Mat::from_fn(3, 2, |i, j| (1 + i + 2 * j) as f64);
        let solved = cholesky.solve((&a * &x).as_ref());
        assert!((solved - x).norm_max() < 1e-14);
        assert!((cholesky.inverse()[(2, 0)] - 4.0 / 64.0).abs() < 1e-15);
    }

    #[test]
    fn a_matrix_with_a_negative_eigenvalue_is_refused() {
        let a = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 2.0 });
        assert!(matches!(Cholesky::new(a), Err(Error::NotPositiveDefinite { entries: 2 })));
    }
}
