//! Sparse rows as runs of neighbouring entries, which inner loops go through without indices.

use super::block::Block;

/// What a block may be multiplied by.
pub(super) trait Factor: Copy {
    /// `self × x + sum`, rounded once.
    fn add(self, x: Block, sum: Block) -> Block;
}

impl Factor for f64 {
    #[inline(always)]
    fn add(self, x: Block, sum: Block) -> Block {
        Block::splat(self).mul_add(x, sum)
    }
}

impl Factor for Block {
    #[inline(always)]
    fn add(self, x: Block, sum: Block) -> Block {
        self.mul_add(x, sum)
    }
}

/// Entries of a row that stand side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    column: u32,
    value: u32,
    length: u32,
}

/// The runs of every row.
#[derive(Clone, Debug, Default)]
pub(super) struct Runs {
    all: Vec<Run>,
    /// Where the runs of each row end.
    ends: Vec<u32>,
    /// Values of the rows so far.
    values: u32,
}

impl Runs {
    /// Appends a row of entries in these ascending columns.
    pub(super) fn push_row(&mut self, columns: impl Iterator<Item = usize>) {
        let first_run = self.all.len();
        for column in columns.map(index) {
            match self.all[first_run..].last_mut() {
                Some(run) if run.column + run.length == column => run.length += 1,
                _ => self.all.push(Run { column, value: self.values, length: 1 }),
            }
            self.values += 1;
        }
        self.ends.push(index(self.all.len()));
    }

    /// The runs of a row, from left to right.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &[Run] {
        let from = if row == 0 { 0 } else { self.ends[row - 1] as usize };
        &self.all[from..self.ends[row] as usize]
    }
}

impl Run {
    /// Adds the run's product with a vector to `sum`, from left to right.
    #[inline(always)]
    pub(super) fn add<F: Factor>(&self, factors: &[F], vector: &[Block], sum: Block) -> Block {
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
    pub(super) fn add_back<F: Factor>(&self, factors: &[F], vector: &[Block], sum: Block) -> Block {
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
        let mut runs = Runs::default();
        runs.push_row([1, 2, 5].into_iter());
        runs.push_row(std::iter::empty());
        runs.push_row([6, 7, 8, 9].into_iter());
        let lengths = |row: usize| runs.row(row).iter().map(|run| run.length).collect::<Vec<_>>();
        assert_eq!([lengths(0), lengths(1), lengths(2)], [vec![2, 1], vec![], vec![4]]);
        let vector: Vec<_> = (0..10).map(|x| Block::splat(f64::from(x))).collect();
        let sum = |row: usize| {
            runs.row(row).iter().fold(Block::default(), |sum, run| {
                let once = run.add(&[1.0; 7], &vector, sum);
                assert_eq!(once, run.add_back(&[Block::splat(1.0); 7], &vector, sum));
                once
            })
        };
        assert_eq!([sum(0).0[0], sum(1).0[0], sum(2).0[0]], [8.0, 0.0, 30.0]);
    }
}
