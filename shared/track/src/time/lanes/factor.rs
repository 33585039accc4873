//! `L D Lᵀ` of a sparse symmetric matrix, in all lanes at once.

use super::block::Block;
use super::elimination::Elimination;
use super::runs::Runs;
use crate::time::PassError;

/// A sparse triangle row by row.
#[derive(Clone, Debug)]
pub(super) struct Triangle {
    /// Where each row begins among columns and values.
    starts: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<Block>,
    runs: Runs,
}

impl Triangle {
    /// Zero entries in these ascending columns of the rows.
    fn empty(rows: &[Vec<usize>]) -> Self {
        let mut runs = Runs::default();
        let mut starts = vec![0];
        for row in rows {
            runs.push_row(row.iter().copied());
            starts.push(starts[starts.len() - 1] + row.len());
        }
        let columns: Vec<_> = rows.iter().flatten().copied().collect();
        Self { starts, values: vec![Block::default(); columns.len()], columns, runs }
    }

    /// `sum` plus the product of a row with a vector, from left to right: in forward elimination
    /// the youngest number comes last and is waited for least.
    #[inline(always)]
    pub(super) fn add_row(&self, row: usize, vector: &[Block], mut sum: Block) -> Block {
        for run in self.runs.row(row) {
            sum = run.add(&self.values, vector, sum);
        }
        sum
    }

    /// The same from right to left, for back substitution.
    #[inline(always)]
    pub(super) fn add_row_back(&self, row: usize, vector: &[Block], mut sum: Block) -> Block {
        for run in self.runs.row(row).iter().rev() {
            sum = run.add_back(&self.values, vector, sum);
        }
        sum
    }
}

/// Factor of one matrix a lane, all on the same pattern.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    /// `-L` without its diagonal of ones, by rows: for forward elimination.
    pub(super) lower: Triangle,
    /// `-Lᵀ` without its diagonal, by rows: for back substitution.
    pub(super) upper: Triangle,
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
        let mut factor = Self::empty(elimination);
        let mut filled = factor.upper.starts.clone();
        let mut work = vec![Block::default(); elimination.order.len()];
        for (row, pattern) in elimination.rows.iter().enumerate() {
            for (column, value) in entries(row) {
                if column <= row {
                    work[column] = value;
                }
            }
            let mut pivot = std::mem::take(&mut work[row]);
            for (offset, &column) in pattern.iter().enumerate() {
                let value = std::mem::take(&mut work[column]);
                for place in factor.upper.starts[column]..filled[column] {
                    let target = factor.upper.columns[place];
                    work[target] = factor.upper.values[place].mul_add(value, work[target]);
                }
                let multiplier = Block::default() - value * factor.inverse_pivots[column];
                pivot = multiplier.mul_add(value, pivot);
                let place = factor.lower.starts[row] + offset;
                factor.lower.values[place] = multiplier;
                factor.upper.values[filled[column]] = multiplier;
                filled[column] += 1;
            }
            if !pivot.0.iter().all(|&value| value > 0.0 && value.is_finite()) {
                return Err(PassError::Unstable);
            }
            factor.inverse_pivots[row] = pivot.recip();
        }
        Ok(factor)
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

    fn empty(elimination: &Elimination) -> Self {
        let size = elimination.order.len();
        let mut columns = vec![Vec::new(); size];
        for (row, pattern) in elimination.rows.iter().enumerate() {
            for &column in pattern {
                columns[column].push(row);
            }
        }
        Self {
            lower: Triangle::empty(&elimination.rows),
            upper: Triangle::empty(&columns),
            inverse_pivots: vec![Block::default(); size],
        }
    }
}
