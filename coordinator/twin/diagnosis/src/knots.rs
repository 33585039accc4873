//! Knots along the logarithm of a wave number or a frequency, between which a function is linear.

use std::ops::Range;

/// Distance of knots in the logarithm of the wave number or of the frequency.
pub(crate) const KNOT_DISTANCE: f64 = 0.35;

/// Logarithms of equidistant knots that cover a range.
pub(crate) fn knots(range: Range<f64>) -> Vec<f64> {
    let (from, to) = (range.start.ln(), range.end.ln());
    let count = ((to - from) / KNOT_DISTANCE).ceil() as usize + 1;
    (0..count).map(|knot| from + KNOT_DISTANCE * knot as f64).collect()
}

/// Knots on both sides of a value, as indices from `first`, with interpolation weights.
pub(crate) fn shares(knots: &[f64], value: f64, first: usize) -> [(usize, f64); 2] {
    let last = knots.len() - 1;
    let place = ((value.ln() - knots[0]) / KNOT_DISTANCE).clamp(0.0, last as f64);
    let left = (place.floor() as usize).min(last - 1);
    let share = place - left as f64;
    [(first + left, 1.0 - share), (first + left + 1, share)]
}
