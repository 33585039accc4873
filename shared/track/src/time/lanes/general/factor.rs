//! `L D Lᵀ` of a sparse symmetric matrix, in all lanes at once.

use super::elimination::Elimination;
use super::runs::Runs;
use crate::time::PassError;
use crate::time::lanes::block::Block;
use std::mem;

/// Factor of one matrix a lane, all on the same pattern.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    /// `-L` without its diagonal of ones, by rows: for forward elimination.
    pub(super) lower: Runs<Block>,
    /// `-Lᵀ` without its diagonal, by rows: for back substitution.
    pub(super) upper: Runs<Block>,
    /// `1 / D`.
    pub(super) inverse_pivots: Vec<Block>,
}

impl Factor {
    /// Factorises; `entries` lists columns and values of a row of the matrix in elimination
    /// order, diagonal included.
    ///
    /// Row by row (Davis 2006, 4.10 without the square roots).
    pub(super) fn new(
        elimination: &Elimination,
        entries: impl Fn(usize) -> Vec<(usize, Block)>,
    ) -> Result<Self, PassError> {
        let size = elimination.order.len();
        // Columns of `-L` as far as they are known: rows and values.
        let mut columns: Vec<Vec<(usize, Block)>> = vec![Vec::new(); size];
        let mut work = vec![Block::default(); size];
        let mut inverse_pivots = Vec::with_capacity(size);
        let mut lower = Runs::new();
        for (row, pattern) in elimination.rows.iter().enumerate() {
            for (column, value) in entries(row) {
                if column <= row {
                    work[column] = value;
                }
            }
            let mut pivot = mem::take(&mut work[row]);
            let mut lower_row = Vec::with_capacity(pattern.len());
            for &column in pattern {
                let value = mem::take(&mut work[column]);
                for &(target, multiplier) in &columns[column] {
                    work[target] = multiplier.mul_add(value, work[target]);
                }
                let multiplier = Block::default() - value * inverse_pivots[column];
                pivot = multiplier.mul_add(value, pivot);
                columns[column].push((row, multiplier));
                lower_row.push((column, multiplier));
            }
            if !pivot.0.iter().all(|&value| value > 0.0 && value.is_finite()) {
                return Err(PassError::Unstable);
            }
            inverse_pivots.push(pivot.recip());
            lower.push_row(&lower_row);
        }
        let mut upper = Runs::new();
        for column in &columns {
            upper.push_row(column);
        }
        Ok(Self { lower, upper, inverse_pivots })
    }

    /// Replaces right-hand sides, in elimination order, by the solutions.
    pub(super) fn solve(&self, vector: &mut [Block]) {
        for row in 0..vector.len() {
            vector[row] = self.lower.add_row(row, vector, vector[row]);
        }
        for row in (0..vector.len()).rev() {
            vector[row] =
                self.upper.add_row_back(row, vector, vector[row] * self.inverse_pivots[row]);
        }
    }
}
