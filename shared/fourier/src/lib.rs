//! Plans of discrete Fourier transforms of any length.
//!
//! The transforms are those of rustfft and realfft, without normalisation. Their generic code compiles in the crate
//! that makes a plan, which takes half a minute: it is this crate alone.

use realfft::RealFftPlanner;
pub use realfft::{ComplexToReal, RealToComplex};
pub use rustfft::Fft;
use rustfft::FftPlanner;
use std::sync::Arc;

/// Transform of `length` complex values into lines: `X_k = sum_n x_n exp(-2 pi i k n / length)`.
pub fn forward(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_forward(length)
}

/// Transform of `length` lines into complex values: `x_n = sum_k X_k exp(2 pi i k n / length)`.
pub fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_inverse(length)
}

/// Transform of `length` real values into the `length / 2 + 1` lines of positive frequency.
pub fn real_forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(length)
}

/// Transform of the `length / 2 + 1` lines of positive frequency into `length` real values.
pub fn real_inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::num_complex::Complex64;
    use std::f64::consts::TAU;

    /// A length that is no product of small primes.
    const LENGTH: usize = 23;

    #[test]
    fn transforms_are_the_sums_of_their_definition() {
        let values: Vec<f64> = (0..LENGTH).map(|n| (n as f64).sqrt()).collect();
        let lines: Vec<Complex64> = (0..LENGTH)
            .map(|k| {
                let turned = |(n, x): (usize, &f64)| {
                    x * Complex64::cis(-TAU * (k * n) as f64 / LENGTH as f64)
                };
                values.iter().enumerate().map(turned).sum()
            })
            .collect();
        let mut complex: Vec<Complex64> = values.iter().map(|&x| x.into()).collect();
        forward(LENGTH).process(&mut complex);
        let are_close = |one: &[Complex64], other: &[Complex64]| {
            one.iter().zip(other).all(|(one, other)| (one - other).norm() < 1e-12 * LENGTH as f64)
        };
        assert!(are_close(&complex, &lines));
        let real = real_forward(LENGTH);
        let mut half = real.make_output_vec();
        real.process(&mut values.clone(), &mut half).unwrap();
        assert!(half.len() == LENGTH / 2 + 1 && are_close(&half, &lines));
        inverse(LENGTH).process(&mut complex);
        let times: Vec<Complex64> = values.iter().map(|x| (LENGTH as f64 * x).into()).collect();
        assert!(are_close(&complex, &times));
        let mut back = vec![0.0; LENGTH];
        real_inverse(LENGTH).process(&mut half, &mut back).unwrap();
        let back: Vec<Complex64> = back.into_iter().map(Complex64::from).collect();
        assert!(are_close(&back, &times));
    }
}
