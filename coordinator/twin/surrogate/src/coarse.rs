//! Feature vectors rounded to eight bits per number, and bounds on their distances.
//!
//! An exhaustive search reads the whole library. Eight-bit numbers need one eighth of the bytes and of the
//! time of double precision. The length of the rounding error of every vector is stored; it bounds the
//! error of every distance.

use pulp::{Arch, Simd, WithSimd};

/// Largest rounded number.
const LARGEST: f64 = 127.0;

/// Standard deviations represented by [`LARGEST`]: wide enough for nearly all values. Larger ones
/// are clipped, which counts as rounding.
const REACH: f64 = 4.0;

/// Ratio of the rounding step of the library rows to the finer step of the observed vector.
const FINER: f64 = 16.0;

/// Every row is filled up to a multiple of this length, so that every SIMD register is full.
const STRIDE: usize = 64;

/// Bound on the error of a thousand roundings in double precision, as a share of a vector's length.
const DOUBLE_ROUNDING: f64 = 1e-12;

/// Rounded rows of a library.
pub(crate) struct Coarse {
    /// Mean row. It is subtracted from every row, because small numbers have small rounding errors.
    centre: Vec<f64>,
    /// Step of the rounding: the feature value that corresponds to 1 in `rows`.
    step: f64,
    /// Rounded rows, one after the other; each is filled with zeros up to a multiple of [`STRIDE`].
    rows: Vec<i8>,
    /// Square lengths of the rounded rows in units of `step²`.
    squares: Vec<f64>,
    /// Norm of the rounding error of every row, in the unit of the features.
    rounded_off: Vec<f64>,
}

impl Coarse {
    /// Rounds `rows` (row-major, `dimension` numbers per row).
    pub(crate) fn new(rows: &[f64], dimension: usize) -> Self {
        let count = (rows.len() / dimension) as f64;
        let mut centre = vec![0.0; dimension];
        for row in rows.chunks_exact(dimension) {
            centre.iter_mut().zip(row).for_each(|(mean, x)| *mean += x / count);
        }
        let power: f64 = rows
            .chunks_exact(dimension)
            .flat_map(|row| row.iter().zip(&centre).map(|(x, mean)| (x - mean).powi(2)))
            .sum();
        let deviation = (power / rows.len() as f64).sqrt();
        let step = if deviation > 0.0 { REACH * deviation / LARGEST } else { 1.0 };
        let mut out =
            Self { centre, step, rows: Vec::new(), squares: Vec::new(), rounded_off: Vec::new() };
        for row in rows.chunks_exact(dimension) {
            let rounded = out.rounded(row, step, LARGEST);
            out.squares.push(rounded.square);
            out.rounded_off.push(rounded.off);
            out.rows.extend(rounded.values.iter().map(|&value| value as i8));
        }
        out
    }

    /// Lower and upper bound of the distance of each row from `observed`, in the unit of the features.
    pub(crate) fn bounds(&self, observed: &[f64]) -> impl Iterator<Item = [f64; 2]> {
        let padded = observed.len().next_multiple_of(STRIDE) as f64;
        // No sum of products may leave 32 bits.
        let largest = (f64::from(i32::MAX) / (LARGEST * padded)).floor().min(f64::from(i16::MAX));
        let observed = self.rounded(observed, self.step / FINER, largest);
        let vector: Vec<i16> = observed.values.iter().map(|&value| value as i16).collect();
        let products = Arch::new().dispatch(Products { rows: &self.rows, vector: &vector });
        let own_square = observed.square / (FINER * FINER);
        let rows = products.into_iter().zip(&self.squares).zip(&self.rounded_off);
        rows.map(move |((product, square), off)| {
            let apart = square + own_square - 2.0 * f64::from(product) / FINER;
            let (distance, doubt) = (self.step * apart.max(0.0).sqrt(), off + observed.off);
            [distance - doubt, distance + doubt]
        })
    }

    fn rounded(&self, row: &[f64], step: f64, largest: f64) -> Rounded {
        let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut values = Vec::with_capacity(row.len().next_multiple_of(STRIDE));
        let mut off = 0.0;
        for (x, mean) in row.iter().zip(&self.centre) {
            let value = ((x - mean) / step).round().clamp(-largest, largest);
            off += (x - mean - value * step).powi(2);
            values.push(value);
        }
        values.resize(row.len().next_multiple_of(STRIDE), 0.0);
        let square = values.iter().map(|value| value * value).sum();
        Rounded { values, square, off: off.sqrt() + DOUBLE_ROUNDING * length }
    }
}

/// A centred vector in whole numbers.
struct Rounded {
    values: Vec<f64>,
    square: f64,
    /// Norm of the rounding error, in the unit of the features.
    off: f64,
}

/// Products of rows with a vector, compiled for every instruction set.
struct Products<'a> {
    rows: &'a [i8],
    vector: &'a [i16],
}

impl WithSimd for Products<'_> {
    type Output = Vec<i32>;

    #[expect(clippy::inline_always, reason = "must be compiled for each instruction set")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<i32> {
        let mut products = Vec::with_capacity(self.rows.len() / self.vector.len());
        // A loop: what an iterator's adapter calls would not be compiled for the instruction set.
        for row in self.rows.chunks_exact(self.vector.len()) {
            let mut product = 0;
            for (a, b) in row.iter().zip(self.vector) {
                product += i32::from(*a) * i32::from(*b);
            }
            products.push(product);
        }
        products
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_distance_lies_between_its_bounds() {
        // One row far out of reach, one observed vector farther out than its rounding goes.
        let values = (0..40 * 70).map(|i| (f64::from(i) * 12.9898).sin());
        let mut rows: Vec<f64> = values.collect();
        rows[70..140].fill(50.0);
        let coarse = Coarse::new(&rows, 70);
        let shifted = |shift: f64| rows[350..420].iter().map(|x| x + shift).collect();
        let near: Vec<f64> = shifted(0.01);
        for observed in [near, shifted(3.0), shifted(1e6)] {
            for (row, [low, high]) in rows.chunks(70).zip(coarse.bounds(&observed)) {
                let squares = row.iter().zip(&observed).map(|(a, b)| (a - b).powi(2));
                let distance = squares.sum::<f64>().sqrt();
                assert!((low..=high).contains(&distance), "{low} {distance} {high}");
            }
        }
    }

    #[test]
    fn rounding_hides_little() {
        let rows: Vec<f64> = (0..100 * 300).map(|i| (f64::from(i) * 78.233).sin()).collect();
        let coarse = Coarse::new(&rows, 300);
        // 4 / 127 of a deviation of 0.71 is a step; a rounding has 0.29 of it, a row 17 of those.
        for [low, high] in coarse.bounds(&rows[..300]) {
            assert!(high - low < 0.25, "{low} {high}");
        }
    }
}
