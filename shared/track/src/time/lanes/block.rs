//! Eight numbers in one vector, one per case.

use std::array;
use std::ops::{Add, Mul, Sub};

/// Cases that are computed side by side: the width of an AVX-512 register.
pub(super) const LANES: usize = 8;

/// The same quantity in [`LANES`] cases.
///
/// Sums of products go through [`Block::mul_add`], whose single rounding is the same on every
/// instruction set, and lanes never mix: a case's result does not depend on its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Block(pub(super) [f64; LANES]);

impl Block {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(super) fn from_fn(lane: impl FnMut(usize) -> f64) -> Self {
        Self(array::from_fn(lane))
    }

    /// `self × factor + sum`, rounded once.
    #[inline(always)]
    pub(super) fn mul_add(self, factor: Self, sum: Self) -> Self {
        Self::from_fn(|lane| self.0[lane].mul_add(factor.0[lane], sum.0[lane]))
    }

    /// `self × factor - less`, rounded once.
    #[inline(always)]
    pub(super) fn mul_sub(self, factor: Self, less: Self) -> Self {
        Self::from_fn(|lane| self.0[lane].mul_add(factor.0[lane], -less.0[lane]))
    }

    /// `sum - self × factor`, rounded once.
    #[inline(always)]
    pub(super) fn subtracted_from(self, factor: Self, sum: Self) -> Self {
        Self::from_fn(|lane| (-self.0[lane]).mul_add(factor.0[lane], sum.0[lane]))
    }

    #[inline(always)]
    pub(super) fn recip(self) -> Self {
        Self(self.0.map(f64::recip))
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    /// The common value of all lanes, if there is one.
    pub(super) fn uniform(self) -> Option<f64> {
        self.0.iter().all(|value| value.to_bits() == self.0[0].to_bits()).then_some(self.0[0])
    }
}

impl Add for Block {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::from_fn(|lane| self.0[lane] + other.0[lane])
    }
}

impl Sub for Block {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::from_fn(|lane| self.0[lane] - other.0[lane])
    }
}

impl Mul for Block {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::from_fn(|lane| self.0[lane] * other.0[lane])
    }
}
