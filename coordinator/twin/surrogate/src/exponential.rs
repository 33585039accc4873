//! Vectorised exponential function.
//!
//! A covariance of 5000 entries needs twelve million exponentials. The scalar function would take a quarter
//! of the time of the factorisation.

use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::LOG2_E;

/// If this constant is added to a number below 2^51, the last bits of the sum hold the nearest integer.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// The first 33 bits of `ln 2`, whose products with exponents are exact; `LN_2_LOW` is the rest.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// Below this argument the exponential is less than the smallest normal number and is set to zero.
const LEAST: f64 = -708.0;

/// `1 / k!` for k = 13 down to 0. The truncation error of the series is below 4e-18.
const SERIES: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// Replaces distances `r` by their correlations `exp(-r / length)`, with an error of at most two roundings.
pub(crate) fn correlate(distances: &mut [f64], length: f64) {
    Arch::new().dispatch(Correlate { distances, factor: -1.0 / length });
}

struct Correlate<'a> {
    distances: &'a mut [f64],
    factor: f64,
}

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be compiled for each instruction set")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for value in self.distances {
            *value = exponential(*value * self.factor);
        }
    }
}

/// `exp(x)` for `x <= 0`, without branches.
#[expect(clippy::inline_always, reason = "must be compiled for each instruction set")]
#[inline(always)]
fn exponential(x: f64) -> f64 {
    let clamped = x.max(LEAST);
    let shifted = clamped.mul_add(LOG2_E, ROUNDING);
    let exponent = shifted - ROUNDING;
    let rest = (-exponent).mul_add(LN_2_LOW, (-exponent).mul_add(LN_2_HIGH, clamped));
    let series = SERIES.iter().fold(0.0_f64, |sum, term| sum.mul_add(rest, *term));
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    if x < LEAST { 0.0 } else { series * power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential_to_two_roundings() {
        assert!((LN_2_HIGH + LN_2_LOW - std::f64::consts::LN_2).abs() < f64::EPSILON);
        for step in 0..100_000 {
            let distance = f64::from(step) * 0.007;
            let mut found = [distance];
            correlate(&mut found, 1.0);
            let exact = (-distance).exp();
            assert!((found[0] - exact).abs() <= 2.0 * f64::EPSILON * exact, "{distance}");
        }
    }

    #[test]
    fn far_apart_there_is_no_correlation() {
        let mut far = [800.0, 1e300, f64::INFINITY];
        correlate(&mut far, 1.0);
        assert_eq!(far, [0.0; 3]);
    }
}
