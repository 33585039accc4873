//! The synchrosqueezed wavelet transform (SSWT), a literal implementation of the formula.

use crate::{
    transform::{Cwt, TimeFrequency},
    wavelet::Morlet,
};

/// Factor on the sums of eq. A.4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalisation {
    /// As printed: divided by the spacing of the bins, `f_l - f_(l+1)` in Hz.
    Printed,
    /// The sum of `W a^(-3/2) da` alone.
    Sum,
    /// Twice the sum, divided by the sum for a complex tone of amplitude one
    /// ([`Morlet::sum_over_scales`]). A tone of amplitude `A` gives `A`, and the sum of the real part
    /// over frequency is the signal.
    SignalBack,
}

/// Conventions that eq. A.3 and A.4 do not define.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conventions {
    /// The factor of the sums.
    pub normalisation: Normalisation,
    /// Threshold relative to the largest magnitude. Coefficients up to this threshold are omitted,
    /// because rounding determines their phase.
    pub threshold: f64,
}

/// Reassigns every coefficient to its instantaneous frequency `Re(weighted / W)` (paper, eq. A.3, A.4).
/// The result has one row per scale, at the frequency of the scale, and the columns of the transform.
///
/// The scales are `a_j = a_0 2^(j / voices_per_octave)`. A coefficient is added to the bin nearest in
/// the logarithm of frequency. A coefficient outside all bins is omitted.
///
/// # Panics
/// If there are no scales.
pub fn squeeze(
    cwt: &Cwt,
    wavelet: Morlet,
    voices_per_octave: u32,
    conventions: Conventions,
) -> TimeFrequency {
    let bins = cwt.coefficients.frequencies_hz.clone();
    let (highest_hz, bin_count) = (bins[0], bins.len());
    let voices = f64::from(voices_per_octave);
    // da_j = a_j - a_(j-1), also for the first scale.
    let spacing = 1.0 - (-1.0 / voices).exp2();
    let threshold = conventions.threshold * cwt.coefficients.largest();
    let mut squeezed = TimeFrequency::zeros(bins, cwt.coefficients.columns());

    for (row, &scale) in cwt.scales_s.iter().enumerate() {
        let weight = scale.powf(-1.5) * scale * spacing;
        let pairs = cwt.coefficients.row(row).iter().zip(cwt.weighted.row(row));
        for (column, (&value, &weighted)) in pairs.enumerate() {
            let frequency_hz = (weighted / value).re;
            if value.norm() <= threshold || frequency_hz.is_nan() || frequency_hz <= 0.0 {
                continue;
            }
            let bin = (voices * (highest_hz / frequency_hz).log2()).round();
            if (0.0..bin_count as f64).contains(&bin) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "just compared"
                )]
                let bin = bin as usize;
                squeezed.row_mut(bin)[column] += value * weight;
            }
        }
    }
    normalise(&mut squeezed, wavelet, voices_per_octave, conventions.normalisation);
    squeezed
}

fn normalise(
    squeezed: &mut TimeFrequency,
    wavelet: Morlet,
    voices_per_octave: u32,
    normalisation: Normalisation,
) {
    let spacing = 1.0 - (-1.0 / f64::from(voices_per_octave)).exp2();
    let signal_back = 2.0 / wavelet.sum_over_scales(voices_per_octave);
    for row in 0..squeezed.frequencies_hz.len() {
        let factor = match normalisation {
            Normalisation::Printed => 1.0 / (squeezed.frequencies_hz[row] * spacing),
            Normalisation::Sum => 1.0,
            Normalisation::SignalBack => signal_back,
        };
        for value in squeezed.row_mut(row) {
            *value *= factor;
        }
    }
}
