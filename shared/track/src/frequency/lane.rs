//! Eight complex numbers in one vector, one per frequency.

use num_complex::Complex64;
use std::array;
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// Frequencies that are solved side by side: the width of an AVX-512 register.
pub(super) const LANES: usize = 8;

/// Angular frequency in rad/s in each lane of at most [`LANES`] frequencies in Hz: the last one repeats.
#[inline(always)]
pub(super) fn omega(frequencies_hz: &[f64]) -> impl Fn(usize) -> f64 {
    move |lane| TAU * frequencies_hz[lane.min(frequencies_hz.len() - 1)]
}

/// The same complex quantity at [`LANES`] frequencies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

    /// At most [`LANES`] values: the last one repeats.
    #[inline(always)]
    pub(super) fn from_values(count: usize, value: impl Fn(usize) -> Complex64) -> Self {
        let value = |lane: usize| value(lane.min(count - 1));
        Self::from_parts(|lane| value(lane).re, |lane| value(lane).im)
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
