//! Fast computation of the features of a window: one octave of voices at a time, with immediate
//! reassignment.

use super::{
    DefinitionError, FeatureDefinition,
    plan::{Buffers, Instants, Plan, VOICE_REACH, in_samples},
    reassignment::{Bins, Squeezed},
    stretch::Stretch,
};
use crate::Signal;
use num_complex::Complex64;
use parking_lot::Mutex;
use std::{collections::HashMap, ops::Range, sync::Arc};
use tracktwin_number::rounded;

/// Required ratio of the sample rate to the highest frequency: two by Nyquist, plus a margin for the
/// upper half of the highest band and an anti-aliasing filter.
pub const SAMPLES_A_PERIOD: f64 = 2.5;

/// Relative difference below which two frequencies are the same point of the grid.
const GRID_ROUNDING: f64 = 1e-9;

/// Number of cached plans. A campaign has a few speeds, each with one or two lengths of window.
const PLANS_KEPT: usize = 32;

/// The features of one window.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Natural logarithm of the LWPS in (m/s2)^2, one value per frequency of
    /// [`FeatureDefinition::frequencies_hz`] (paper, eq. 4 and 9).
    ///
    /// A steady tone of amplitude `A` gives `2 ln A` in its bin. A bin below
    /// [`FeatureDefinition::floor_m2_s4`] has the logarithm of this floor.
    pub log_power: Vec<f64>,
    /// Level of each band of [`FeatureDefinition::bands`] in dB re 1 (m/s2)^2: ten times the
    /// decimal logarithm of half the sum of the LWPS over the band's bins.
    ///
    /// The factor one half makes the level of a tone of amplitude `A` equal to that of its mean square
    /// `A^2 / 2`. The level of noise is 10.8 dB below that of its mean square in every band, because
    /// reassignment adds coefficients along ridges, and noise has no ridge longer than a period.
    pub band_levels_db: Vec<f64>,
}

/// Why a window has no features.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// The definition is invalid.
    #[error("feature definition: {0}")]
    Definition(#[from] DefinitionError),
    /// The window is empty or reaches beyond the signal.
    #[error("the window {start}..{end} is empty or not inside the signal's {samples} samples")]
    Window {
        /// First sample of the window.
        start: usize,
        /// Index after the last sample of the window.
        end: usize,
        /// Number of samples of the signal.
        samples: usize,
    },
    /// The sample rate of the signal is too low for the frequencies of the definition.
    #[error(
        "a sample rate of {} Hz is too low; at least {} Hz is needed",
        rounded(*sample_rate_hz, 8),
        rounded(*needed_hz, 4)
    )]
    SampleRate {
        /// Sample rate of the signal in Hz.
        sample_rate_hz: f64,
        /// Lowest rate allowed in Hz.
        needed_hz: f64,
    },
}

/// Computes the features of windows. All threads can share one extractor. The extractor caches its plans
/// by length.
pub struct Extractor {
    definition: FeatureDefinition,
    /// Descending: high voices first.
    voices_hz: Vec<f64>,
    /// Ascending: those of the features, and enough on either side to fill the outer bands.
    bins_hz: Vec<f64>,
    bins: Bins,
    /// The bins that are features.
    kept: Range<usize>,
    /// The bins of each band.
    bands: Vec<Range<usize>>,
    /// Upper end of the features in Hz.
    highest_hz: f64,
    plans: Mutex<HashMap<(u64, Instants, bool), Arc<Plan>>>,
    buffers: Mutex<Vec<Buffers>>,
    accumulators: Mutex<Vec<Squeezed>>,
}

impl Extractor {
    /// Creates an extractor for the features of this definition.
    ///
    /// # Errors
    /// [`FeatureError::Definition`] if [`FeatureDefinition::check`] fails.
    pub fn new(definition: &FeatureDefinition) -> Result<Self, FeatureError> {
        definition.check()?;
        let [low_hz, high_hz] = definition.span_hz();
        let frequencies = |low_hz, high_hz| -> Vec<f64> {
            let points = definition.grid_indices(low_hz, high_hz);
            points.map(|j| definition.frequency_hz(j)).collect()
        };
        let bins_hz = frequencies(low_hz, high_hz);
        let centre = definition.wavelet_centre_rad;
        let mut voices_hz = frequencies(
            low_hz * centre / (centre + VOICE_REACH),
            high_hz * centre / (centre - VOICE_REACH),
        );
        voices_hz.reverse();
        let place = |frequency_hz: f64| bins_hz.partition_point(|&f| f < frequency_hz);
        let kept_hz = definition.frequencies_hz();
        let first = place(kept_hz[0]);
        Ok(Self {
            bins: Bins::new(&bins_hz, definition.voices_per_octave),
            kept: first..first + kept_hz.len(),
            bands: definition.bands().map(|b| b.edges_hz().map(place)).map(|[a, b]| a..b).collect(),
            highest_hz: definition.highest_hz,
            definition: definition.clone(),
            voices_hz,
            bins_hz,
            plans: Mutex::default(),
            buffers: Mutex::default(),
            accumulators: Mutex::default(),
        })
    }

    /// Creates an extractor for those features of this definition that lie at `highest_hz` or below. Lower
    /// sample rates are enough for them.
    ///
    /// # Errors
    /// [`FeatureError::Definition`] if [`FeatureDefinition::check`] fails or no feature is left.
    pub fn up_to(definition: &FeatureDefinition, highest_hz: f64) -> Result<Self, FeatureError> {
        let mut all = Self::new(definition)?;
        let kept_hz = &all.bins_hz[all.kept.clone()];
        let count = kept_hz.partition_point(|&hz| hz <= highest_hz * (1.0 + GRID_ROUNDING));
        if count == 0 {
            let lowest_hz = definition.lowest_hz;
            return Err(DefinitionError::NoBins { lowest_hz, highest_hz }.into());
        }
        all.kept.end = all.kept.start + count;
        all.highest_hz = highest_hz.min(definition.highest_hz);
        Ok(all)
    }

    /// The definition of the features.
    pub const fn definition(&self) -> &FeatureDefinition {
        &self.definition
    }

    /// Number of samples on either side of a window on which its features depend, for a signal with this
    /// sample rate in Hz.
    pub fn margin_samples(&self, sample_rate_hz: f64) -> usize {
        in_samples(self.definition.margin_s, sample_rate_hz)
    }

    /// Frequencies of the voices in Hz, descending.
    pub(super) fn voices_hz(&self) -> &[f64] {
        &self.voices_hz
    }

    /// Frequencies of all bins in Hz, ascending.
    pub(super) fn bins_hz(&self) -> &[f64] {
        &self.bins_hz
    }

    /// The bins that are features.
    pub(super) fn kept(&self) -> Range<usize> {
        self.kept.clone()
    }

    /// How many voices lie above a frequency of the grid in Hz.
    pub(super) fn voices_above(&self, frequency_hz: f64) -> usize {
        self.voices_hz.partition_point(|&f| f > frequency_hz * (1.0 + GRID_ROUNDING))
    }

    /// The features of a window of samples.
    ///
    /// The transform uses a margin of at most [`FeatureDefinition::margin_s`] on either side of the window.
    /// Samples farther away have no influence, so a whole pass and a part of it give the same features. The
    /// function subtracts the mean of the samples used and tapers the signal to zero over the last quarter of
    /// each margin. If the signal ends earlier, the margin is shorter.
    ///
    /// # Errors
    /// [`FeatureError::Window`] if the window is empty or reaches beyond the signal;
    /// [`FeatureError::SampleRate`] if the sample rate is too low.
    pub fn extract(&self, signal: &Signal, window: Range<usize>) -> Result<Features, FeatureError> {
        self.squeeze(signal, window, &self.definition, |squeezed| {
            let lwps: Vec<_> =
                (0..self.bins_hz.len()).map(|bin| squeezed.mean_power(bin)).collect();
            self.features(&lwps)
        })
    }

    /// The features of the LWPS in (m/s2)^2, one value a bin.
    pub(super) fn features(&self, lwps: &[f64]) -> Features {
        let floor = self.definition.floor_m2_s4;
        let log_power = lwps[self.kept.clone()].iter().map(|power| power.max(floor).ln());
        let level = |band: &Range<usize>| {
            let power = 0.5 * lwps[band.clone()].iter().sum::<f64>();
            10.0 * power.max(floor).log10()
        };
        Features {
            log_power: log_power.collect(),
            band_levels_db: self.bands.iter().map(level).collect(),
        }
    }

    /// Computes the synchrosqueezed transform of a window and passes it to `read`; `definition`
    /// states whether instants are thinned out.
    pub(super) fn squeeze<R>(
        &self,
        signal: &Signal,
        window: Range<usize>,
        definition: &FeatureDefinition,
        read: impl FnOnce(&Squeezed) -> R,
    ) -> Result<R, FeatureError> {
        let instants = self.instants(signal, &window)?;
        let mut squeezed = self.accumulators.lock().pop().unwrap_or_default();
        let halvings = self.bins_hz.iter().map(|&hz| definition.halvings(hz));
        squeezed.clear(halvings, instants.count);
        self.voices(signal, window, definition, |halvings, voice, weighted| {
            squeezed.add(&self.bins, halvings, voice, weighted);
        })?;
        let result = read(&squeezed);
        self.accumulators.lock().push(squeezed);
        Ok(result)
    }

    /// Computes every voice of a window, from the highest frequency to the lowest, and hands it to
    /// `take` as [`Plan::run`] does.
    pub(super) fn voices(
        &self,
        signal: &Signal,
        window: Range<usize>,
        definition: &FeatureDefinition,
        take: impl FnMut(u32, &[Complex64], &[Complex64]),
    ) -> Result<(), FeatureError> {
        let stretch = self.stretch(signal, &window)?;
        let instants = self.instants(signal, &window)?;
        let plan = self.plan(signal.sample_rate_hz(), instants.planned(), definition);
        let mut buffers = self.buffers.lock().pop().unwrap_or_default();
        plan.run(&stretch, &mut buffers, take);
        self.buffers.lock().push(buffers);
        Ok(())
    }

    /// The stretch around a window.
    pub(super) fn stretch(
        &self,
        signal: &Signal,
        window: &Range<usize>,
    ) -> Result<Stretch, FeatureError> {
        self.check(signal, window)?;
        let margin = self.margin_samples(signal.sample_rate_hz());
        Ok(Stretch::new(signal, window, margin))
    }

    /// The instants of a window.
    pub(super) fn instants(
        &self,
        signal: &Signal,
        window: &Range<usize>,
    ) -> Result<Instants, FeatureError> {
        self.check(signal, window)?;
        let rate_hz = self.definition.instant_rate_hz;
        Ok(Instants::new(window.len(), signal.sample_rate_hz(), rate_hz))
    }

    fn check(&self, signal: &Signal, window: &Range<usize>) -> Result<(), FeatureError> {
        let Range { start, end } = *window;
        if start >= end || end > signal.len() {
            return Err(FeatureError::Window { start, end, samples: signal.len() });
        }
        self.check_rate(signal.sample_rate_hz())
    }

    /// Checks that a sample rate in Hz is high enough for the highest feature.
    ///
    /// # Errors
    /// [`FeatureError::SampleRate`] if the rate is too low.
    pub fn check_rate(&self, sample_rate_hz: f64) -> Result<(), FeatureError> {
        let needed_hz = SAMPLES_A_PERIOD * self.highest_hz;
        if sample_rate_hz < needed_hz {
            return Err(FeatureError::SampleRate { sample_rate_hz, needed_hz });
        }
        Ok(())
    }

    fn plan(
        &self,
        sample_rate_hz: f64,
        instants: Instants,
        definition: &FeatureDefinition,
    ) -> Arc<Plan> {
        let key = (sample_rate_hz.to_bits(), instants, definition.thinned);
        if let Some(plan) = self.plans.lock().get(&key) {
            return Arc::clone(plan);
        }
        // Made outside the lock: two threads may make the same plan, none waits for it.
        let plan = Plan::new(definition, &self.voices_hz, sample_rate_hz, instants);
        let plan = Arc::new(plan);
        let mut plans = self.plans.lock();
        if plans.len() >= PLANS_KEPT {
            plans.clear();
        }
        plans.insert(key, Arc::clone(&plan));
        plan
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ThirdOctave;

    fn extractor() -> Extractor {
        Extractor::new(&FeatureDefinition::default()).unwrap()
    }

    #[test]
    fn features_up_to_a_frequency_are_the_first_of_all() {
        let whole = extractor();
        let low = Extractor::up_to(&FeatureDefinition::default(), 900.0).unwrap();
        let noise = |index: u32| f64::from(index.wrapping_mul(2_654_435_761) >> 8) / 1e7 - 0.8;
        let signal = Signal::new(2e4, (0..12_000).map(noise).collect()).unwrap();
        let [all, some] =
            [&whole, &low].map(|it| it.extract(&signal, 5000..6500).unwrap().log_power);
        assert!(some.len() > 100 && some.len() < all.len());
        assert_eq!(some, all[..some.len()]);
        let map = low.sswt_map(&signal, 5000..6500, 10).unwrap();
        assert_eq!(map.magnitudes.len(), 10 * map.frequencies_hz.len());
        assert_eq!(map.frequencies_hz.len(), some.len());
        assert!(low.check_rate(2250.0).is_ok() && low.check_rate(2249.0).is_err());
        assert!(whole.check_rate(9999.0).is_err());
        assert!(Extractor::up_to(&FeatureDefinition::default(), 40.0).is_err());
    }

    #[test]
    fn a_window_that_is_not_in_the_signal_is_refused() {
        let signal = Signal::new(1e5, vec![0.0; 100]).unwrap();
        let reversed = Range { start: 7, end: 3 };
        for window in [0..101, 50..50, reversed, 0..usize::MAX] {
            let error = extractor().extract(&signal, window.clone()).unwrap_err();
            let Range { start, end } = window;
            assert_eq!(error, FeatureError::Window { start, end, samples: 100 });
        }
    }

    #[test]
    fn a_sample_rate_below_the_definition_is_refused() {
        let signal = Signal::new(9_999.0, vec![0.0; 100]).unwrap();
        let error = extractor().extract(&signal, 0..100).unwrap_err();
        assert_eq!(
            error,
            FeatureError::SampleRate { sample_rate_hz: 9_999.0, needed_hz: 10_000.0 }
        );
    }

    #[test]
    fn silence_has_the_floor_in_every_bin_and_band() {
        let signal = Signal::new(1e5, vec![9.81; 20_000]).unwrap();
        let features = extractor().extract(&signal, 8000..12_000).unwrap();
        assert_eq!(features.log_power, vec![1e-10_f64.ln(); 304]);
        assert_eq!(features.band_levels_db, vec![-100.0; ThirdOctave::COUNT]);
    }

    #[test]
    fn one_extractor_serves_threads_with_the_same_bits() {
        let samples = (0..12_000).map(|n| (f64::from(n) * 0.05).sin() + f64::from(n % 17));
        let signal = Signal::new(1e5, samples.collect()).unwrap();
        let extractor = extractor();
        let alone = extractor.extract(&signal, 4000..8000).unwrap();
        let together: Vec<_> = std::thread::scope(|scope| {
            let extract = || extractor.extract(&signal, 4000..8000).unwrap();
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(extract)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(together.iter().all(|features| *features == alone));
    }
}
