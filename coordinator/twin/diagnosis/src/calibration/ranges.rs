//! Ranges that restrict some of the searched values.

use nalgebra::{Cholesky, DVector, Dyn};

/// A logarithm is at the end of its range if its distance from the end is smaller.
const AT_END: f64 = 1e-9;

/// Ranges of the last values; all others are free.
#[derive(Default)]
pub(super) struct Ranges {
    /// Index of the first value with a range.
    pub(super) first: usize,
    /// Lowest and highest value of each.
    pub(super) each: Vec<[f64; 2]>,
}

impl Ranges {
    /// Clamps values to their ranges.
    pub(super) fn confine(&self, values: &mut DVector<f64>) {
        for (offset, [low, high]) in self.each.iter().enumerate() {
            let value = &mut values[self.first + offset];
            *value = value.clamp(*low, *high);
        }
    }

    /// The Gauss-Newton step from some values, limited to the ranges, with the precision and the gradient
    /// of the log posterior. A value at the end of its range that would leave the range is held, and the
    /// step of the other values is computed without it.
    pub(super) fn step(
        &self,
        values: &DVector<f64>,
        precision: &Cholesky<f64, Dyn>,
        mut gradient: DVector<f64>,
    ) -> Option<DVector<f64>> {
        let mut step = precision.solve(&gradient);
        let mut held = None;
        while let Some(kept) = self.leaving(values, &step) {
            let precision = held.get_or_insert_with(|| {
                let factor = precision.l();
                &factor * factor.transpose()
            });
            precision.row_mut(kept).fill(0.0);
            precision.column_mut(kept).fill(0.0);
            precision[(kept, kept)] = 1.0;
            gradient[kept] = 0.0;
            step = Cholesky::new(precision.clone())?.solve(&gradient);
        }
        let inside = self.each.iter().enumerate().map(|(offset, range)| {
            let index = self.first + offset;
            part_inside(*range, values[index], step[index])
        });
        Some(&step * inside.fold(1.0, f64::min))
    }

    /// Index of a value at the end of its range that the step would move out of the range.
    fn leaving(&self, values: &DVector<f64>, step: &DVector<f64>) -> Option<usize> {
        let leaves = |(offset, [low, high]): (usize, &[f64; 2])| {
            let index = self.first + offset;
            let (value, step) = (values[index], step[index]);
            let is_out =
                (value - low < AT_END && step < 0.0) || (high - value < AT_END && step > 0.0);
            is_out.then_some(index)
        };
        self.each.iter().enumerate().find_map(leaves)
    }
}

/// Share of a step, at most one, that keeps a value inside its range.
fn part_inside([low, high]: [f64; 2], value: f64, step: f64) -> f64 {
    let room = if step < 0.0 { low - value } else { high - value };
    if step == 0.0 { 1.0 } else { (room / step).min(1.0) }
}
