//! Filters of second order by the bilinear transform.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// A filter with its state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Biquad {
    forward: [f64; 3],
    back: [f64; 2],
    state: [f64; 2],
}

impl Biquad {
    /// `(n2 s^2 + n1 s + n0) / (s^2 + d1 s + 1)` with `s` over the corner's angular frequency; the corner is
    /// given as a share of the sample rate and stays where it is.
    fn new(corner: f64, [n2, n1, n0]: [f64; 3], d1: f64) -> Self {
        let g = 1.0 / (PI * corner).tan();
        let scale = 1.0 / (g * g + d1 * g + 1.0);
        Self {
            forward: [
                (n2 * g * g + n1 * g + n0) * scale,
                2.0 * (n0 - n2 * g * g) * scale,
                (n2 * g * g - n1 * g + n0) * scale,
            ],
            back: [2.0 * (1.0 - g * g) * scale, (g * g - d1 * g + 1.0) * scale],
            state: [0.0; 2],
        }
    }

    /// Passes what is below the corner (Butterworth).
    pub(crate) fn low_pass(corner: f64) -> Self {
        Self::new(corner, [0.0, 0.0, 1.0], 2.0 * FRAC_1_SQRT_2)
    }

    /// Passes what is above the corner (Butterworth).
    pub(crate) fn high_pass(corner: f64) -> Self {
        Self::new(corner, [1.0, 0.0, 0.0], 2.0 * FRAC_1_SQRT_2)
    }

    /// Acceleration of a damped oscillator over that of its foot.
    pub(crate) fn shaken(corner: f64, damping_ratio: f64) -> Self {
        Self::new(corner, [0.0, 2.0 * damping_ratio, 1.0], 2.0 * damping_ratio)
    }

    /// The next value.
    pub(crate) fn next(&mut self, input: f64) -> f64 {
        let [b0, b1, b2] = self.forward;
        let [a1, a2] = self.back;
        let output = b0 * input + self.state[0];
        self.state = [b1 * input - a1 * output + self.state[1], b2 * input - a2 * output];
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain at a share of the sample rate.
    fn gain(mut filter: Biquad, frequency: f64) -> f64 {
        let wave = |n: u32| (2.0 * PI * frequency * f64::from(n)).sin();
        let heard: Vec<f64> = (0..40_000).map(|n| filter.next(wave(n))).collect();
        let power: f64 = heard[20_000..].iter().map(|value| value * value).sum();
        (power / 10_000.0).sqrt()
    }

    #[test]
    fn gains_are_those_of_the_closed_forms() {
        assert!((gain(Biquad::low_pass(0.02), 0.02) - FRAC_1_SQRT_2).abs() < 1e-3);
        assert!((gain(Biquad::high_pass(0.02), 0.1) - 1.0).abs() < 2e-3);
        let [at, expected] = [gain(Biquad::shaken(0.04, 0.05), 0.04), (1.0_f64 + 100.0).sqrt()];
        assert!((at / expected - 1.0).abs() < 1e-2, "{at} and {expected}");
    }
}
