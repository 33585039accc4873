//! Sparse rows as runs of neighbouring entries, which inner loops go through without indices.

use crate::time::lanes::block::Block;
use std::collections::HashMap;

/// What a block may be multiplied by.
pub(super) trait Factor: Copy {
    /// `self × x + sum`, rounded once.
    fn add(self, x: Block, sum: Block) -> Block;
    /// Its bits, by which equal factors are known.
    fn bits(self) -> impl Iterator<Item = u64>;
}

impl Factor for f64 {
    #[inline(always)]
    fn add(self, x: Block, sum: Block) -> Block {
        Block::splat(self).mul_add(x, sum)
    }

    fn bits(self) -> impl Iterator<Item = u64> {
        std::iter::once(self.to_bits())
    }
}

impl Factor for Block {
    #[inline(always)]
    fn add(self, x: Block, sum: Block) -> Block {
        self.mul_add(x, sum)
    }

    fn bits(self) -> impl Iterator<Item = u64> {
        self.0.into_iter().map(f64::to_bits)
    }
}

/// Entries of a row that stand side by side.
#[derive(Clone, Copy, Debug)]
struct Run {
    column: u32,
    value: u32,
    length: u32,
}

/// A sparse matrix as the runs of every row.
///
/// Runs with equal values share their storage. Rails and sleepers are equal from span to span, so the
/// values stay in the cache.
#[derive(Clone, Debug)]
pub(super) struct Runs<F> {
    all: Vec<Run>,
    /// Where the runs of each row end.
    ends: Vec<u32>,
    values: Vec<F>,
    /// Where a run of these bits is stored.
    known: HashMap<Vec<u64>, u32>,
}

impl<F: Factor> Runs<F> {
    pub(super) fn new() -> Self {
        Self { all: Vec::new(), ends: Vec::new(), values: Vec::new(), known: HashMap::new() }
    }

    /// Appends a row of entries in ascending columns.
    pub(super) fn push_row(&mut self, entries: &[(usize, F)]) {
        for run in entries.chunk_by(|left, right| left.0 + 1 == right.0) {
            let bits = run.iter().flat_map(|(_, factor)| factor.bits()).collect();
            let value = *self.known.entry(bits).or_insert_with(|| {
                self.values.extend(run.iter().map(|&(_, factor)| factor));
                index(self.values.len() - run.len())
            });
            self.all.push(Run { column: index(run[0].0), value, length: index(run.len()) });
        }
        self.ends.push(index(self.all.len()));
    }

    /// `sum` plus the product of a row with a vector, added up from left to right.
    #[inline(always)]
    pub(super) fn add_row(&self, row: usize, vector: &[Block], mut sum: Block) -> Block {
        for run in self.row(row) {
            sum = run.add(&self.values, vector, sum);
        }
        sum
    }

    /// The same from right to left.
    #[inline(always)]
    pub(super) fn add_row_back(&self, row: usize, vector: &[Block], mut sum: Block) -> Block {
        for run in self.row(row).iter().rev() {
            sum = run.add_back(&self.values, vector, sum);
        }
        sum
    }

    /// The runs of a row, from left to right.
    #[inline(always)]
    fn row(&self, row: usize) -> &[Run] {
        let from = if row == 0 { 0 } else { self.ends[row - 1] as usize };
        &self.all[from..self.ends[row] as usize]
    }
}

impl Run {
    /// Adds the run's product with a vector to `sum`, from left to right.
    #[inline(always)]
    fn add<F: Factor>(&self, factors: &[F], vector: &[Block], sum: Block) -> Block {
        match (self.of(self.value, factors), self.of(self.column, vector)) {
            ([a], [x]) => a.add(*x, sum),
            ([a, b], [x, y]) => b.add(*y, a.add(*x, sum)),
            ([a, b, c], [x, y, z]) => c.add(*z, b.add(*y, a.add(*x, sum))),
            ([a, b, c, d, e, f], [u, v, w, x, y, z]) => {
                let half = c.add(*w, b.add(*v, a.add(*u, sum)));
                f.add(*z, e.add(*y, d.add(*x, half)))
            }
            (factors, vector) => {
                let mut sum = sum;
                for (factor, x) in factors.iter().zip(vector) {
                    sum = factor.add(*x, sum);
                }
                sum
            }
        }
    }

    /// The same from right to left.
    #[inline(always)]
    fn add_back<F: Factor>(&self, factors: &[F], vector: &[Block], sum: Block) -> Block {
        match (self.of(self.value, factors), self.of(self.column, vector)) {
            ([a], [x]) => a.add(*x, sum),
            ([a, b], [x, y]) => a.add(*x, b.add(*y, sum)),
            ([a, b, c], [x, y, z]) => a.add(*x, b.add(*y, c.add(*z, sum))),
            (factors, vector) => {
                let mut sum = sum;
                for (factor, x) in factors.iter().zip(vector).rev() {
                    sum = factor.add(*x, sum);
                }
                sum
            }
        }
    }

    #[inline(always)]
    fn of<'a, T>(&self, from: u32, list: &'a [T]) -> &'a [T] {
        &list[from as usize..][..self.length as usize]
    }
}

/// A place in the shorter form that the inner loops read.
fn index(place: usize) -> u32 {
    u32::try_from(place).expect("a track has fewer than four thousand million places")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_form_one_run_and_rows_stay_apart() {
        let mut runs = Runs::new();
        runs.push_row(&[(1, 1.0), (2, 2.0), (5, 3.0)]);
        runs.push_row(&[]);
        runs.push_row(&[(6, 1.0), (7, 1.0), (8, 1.0), (9, 1.0)]);
        let lengths = |row: usize| runs.row(row).iter().map(|run| run.length).collect::<Vec<_>>();
        assert_eq!([lengths(0), lengths(1), lengths(2)], [vec![2, 1], vec![], vec![4]]);
        let vector: Vec<_> = (0..10).map(|x| Block::splat(f64::from(x))).collect();
        for (row, sum) in [(0, 1.0 + 4.0 + 15.0), (1, 0.0), (2, 30.0)] {
            assert_eq!(runs.add_row(row, &vector, Block::default()), Block::splat(sum));
            assert_eq!(runs.add_row_back(row, &vector, Block::default()), Block::splat(sum));
        }
    }

    #[test]
    fn equal_runs_are_stored_once() {
        let mut runs = Runs::new();
        for first in [0, 4, 8] {
            runs.push_row(&[(first, Block::splat(1.0)), (first + 1, Block::splat(2.0))]);
        }
        assert_eq!(runs.values.len(), 2);
    }
}
