//! Basis functions of frequency for an unknown dynamic stiffness.

use num_complex::Complex64;

/// Number of basis functions over the logarithm of the frequency.
pub(super) const BUMPS: usize = 14;

/// Overlapping triangles over the logarithm of the frequency.
pub(super) struct Bumps {
    /// Centre of each in Hz.
    pub(super) centres_hz: Vec<f64>,
    /// Real and imaginary part of each at every line: `[2 × bump + part][line]`.
    pub(super) shapes: Vec<Vec<Complex64>>,
}

impl Bumps {
    /// Basis functions from the first to the last of the lines in Hz.
    pub(super) fn over(lines_hz: &[f64]) -> Self {
        let (from, to) = (lines_hz[0].ln(), lines_hz[lines_hz.len() - 1].ln());
        let width = (to - from) / (BUMPS - 1) as f64;
        let centres: Vec<f64> = (0..BUMPS).map(|bump| from + width * bump as f64).collect();
        let height = |centre: f64, hz: f64| (1.0 - ((hz.ln() - centre) / width).abs()).max(0.0);
        let parts = |&centre: &f64| {
            [Complex64::ONE, Complex64::I]
                .map(|part| lines_hz.iter().map(|&hz| part * height(centre, hz)).collect())
        };
        let shapes = centres.iter().flat_map(parts).collect();
        Self { centres_hz: centres.into_iter().map(f64::exp).collect(), shapes }
    }

    /// Weighted mean over each basis function of the values at all lines.
    pub(super) fn mean(&self, values: &[f64]) -> Vec<f64> {
        let mean = |shape: &Vec<Complex64>| {
            let weighted = shape.iter().zip(values).map(|(weight, value)| weight.re * value);
            weighted.sum::<f64>() / shape.iter().map(|weight| weight.re).sum::<f64>()
        };
        // Every second shape is a bump's real part.
        self.shapes.iter().step_by(2).map(mean).collect()
    }
}
