//! `L D Lᵀ` of a sparse symmetric matrix, in all lanes at once.

use super::block::Block;
use super::elimination::Elimination;
use crate::time::PassError;

/// A sparse matrix row by row: where rows begin, then columns and values.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<Block>,
}

impl Rows {
    /// Rows of the given lengths, to be filled.
    fn of_lengths(lengths: impl Iterator<Item = usize>) -> Self {
        let mut starts = vec![0];
        let mut total = 0;
        for length in lengths {
            total += length;
            starts.push(total);
        }
        Self { starts, columns: vec![0; total], values: vec![Block::default(); total] }
    }

    /// `sum` less the product of a row with a vector.
    #[inline(always)]
    pub(super) fn reduce(&self, row: usize, vector: &[Block], sum: Block) -> Block {
        let (from, to) = (self.starts[row], self.starts[row + 1]);
        let entries = self.columns[from..to].iter().zip(&self.values[from..to]);
        entries
            .fold(sum, |sum, (&column, value)| value.subtracted_from(vector[column as usize], sum))
    }
}

/// Factor of one matrix a lane, all on the same pattern.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    /// `L` without its diagonal of ones, by rows: for forward elimination.
    pub(super) lower: Rows,
    /// `Lᵀ` without its diagonal, by rows: for back substitution.
    pub(super) upper: Rows,
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
                    let target = factor.upper.columns[place] as usize;
                    work[target] = factor.upper.values[place].subtracted_from(value, work[target]);
                }
                let multiplier = value * factor.inverse_pivots[column];
                pivot = multiplier.subtracted_from(value, pivot);
                factor.set(row, offset, filled[column], column, multiplier);
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
            vector[row] = self.lower.reduce(row, vector, vector[row]);
        }
        for row in (0..vector.len()).rev() {
            vector[row] = self.upper.reduce(row, vector, vector[row] * self.inverse_pivots[row]);
        }
    }

    fn empty(elimination: &Elimination) -> Self {
        let mut column_lengths = vec![0; elimination.order.len()];
        for &column in elimination.rows.iter().flatten() {
            column_lengths[column] += 1;
        }
        Self {
            lower: Rows::of_lengths(elimination.rows.iter().map(Vec::len)),
            upper: Rows::of_lengths(column_lengths.into_iter()),
            inverse_pivots: vec![Block::default(); elimination.order.len()],
        }
    }

    /// Stores an entry of `L`, the `offset`-th of its row, in both triangles.
    fn set(&mut self, row: usize, offset: usize, upper: usize, column: usize, value: Block) {
        let lower = self.lower.starts[row] + offset;
        self.lower.columns[lower] = index(column);
        self.lower.values[lower] = value;
        self.upper.columns[upper] = index(row);
        self.upper.values[upper] = value;
    }
}

/// A place in the shorter form that the inner loops read.
pub(super) fn index(place: usize) -> u32 {
    u32::try_from(place).expect("a track has fewer than four thousand million places")
}
