//! Definition of the features: settings on which simulations and recordings must agree.

use super::ThirdOctave;
use crate::wavelet::Morlet;
use serde::{Deserialize, Serialize};
use tracktwin_number::rounded;

/// All settings that determine the value of a feature.
///
/// Scales and bins follow from [`reference_rate_hz`](Self::reference_rate_hz), not from the sample rate
/// of the recording. Features of one definition are therefore comparable across sample rates. Features
/// of two definitions are not comparable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeatureDefinition {
    /// Centre `mu` of the Morlet wavelet in rad.
    pub wavelet_centre_rad: f64,
    /// Voices per octave `N_v` (paper, eq. A.2).
    pub voices_per_octave: u32,
    /// The rate `f_s` in Hz in the base scale `s_0 = 2 / f_s` (paper, eq. A.2).
    pub reference_rate_hz: f64,
    /// Lowest allowed frequency of a bin in Hz (paper, eq. 9).
    pub lowest_hz: f64,
    /// Highest allowed frequency of a bin in Hz (paper, eq. 9).
    pub highest_hz: f64,
    /// Number of instants per second, in Hz, at which the transform is computed in the window.
    ///
    /// The default is a quarter of 100 kHz: six instants per period at 4 kHz. The transform rounds this
    /// rate, by less than 1e-4, so that the instants are evenly spaced in the transformed stretch.
    pub instant_rate_hz: f64,
    /// Whether bins of low frequency have fewer instants: half as many from three octaves below the
    /// highest frequency, and half as many again for every further octave and a half.
    ///
    /// The power of a bin changes more slowly at a lower frequency. With this rule, the omitted instants
    /// cause about the same error in all bins.
    pub thinned: bool,
    /// Length in s of the signal on either side of the window that the transform uses. It is shorter if
    /// the signal ends earlier.
    ///
    /// The default is three standard deviations (of 19 ms) of the wavelet at 50 Hz.
    pub margin_s: f64,
    /// Floor of the LWPS in (m/s2)^2. Smaller values are replaced by this floor before the logarithm is
    /// computed.
    ///
    /// The default is an amplitude of 10 um/s2, below the noise of any accelerometer.
    pub floor_m2_s4: f64,
}

impl Default for FeatureDefinition {
    fn default() -> Self {
        Self {
            wavelet_centre_rad: 6.0,
            voices_per_octave: 48,
            reference_rate_hz: 100_000.0,
            lowest_hz: 50.0,
            highest_hz: 4000.0,
            instant_rate_hz: 25_000.0,
            thinned: true,
            margin_s: 0.06,
            floor_m2_s4: 1e-10,
        }
    }
}

/// Largest number of instants of a margin. The required memory is proportional to this number and to
/// that of the bins.
const INSTANTS_MAX: f64 = 1e5;

/// Part of a voice by which a point may lie outside a range: one that is meant to lie on the
/// border is not lost to rounding.
const ROUNDING: f64 = 1e-9;

/// Octaves over which a thinned definition halves the instants. The first halving comes after twice as
/// many octaves.
const OCTAVES_A_HALVING: f64 = 1.5;

/// Why a definition is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DefinitionError {
    /// A value is outside its allowed range.
    #[error("{name} is {value}, but must lie in {low} .. {high}")]
    OutOfRange {
        /// Name of the field of [`FeatureDefinition`].
        name: &'static str,
        /// Its value.
        value: f64,
        /// Lowest value allowed.
        low: f64,
        /// Highest value allowed.
        high: f64,
    },
    /// No bin lies between the lowest and the highest frequency.
    #[error(
        "no bin lies between {} and {} Hz",
        rounded(*lowest_hz, 5),
        rounded(*highest_hz, 5)
    )]
    NoBins {
        /// Lowest frequency in Hz.
        lowest_hz: f64,
        /// Highest frequency in Hz.
        highest_hz: f64,
    },
}

impl FeatureDefinition {
    /// Frequencies of the bins in Hz, ascending: `f_l = mu / (2 pi a_l)` in `lowest_hz ..= highest_hz`.
    /// Empty if a field is out of the range of [`check`](Self::check).
    pub fn frequencies_hz(&self) -> Vec<f64> {
        if self.check_ranges().is_err() {
            return Vec::new();
        }
        self.grid_indices(self.lowest_hz, self.highest_hz).map(|j| self.frequency_hz(j)).collect()
    }

    /// The one-third octaves whose nominal centre lies in `lowest_hz ..= highest_hz`, ascending.
    pub fn bands(&self) -> impl Iterator<Item = ThirdOctave> {
        let range = self.lowest_hz..=self.highest_hz;
        ThirdOctave::all().filter(move |band| range.contains(&f64::from(band.nominal_hz())))
    }

    /// Lowest and highest frequency in Hz of features and bands together.
    pub(crate) fn span_hz(&self) -> [f64; 2] {
        self.bands()
            .map(ThirdOctave::edges_hz)
            .fold([self.lowest_hz, self.highest_hz], |[low, high], [band_low, band_high]| {
                [low.min(band_low), high.max(band_high)]
            })
    }

    /// Checks that every field is in its allowed range and that there is at least one bin.
    ///
    /// # Errors
    /// [`DefinitionError`] names the first invalid field.
    pub fn check(&self) -> Result<(), DefinitionError> {
        self.check_ranges()?;
        if self.frequencies_hz().is_empty() {
            let Self { lowest_hz, highest_hz, .. } = *self;
            return Err(DefinitionError::NoBins { lowest_hz, highest_hz });
        }
        Ok(())
    }

    /// The definition with all instants in every bin.
    pub(crate) fn unthinned(&self) -> Self {
        Self { thinned: false, ..self.clone() }
    }

    fn check_ranges(&self) -> Result<(), DefinitionError> {
        let rate = self.reference_rate_hz;
        let ranges = [
            // Below 5 the wavelet is no longer analytic to 1e-6; above 50 a voice is a Fourier line.
            ("wavelet_centre_rad", self.wavelet_centre_rad, 5.0, 50.0),
            ("voices_per_octave", f64::from(self.voices_per_octave), 4.0, 256.0),
            ("reference_rate_hz", rate, 1e3, 1e7),
            ("lowest_hz", self.lowest_hz, rate * 1e-6, rate * 0.4),
            ("highest_hz", self.highest_hz, self.lowest_hz, rate * 0.4),
            ("instant_rate_hz", self.instant_rate_hz, self.highest_hz, rate),
            ("margin_s", self.margin_s, 0.0, 10.0_f64.min(INSTANTS_MAX / self.instant_rate_hz)),
            ("floor_m2_s4", self.floor_m2_s4, 1e-300, 1e300),
        ];
        for (name, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(DefinitionError::OutOfRange { name, value, low, high });
            }
        }
        Ok(())
    }

    /// The wavelet.
    pub(crate) fn wavelet(&self) -> Morlet {
        Morlet::new(self.wavelet_centre_rad)
    }

    /// Amplitude of the voice at the frequency of a tone of amplitude one, normalised so that the sum of
    /// all voices is the signal.
    pub(crate) fn height_of_a_tone(&self) -> f64 {
        let wavelet = self.wavelet();
        0.5 * wavelet.share_of_a_voice(self.voices_per_octave)
            * wavelet.fourier(wavelet.centre_rad())
    }

    /// Number of halvings of the instants of a bin at this frequency in Hz.
    pub(crate) fn halvings(&self, frequency_hz: f64) -> u32 {
        let octaves_below = (self.highest_hz / frequency_hz).log2().max(0.0);
        let steps = (octaves_below / OCTAVES_A_HALVING) as u32;
        if self.thinned { steps.saturating_sub(1) } else { 0 }
    }

    /// Frequency in Hz of the grid's point `j`, `mu / (2 pi a_j)` with `a_j = s_0 2^(j / N_v)`
    /// (paper, eq. 3 and A.2).
    pub(crate) fn frequency_hz(&self, j: i32) -> f64 {
        let base_scale = 2.0 / self.reference_rate_hz;
        let scale = base_scale * (f64::from(j) / f64::from(self.voices_per_octave)).exp2();
        self.wavelet().frequency_hz(scale)
    }

    /// Points `j` of the grid with frequencies in `low_hz ..= high_hz`, by ascending frequency.
    pub(crate) fn grid_indices(&self, low_hz: f64, high_hz: f64) -> impl Iterator<Item = i32> {
        let place = |frequency_hz: f64| {
            f64::from(self.voices_per_octave) * (self.frequency_hz(0) / frequency_hz).log2()
        };
        #[expect(clippy::cast_possible_truncation, reason = "checked ranges: at most 1e4 voices")]
        let (first, last) =
            ((place(high_hz) - ROUNDING).ceil() as i32, (place(low_hz) + ROUNDING).floor() as i32);
        (first..=last).rev()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_has_304_bins_from_50_to_4000_hz() {
        let frequencies = FeatureDefinition::default().frequencies_hz();
        assert_eq!(frequencies.len(), 304);
        assert!(frequencies.is_sorted());
        assert!(frequencies[0] >= 50.0 && frequencies[303] <= 4000.0);
    }

    #[test]
    fn a_field_that_is_not_known_is_refused() {
        let text = r#"{"wavelet_center_rad": 6.0}"#;
        let error = serde_json::from_str::<FeatureDefinition>(text).unwrap_err();
        assert!(error.to_string().contains("wavelet_center_rad"), "{error}");
    }

    #[test]
    fn a_wrong_value_is_refused_by_name() {
        let definition = FeatureDefinition { margin_s: f64::NAN, ..Default::default() };
        let message = definition.check().unwrap_err().to_string();
        assert!(message.starts_with("margin_s is NaN"), "{message}");
        let definition =
            FeatureDefinition { lowest_hz: 60.1, highest_hz: 60.2, ..Default::default() };
        assert!(matches!(definition.check(), Err(DefinitionError::NoBins { .. })));
    }
}
