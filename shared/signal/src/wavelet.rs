//! The Morlet wavelet.

use std::f64::consts::{PI, TAU};

/// The complex Morlet wavelet
/// `psi(t) = pi^(-1/4) (e^(i mu t) - e^(-mu^2 / 2)) e^(-t^2 / 2)`,
/// a cosine under a Gaussian of unit width; the second term makes its mean zero.
///
/// Source: paper, Appendix A, with the centre it does not give; Daubechies, Lu and Wu, *Appl.
/// Comput. Harmon. Anal.* 30 (2011).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Morlet {
    centre: f64,
}

impl Morlet {
    /// The wavelet of centre `mu` in rad.
    pub const fn new(centre_rad: f64) -> Self {
        Self { centre: centre_rad }
    }

    /// Centre `mu` in rad.
    pub const fn centre_rad(self) -> f64 {
        self.centre
    }

    /// Fourier transform at the angular frequency `w` in rad (real):
    /// `sqrt(2) pi^(1/4) (e^(-(w - mu)^2 / 2) - e^(-mu^2 / 2) e^(-w^2 / 2))` for `w > 0`.
    ///
    /// Zero for `w <= 0`: the wavelet is analytic and has no negative frequencies.
    pub fn fourier(self, w: f64) -> f64 {
        if w <= 0.0 {
            return 0.0;
        }
        let mu = self.centre;
        let peak = (-0.5 * (w - mu).powi(2)).exp();
        let correction = (-0.5 * mu * mu).exp() * (-0.5 * w * w).exp();
        2_f64.sqrt() * PI.powf(0.25) * (peak - correction)
    }

    /// Frequency in Hz at which a voice of `scale` in s is centred, `mu / (2 pi a)` (paper,
    /// eq. 3).
    pub fn frequency_hz(self, scale: f64) -> f64 {
        self.centre / (TAU * scale)
    }

    /// Scale in s of the voice centred at `frequency_hz`.
    pub fn scale(self, frequency_hz: f64) -> f64 {
        self.centre / (TAU * frequency_hz)
    }

    /// Magnitude of the sum over all scales for a complex tone of amplitude one:
    /// `sum_j W(a_j, b) a_j^(-3/2) (a_j - a_(j-1))` with `a_j = s_0 2^(j / N_v)`.
    ///
    /// It is `(1 - 2^(-1 / N_v)) sum_j psihat(2^(j / N_v))`, close to `integral psihat(w) / w dw`
    /// times `(1 - 2^(-1 / N_v)) N_v / ln 2`. A real signal has half its amplitude at positive
    /// frequencies: twice the sum divided by this constant gives the signal back (its real part).
    pub fn sum_over_scales(self, voices_per_octave: u32) -> f64 {
        let voices = f64::from(voices_per_octave);
        // Beyond thirty octaves below and four above the centre all terms together are below 1e-15.
        let (low, high) = (-30 * i64::from(voices_per_octave), 4 * i64::from(voices_per_octave));
        let sum: f64 =
            (low..=high).map(|j| self.fourier(self.centre * (j as f64 / voices).exp2())).sum();
        (1.0 - (-1.0 / voices).exp2()) * sum
    }

    /// Factor on each voice with which the sum of all voices is the analytic signal:
    /// `2 (1 - 2^(-1 / N_v))` divided by [`sum_over_scales`](Self::sum_over_scales). It applies to the
    /// transform without the root of the scale.
    pub fn share_of_a_voice(self, voices_per_octave: u32) -> f64 {
        let spacing = 1.0 - (-1.0 / f64::from(voices_per_octave)).exp2();
        2.0 * spacing / self.sum_over_scales(voices_per_octave)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fourier_transform_is_that_of_the_wavelet_in_time() {
        let wavelet = Morlet::new(6.0);
        let step = 1e-3;
        for w in [0.5, 3.0, 6.0, 7.5] {
            // The integrand is smooth and vanishes at the ends: the sum is exact to rounding.
            let sum: f64 = (-12_000..=12_000)
                .map(|k| {
                    let t = f64::from(k) * step;
                    let envelope = PI.powf(-0.25) * (-0.5 * t * t).exp();
                    let correction = (-18.0_f64).exp();
                    envelope * (((6.0 - w) * t).cos() - correction * (w * t).cos()) * step
                })
                .sum();
            assert!((sum - wavelet.fourier(w)).abs() < 1e-12, "w = {w}");
        }
    }

    #[test]
    fn the_sum_over_scales_is_the_integral_times_the_spacing() {
        let wavelet = Morlet::new(6.0);
        let step = 1e-3;
        let integral: f64 =
            (1..20_000).map(|k| f64::from(k) * step).map(|w| wavelet.fourier(w) / w * step).sum();
        let spacing = (1.0 - (-1.0_f64 / 48.0).exp2()) * 48.0 / 2_f64.ln();
        // Both sums are of smooth functions that vanish at the ends.
        assert!((wavelet.sum_over_scales(48) / (integral * spacing) - 1.0).abs() < 1e-9);
    }
}
