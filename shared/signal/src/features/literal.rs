//! Features of a window by a literal implementation of the formulas: the reference for the fast
//! implementation.

use super::{Extractor, FeatureError, Features};
use crate::{Conventions, Cwt, Normalisation, Padding, Signal, squeeze};
use std::ops::Range;

impl Extractor {
    /// Computes the features by the literal transform of the whole stretch, at every sample of the
    /// window. This is about a hundred times slower than [`Extractor::extract`].
    ///
    /// [`Extractor::extract`] uses only the instants of the definition. With one instant per sample both
    /// functions agree up to the truncation of the wavelet: the fast implementation omits 4e-6 of the
    /// weight of a wavelet.
    ///
    /// # Errors
    /// The errors of [`Extractor::extract`].
    pub fn extract_literally(
        &self,
        signal: &Signal,
        window: Range<usize>,
    ) -> Result<Features, FeatureError> {
        let stretch = self.stretch(signal, &window)?;
        let (definition, wavelet) = (self.definition(), self.definition().wavelet());
        let scales_s: Vec<_> = self.voices_hz().iter().map(|&f| wavelet.scale(f)).collect();
        // Twice the length, so that the lowest voices do not meet the other end of the stretch.
        let padding = Padding::Zeros((2 * stretch.samples.len()).next_power_of_two());
        let rate = signal.sample_rate_hz();
        let cwt = Cwt::new(&stretch.samples, rate, padding, wavelet, &scales_s);
        let conventions = Conventions { normalisation: Normalisation::SignalBack, threshold: 0.0 };
        let squeezed = squeeze(&cwt, wavelet, definition.voices_per_octave, conventions);

        // Voices descend and reach beyond the bins on both sides; bins ascend.
        let power = squeezed.mean_power(stretch.window);
        let highest_hz = self.bins_hz().last().copied().unwrap_or_default();
        let above = self.voices_above(highest_hz);
        let mut lwps = power[above..above + self.bins_hz().len()].to_vec();
        lwps.reverse();
        Ok(self.features(&lwps))
    }
}
