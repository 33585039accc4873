//! Eight complex numbers side by side, one a frequency.

use rustfft::num_complex::Complex64;
use std::array;
use std::ops::{Add, Mul, Sub};

/// Frequencies that are solved side by side: the width of an AVX-512 register.
pub(super) const LANES: usize = 8;

/// The same complex quantity at [`LANES`] frequencies.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(super) struct Lane {
    re: [f64; LANES],
    im: [f64; LANES],
}

impl Lane {
    #[inline(always)]
    pub(super) fn from_parts(re: impl Fn(usize) -> f64, im: impl Fn(usize) -> f64) -> Self {
        Self { re: array::from_fn(re), im: array::from_fn(im) }
    }

    #[inline(always)]
    pub(super) fn real(value: f64) -> Self {
        Self { re: [value; LANES], im: [0.0; LANES] }
    }

    #[inline(always)]
    pub(super) fn recip(self) -> Self {
        let scale: [f64; LANES] =
            array::from_fn(|i| 1.0 / (self.re[i] * self.re[i] + self.im[i] * self.im[i]));
        Self::from_parts(|i| self.re[i] * scale[i], |i| -self.im[i] * scale[i])
    }

    /// The value at one of the frequencies.
    pub(super) fn get(&self, lane: usize) -> Complex64 {
        Complex64::new(self.re[lane], self.im[lane])
    }
}

impl Add for Lane {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::from_parts(|i| self.re[i] + other.re[i], |i| self.im[i] + other.im[i])
    }
}

impl Sub for Lane {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::from_parts(|i| self.re[i] - other.re[i], |i| self.im[i] - other.im[i])
    }
}

impl Mul for Lane {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::from_parts(
            |i| self.re[i] * other.re[i] - self.im[i] * other.im[i],
            |i| self.re[i] * other.im[i] + self.im[i] * other.re[i],
        )
    }
}

/// A symmetric banded matrix at [`LANES`] frequencies, by rows: the entry `(row, row - k)` stands
/// at `row × (width + 1) + k`.
pub(super) struct Banded {
    size: usize,
    width: usize,
    entries: Vec<Lane>,
}

impl Banded {
    /// A matrix of zeros with so many entries beside the diagonal.
    pub(super) fn zeros(size: usize, width: usize) -> Self {
        Self { size, width, entries: vec![Lane::default(); size * (width + 1)] }
    }

    /// Adds to an entry of the lower triangle.
    #[inline(always)]
    pub(super) fn add(&mut self, row: usize, column: usize, value: Lane) {
        let place = row * (self.width + 1) + (row - column);
        self.entries[place] = self.entries[place] + value;
    }

    /// Factors into `L D Lᵀ` in place: `L` below the diagonal, `1 / D` on it.
    ///
    /// Without pivoting: the track's damping keeps every pivot away from zero, and at a resonance
    /// without damping the result is infinite, not wrong.
    #[inline(always)]
    pub(super) fn factor(&mut self) {
        let stride = self.width + 1;
        for row in 0..self.size {
            let first = row.saturating_sub(self.width);
            let mut pivot = self.entries[row * stride];
            for column in first..row {
                // Here still L D; what stands left of it is L D as well.
                let mut value = self.entries[row * stride + row - column];
                for k in first.max(column.saturating_sub(self.width))..column {
                    let left = self.entries[row * stride + row - k];
                    value = value - left * self.entries[column * stride + column - k];
                }
                self.entries[row * stride + row - column] = value;
            }
            for column in first..row {
                let place = row * stride + row - column;
                let scaled = self.entries[place] * self.entries[column * stride];
                pivot = pivot - self.entries[place] * scaled;
                self.entries[place] = scaled;
            }
            self.entries[row * stride] = pivot.recip();
        }
    }

    /// Solves `L y = b` from row `from` on, before which `b` is zero.
    #[inline(always)]
    pub(super) fn forward(&self, b: &mut [Lane], from: usize) {
        let stride = self.width + 1;
        for row in from + 1..self.size {
            let mut value = b[row];
            let first = from.max(row.saturating_sub(self.width));
            for (known, k) in b[first..row].iter().zip(first..) {
                value = value - self.entries[row * stride + row - k] * *known;
            }
            b[row] = value;
        }
    }

    /// Reciprocal pivot of a row.
    #[inline(always)]
    pub(super) fn inverse_pivot(&self, row: usize) -> Lane {
        self.entries[row * (self.width + 1)]
    }

    /// Solves `D Lᵀ x = y`.
    #[inline(always)]
    pub(super) fn backward(&self, y: &mut [Lane]) {
        let stride = self.width + 1;
        for row in (0..self.size).rev() {
            let mut value = y[row] * self.entries[row * stride];
            let end = self.size.min(row + stride);
            for (known, below) in y[row + 1..end].iter().zip(row + 1..) {
                value = value - self.entries[below * stride + below - row] * *known;
            }
            y[row] = value;
        }
    }

    /// The entries of the inverse that lie in the band, from the factor.
    ///
    /// Source: K. Takahashi, J. Fagan and M.-S. Chen, 8th PICA Conference (1973).
    #[inline(always)]
    pub(super) fn selected_inverse(&self, inverse: &mut Self) {
        let (stride, size) = (self.width + 1, self.size);
        for column in (0..size).rev() {
            let end = size.min(column + stride);
            for row in (column + 1..end).rev() {
                let mut value = Lane::default();
                for k in column + 1..end {
                    let (low, high) = if k < row { (k, row) } else { (row, k) };
                    let known = inverse.entries[high * stride + high - low];
                    value = value - known * self.entries[k * stride + k - column];
                }
                inverse.entries[row * stride + row - column] = value;
            }
            let mut value = self.entries[column * stride];
            for k in column + 1..end {
                let factor = self.entries[k * stride + k - column];
                value = value - factor * inverse.entries[k * stride + k - column];
            }
            inverse.entries[column * stride] = value;
        }
    }

    /// An entry of the inverse above its diagonal, from the factor and the entries in its band;
    /// `work` holds a column.
    ///
    /// Each row follows from those next to it by the factor's column, as in
    /// [`Banded::selected_inverse`].
    #[inline(always)]
    pub(super) fn inverse_entry(
        &self,
        inverse: &Self,
        (row, column): (usize, usize),
        work: &mut [Lane],
    ) -> Lane {
        let stride = self.width + 1;
        let in_band = column.saturating_sub(self.width);
        let first = in_band.max(row);
        for (known, k) in work[first..=column].iter_mut().zip(first..) {
            *known = inverse.entries[column * stride + column - k];
        }
        for i in (row..in_band).rev() {
            let mut value = Lane::default();
            for (known, k) in work[i + 1..=i + self.width].iter().zip(i + 1..) {
                value = value - *known * self.entries[k * stride + k - i];
            }
            work[i] = value;
        }
        work[row]
    }

    /// An entry on the diagonal.
    #[inline(always)]
    pub(super) fn diagonal(&self, row: usize) -> Lane {
        self.entries[row * (self.width + 1)]
    }
}
