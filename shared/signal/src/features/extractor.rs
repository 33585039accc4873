//! Features of a window, by the quick way: an octave of voices at a time, reassigned as they come.

use super::{
    DefinitionError, FeatureDefinition,
    plan::{Buffers, Instants, Plan, in_samples},
    reassignment::{Bins, Squeezed},
    stretch::Stretch,
};
use crate::Signal;
use std::{
    collections::HashMap,
    ops::Range,
    sync::{Arc, Mutex, PoisonError},
};

/// Voices that matter to a bin lie within this many standard deviations of the wavelet; farther
/// ones hold less than 0.2 % of a tone.
const VOICE_REACH: f64 = 3.0;

/// Sample rate that the highest frequency needs, in units of it: two by Nyquist, and room for the
/// upper half of the highest band and an anti-aliasing filter.
const SAMPLES_A_PERIOD: f64 = 2.5;

/// Plans kept. A campaign has a handful of speeds, each with one or two lengths of window.
const PLANS_KEPT: usize = 32;

/// The features of one window.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Natural logarithm of the LWPS in (m/s2)^2, one value a frequency of
    /// [`FeatureDefinition::frequencies_hz`] (paper, eq. 4 and 9).
    ///
    /// A steady tone of amplitude `A` gives `2 ln A` in its bin. A bin below
    /// [`FeatureDefinition::floor_m2_s4`] has the floor's logarithm.
    pub log_power: Vec<f64>,
    /// Level of each band of [`FeatureDefinition::bands`] in dB re 1 (m/s2)^2: ten times the
    /// decimal logarithm of half the sum of the LWPS over the band's bins.
    ///
    /// Half, because a tone of amplitude `A` has the mean square `A^2 / 2`: its level is then
    /// that of its mean square. Of noise the LWPS holds less than its mean square: voices that
    /// meet in a bin partly cancel.
    pub band_levels_db: Vec<f64>,
}

/// Why a window has no features.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// The definition cannot be transformed.
    #[error("feature definition: {0}")]
    Definition(#[from] DefinitionError),
    /// The window is empty or reaches beyond the signal.
    #[error("the window {start}..{end} is empty or not inside the signal's {samples} samples")]
    Window {
        /// First sample of the window.
        start: usize,
        /// The sample behind its last.
        end: usize,
        /// Samples of the signal.
        samples: usize,
    },
    /// The signal does not hold the definition's frequencies.
    #[error("a sample rate of {sample_rate_hz} Hz is too low; at least {needed_hz} Hz is needed")]
    SampleRate {
        /// Sample rate of the signal in Hz.
        sample_rate_hz: f64,
        /// Lowest rate allowed in Hz.
        needed_hz: f64,
    },
}

/// Takes the features of windows. One serves all threads; plans are kept by length inside.
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
    plans: Mutex<HashMap<(u64, Instants), Arc<Plan>>>,
    workspaces: Mutex<Vec<Workspace>>,
}

/// What a thread needs while it extracts.
#[derive(Default)]
struct Workspace {
    buffers: Buffers,
    squeezed: Squeezed,
}

impl Extractor {
    /// An extractor of these features.
    ///
    /// # Errors
    /// [`FeatureError::Definition`] when [`FeatureDefinition::check`] refuses it.
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
            definition: definition.clone(),
            voices_hz,
            bins_hz,
            plans: Mutex::default(),
            workspaces: Mutex::default(),
        })
    }

    /// The definition of the features.
    pub const fn definition(&self) -> &FeatureDefinition {
        &self.definition
    }

    /// Frequencies of the voices in Hz, descending.
    pub(super) fn voices_hz(&self) -> &[f64] {
        &self.voices_hz
    }

    /// Frequencies of all bins in Hz, ascending.
    pub(super) fn bins_hz(&self) -> &[f64] {
        &self.bins_hz
    }

    /// The features of a window of samples.
    ///
    /// Of the signal on either side, at most [`FeatureDefinition::margin_s`] is used; what lies
    /// farther away does not matter, so a whole pass or a stretch of it give the same features.
    /// The mean of what is used is taken out, and it fades to zero over the last quarter of each
    /// margin. Where the signal ends earlier, the margin is what there is of it.
    ///
    /// # Errors
    /// [`FeatureError::Window`] and [`FeatureError::SampleRate`].
    pub fn extract(&self, signal: &Signal, window: Range<usize>) -> Result<Features, FeatureError> {
        self.squeeze(signal, window, |squeezed| {
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

    /// Computes the synchrosqueezed transform of a window and hands it to `read`.
    fn squeeze<R>(
        &self,
        signal: &Signal,
        window: Range<usize>,
        read: impl FnOnce(&Squeezed) -> R,
    ) -> Result<R, FeatureError> {
        let stretch = self.stretch(signal, &window)?;
        let rate = signal.sample_rate_hz();
        let instants = Instants::new(window.len(), rate, self.definition.instant_rate_hz);
        let plan = self.plan(rate, instants.planned());

        let mut workspace = lock(&self.workspaces).pop().unwrap_or_default();
        let Workspace { buffers, squeezed } = &mut workspace;
        squeezed.clear(self.bins.rows(), instants.count);
        plan.run(&stretch, buffers, |voice, weighted| squeezed.add(&self.bins, voice, weighted));
        let result = read(squeezed);
        lock(&self.workspaces).push(workspace);
        Ok(result)
    }

    /// The stretch around a window that is inside the signal.
    pub(super) fn stretch(
        &self,
        signal: &Signal,
        window: &Range<usize>,
    ) -> Result<Stretch, FeatureError> {
        let Range { start, end } = *window;
        if start >= end || end > signal.len() {
            return Err(FeatureError::Window { start, end, samples: signal.len() });
        }
        let sample_rate_hz = signal.sample_rate_hz();
        let needed_hz = SAMPLES_A_PERIOD * self.definition.highest_hz;
        if sample_rate_hz < needed_hz {
            return Err(FeatureError::SampleRate { sample_rate_hz, needed_hz });
        }
        Ok(Stretch::new(signal, window, in_samples(self.definition.margin_s, sample_rate_hz)))
    }

    fn plan(&self, sample_rate_hz: f64, instants: Instants) -> Arc<Plan> {
        let key = (sample_rate_hz.to_bits(), instants);
        if let Some(plan) = lock(&self.plans).get(&key) {
            return Arc::clone(plan);
        }
        // Made outside the lock: two threads may make the same plan, none waits for it.
        let plan = Plan::new(&self.definition, &self.voices_hz, sample_rate_hz, instants);
        let plan = Arc::new(plan);
        let mut plans = lock(&self.plans);
        if plans.len() >= PLANS_KEPT {
            plans.clear();
        }
        plans.insert(key, Arc::clone(&plan));
        plan
    }
}

/// Buffers and plans stay good when a thread panics: nothing is half-written that is read later.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
