//! Features of sleepers: the features of a window, averaged over the passes of one speed.

use crate::check::check_sample_rate;
use crate::speeds::PassSpeed;
use crate::{Error, Flag, ModelSpeeds};
use rayon::prelude::*;
use std::ops::Range;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureError, Signal};

/// A window counts as complete from this share on: odometers drift by a few millimetres.
const COMPLETE_SHARE: f64 = 0.98;
/// A margin counts as short below this share. The signal fades out in the last quarter of a margin. Three
/// quarters of a margin therefore lose only the outermost part of wavelets below 70 Hz.
const MARGIN_SHARE: f64 = 0.75;

/// Features of a sleeper from all passes.
#[derive(Clone, Debug, PartialEq)]
pub struct SleeperFeatures {
    /// Index of the sleeper in [`Recording::sleepers`].
    pub sleeper: usize,
    /// Speeds with at least one pass over the sleeper, ascending.
    pub speeds: Vec<SpeedFeatures>,
    /// Flags, ascending, each once.
    pub flags: Vec<Flag>,
}

/// Features of a sleeper at one speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedFeatures {
    /// Index of the speed among the speeds of the models.
    pub speed: usize,
    /// Number of averaged passes.
    pub passes: usize,
    /// Mean over the passes of the natural logarithm of the LWPS, one value per bin. Passes between two
    /// speeds of the models are moved to this speed.
    pub log_power: Vec<f64>,
}

/// Computes the features of every sleeper of the recording; a sleeper that no pass covers has no speeds.
///
/// # Errors
/// [`Error::Rate`] if the sample rate is too low; [`Error::UnknownSpeed`] if models for these speeds cannot
/// evaluate a pass; [`Error::Features`] if the features of a window cannot be computed.
pub fn features(
    recording: &Recording,
    extractor: &Extractor,
    speeds: &ModelSpeeds,
) -> Result<Vec<SleeperFeatures>, Error> {
    check_sample_rate(extractor, recording.sample_rate_hz)?;
    let speed_of_pass = recording
        .passes
        .iter()
        .map(|pass| speeds.of_pass_of(recording, pass))
        .collect::<Result<Vec<_>, _>>()?;
    (0..recording.sleepers.len())
        .into_par_iter()
        .map(|sleeper| sleeper_features(recording, extractor, &speed_of_pass, sleeper))
        .collect()
}

fn sleeper_features(
    recording: &Recording,
    extractor: &Extractor,
    speed_of_pass: &[PassSpeed],
    sleeper: usize,
) -> Result<SleeperFeatures, Error> {
    let mut features = SleeperFeatures::none(sleeper);
    let window = recording.sleeper_window(sleeper);
    for (pass, speed) in recording.passes.iter().zip(speed_of_pass) {
        let Some(samples) = window.samples(&pass.position_m) else { continue };
        let share = window.share(&pass.position_m);
        let taken = features.take(extractor, share, samples, &pass.signal, speed);
        taken.map_err(|source| Error::Features {
            file: pass.file.clone(),
            sleeper: recording.sleepers[sleeper].id.clone(),
            source,
        })?;
    }
    Ok(features)
}

impl SleeperFeatures {
    /// Features of a sleeper without passes.
    pub(crate) const fn none(sleeper: usize) -> Self {
        Self { sleeper, speeds: Vec::new(), flags: Vec::new() }
    }

    /// Adds the window of a pass. `share` is the covered share of the window, and `samples` its range in
    /// the signal.
    ///
    /// # Errors
    /// [`FeatureError`] if the features cannot be computed.
    pub(crate) fn take(
        &mut self,
        extractor: &Extractor,
        share: f64,
        samples: Range<usize>,
        signal: &Signal,
        PassSpeed { speed, bins, shift }: &PassSpeed,
    ) -> Result<(), FeatureError> {
        let margin_s = MARGIN_SHARE * extractor.definition().margin_s;
        let margin = (margin_s * signal.sample_rate_hz()) as usize;
        if share < COMPLETE_SHARE {
            self.flags.push(Flag::IncompleteWindow);
        }
        if samples.start < margin || samples.end + margin > signal.len() {
            self.flags.push(Flag::ShortMargin);
        }
        self.flags.sort_unstable();
        self.flags.dedup();
        let mut log_power = extractor.extract(signal, samples)?.log_power;
        log_power.truncate(bins.unwrap_or(log_power.len()));
        log_power.iter_mut().zip(shift).for_each(|(value, shift)| *value += shift);
        match self.speeds.iter_mut().find(|known| known.speed == *speed) {
            Some(known) => known.add(&log_power),
            None => self.speeds.push(SpeedFeatures { speed: *speed, passes: 1, log_power }),
        }
        self.speeds.sort_by_key(|known| known.speed);
        Ok(())
    }
}

impl SpeedFeatures {
    /// Adds one more pass to the mean.
    fn add(&mut self, log_power: &[f64]) {
        self.passes += 1;
        let share = 1.0 / self.passes as f64;
        for (mean, value) in self.log_power.iter_mut().zip(log_power) {
            *mean += share * (value - *mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn passes_of_one_speed_are_averaged_in_the_logarithm() {
        let recording = testing::recording(3.0, &[10.0, 10.1, 13.0]);
        let extractor = testing::extractor();
        let all =
            features(&recording, &extractor, &ModelSpeeds::only(&testing::SPEEDS_KM_H)).unwrap();
        let alone = |pass: usize| {
            let mut single = recording.clone();
            single.passes = vec![recording.passes[pass].clone()];
            features(&single, &extractor, &ModelSpeeds::only(&testing::SPEEDS_KM_H)).unwrap()[3]
                .speeds[0]
                .clone()
        };
        let (first, second) = (alone(0), alone(1));
        let mean = &all[3].speeds[0];
        assert_eq!((mean.speed, mean.passes, all[3].speeds.len()), (0, 2, 2));
        for ((mean, a), b) in mean.log_power.iter().zip(&first.log_power).zip(&second.log_power) {
            assert!((mean - 0.5 * (a + b)).abs() < 1e-12);
        }
        assert_ne!(first.log_power, second.log_power);
    }

    #[test]
    fn a_speed_without_a_model_is_named_with_those_known() {
        let recording = testing::recording(3.0, &[11.0]);
        let result =
            features(&recording, &testing::extractor(), &ModelSpeeds::only(&testing::SPEEDS_KM_H));
        let message = result.unwrap_err().to_string();
        assert!(message.contains("11 km/h") && message.contains("10, 13 km/h"), "{message}");
    }

    #[test]
    fn sleepers_near_the_ends_are_flagged_and_those_inside_are_not() {
        let recording = testing::recording(3.0, &[10.0]);
        let all =
            features(&recording, &testing::extractor(), &ModelSpeeds::only(&testing::SPEEDS_KM_H))
                .unwrap();
        assert_eq!(all[0].flags, [Flag::IncompleteWindow, Flag::ShortMargin]);
        assert_eq!(all[3].flags, []);
    }

    #[test]
    fn the_sleepers_of_an_independent_recording_are_clean_but_for_the_outer_ones() {
        let folder = test_needs::reference().join("recordings/dev-01");
        let recording = Recording::open(folder).unwrap();
        let extractor = Extractor::new(&tracktwin_signal::FeatureDefinition::default()).unwrap();
        let all = features(&recording, &extractor, &ModelSpeeds::only(&[7.0, 10.0, 13.0])).unwrap();
        let of = |id: &str| {
            let place = recording.sleepers.iter().position(|sleeper| sleeper.id == id).unwrap();
            &all[place]
        };
        for number in 8..=31 {
            let sleeper = of(&format!("SN{number}"));
            let passes: Vec<_> = sleeper.speeds.iter().map(|known| known.passes).collect();
            assert_eq!((&passes[..], &sleeper.flags[..]), (&[2, 2, 2][..], &[][..]), "SN{number}");
        }
        for id in ["SN5", "SN33"] {
            assert_eq!(of(id).flags, [Flag::IncompleteWindow, Flag::ShortMargin], "{id}");
        }
    }
}
