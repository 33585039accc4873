//! Features of a window, a literal implementation of the formulas: reference for the fast one.

use super::{Extractor, FeatureError, Features};
use crate::{Conventions, Cwt, Normalisation, Padding, Signal, squeeze};
use std::ops::Range;

impl Extractor {
    /// The same features by the literal transform of the whole stretch, at every sample of the
    /// window, some hundred times slower.
    ///
    /// [`Extractor::extract`] differs from it in the instants it takes, a choice of the
    /// definition; with an instant a sample the two agree to the wavelet's reach (the quick way
    /// leaves out 4e-6 of a wavelet's weight).
    ///
    /// # Errors
    /// As [`Extractor::extract`].
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
