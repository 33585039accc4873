//! Ranges that some of the values searched for keep to.

use super::Calibration;
use nalgebra::{Cholesky, DVector};

/// A logarithm so near to the end of its range is at it.
const AT_END: f64 = 1e-9;

/// Ranges of the last values; all others are free.
#[derive(Default)]
pub(super) struct Ranges {
    /// Number of the first value with a range.
    pub(super) first: usize,
    /// Lowest and highest of each.
    pub(super) each: Vec<[f64; 2]>,
}

impl Ranges {
    /// Moves values into their ranges.
    pub(super) fn confine(&self, values: &mut DVector<f64>) {
        for (offset, [low, high]) in self.each.iter().enumerate() {
            let value = &mut values[self.first + offset];
            *value = value.clamp(*low, *high);
        }
    }

    /// The step to where a state's gradient vanishes, as far as it stays inside: what is at its
    /// range's end and would leave is kept there, and the others' step is found without it.
    pub(super) fn step(&self, state: &Calibration) -> Option<DVector<f64>> {
        let mut step = state.precision.solve(&state.gradient);
        let factor = state.precision.l();
        let mut precision = &factor * factor.transpose();
        let mut gradient = state.gradient.clone();
        while let Some(kept) = self.leaving(&state.values, &step) {
            precision.row_mut(kept).fill(0.0);
            precision.column_mut(kept).fill(0.0);
            precision[(kept, kept)] = 1.0;
            gradient[kept] = 0.0;
            step = Cholesky::new(precision.clone())?.solve(&gradient);
        }
        let inside = self.each.iter().enumerate().map(|(offset, range)| {
            let index = self.first + offset;
            part_inside(*range, state.values[index], step[index])
        });
        Some(&step * inside.fold(1.0, f64::min))
    }

    /// A value at its range's end that a step would take out of it.
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

/// The part of a step after which a value comes to the end of its range, at most one.
fn part_inside([low, high]: [f64; 2], value: f64, step: f64) -> f64 {
    let room = if step < 0.0 { low - value } else { high - value };
    if step == 0.0 { 1.0 } else { (room / step).min(1.0) }
}
