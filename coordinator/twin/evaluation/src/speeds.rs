//! Speeds of the models, and passes at speeds between them.
//!
//! The ln-powers of a track change smoothly with the speed: the irregularity is passed at another frequency,
//! and the structure stays. So the ln-powers of a pass between two speeds of the models are moved by the
//! difference between the library's means at the nearest of them and at the speed of the pass.
//! `docs/decisions/0041-speeds-between-those-of-a-library.md` has the errors.

use crate::Error;
use tracktwin_number::rounded;
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_surrogate::TrainingSet;

/// Relative difference between the speeds of a pass and of a model below which the speeds count as equal.
///
/// A drive holds its speed within about 2 %. This difference moves the features of a track by a third of a
/// bin at most, because the positions do not change.
pub(crate) const SPEED_TOLERANCE: f64 = 0.02;

/// Largest relative difference between the speed of a pass and the nearest speed of the models, for passes
/// between two speeds of the models.
pub(crate) const BETWEEN_MAX: f64 = 0.18;

/// Speeds of the models in km/h, ascending, and the library's mean ln-powers at each.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelSpeeds {
    known_km_h: Vec<f64>,
    /// Number of bins that the models use, from the lowest; all bins if `None`.
    bins: Option<usize>,
    /// Mean ln-power of each bin, by speed. Empty if only passes at exactly these speeds are accepted.
    mean_log_power: Vec<Vec<f64>>,
}

/// The speed of the models for a pass, and what its ln-powers are moved by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PassSpeed {
    /// Index of the speed among the speeds of the models.
    pub(crate) speed: usize,
    /// Number of bins that the models use, from the lowest; all bins if `None`.
    pub(crate) bins: Option<usize>,
    /// Added to the ln-power of each bin; empty for a pass at a speed of the models.
    pub(crate) shift: Vec<f64>,
}

impl ModelSpeeds {
    /// Speeds in km/h, ascending, without a library: passes between them are refused.
    pub fn only(known_km_h: &[f64]) -> Self {
        Self { known_km_h: known_km_h.to_vec(), bins: None, mean_log_power: Vec::new() }
    }

    /// The speeds of a library.
    pub fn of(library: &TrainingSet) -> Self {
        let bins = library.frequencies_hz.len();
        let mean = |table: &Vec<f64>| {
            let mut mean = vec![0.0; bins];
            let share = 1.0 / library.entries() as f64;
            for entry in table.chunks_exact(bins) {
                mean.iter_mut().zip(entry).for_each(|(sum, value)| *sum += share * value);
            }
            mean
        };
        let mean_log_power = library.log_power.iter().map(mean).collect();
        Self { known_km_h: library.speeds_km_h.clone(), bins: Some(bins), mean_log_power }
    }

    /// The speed of the models for a pass at `speed_km_h`, if there is one.
    pub(crate) fn of_pass(&self, speed_km_h: f64) -> Option<PassSpeed> {
        let known = &self.known_km_h;
        if let Some(speed) = equal(speed_km_h, known) {
            return Some(PassSpeed { speed, bins: self.bins, shift: Vec::new() });
        }
        let speed = between(speed_km_h, known).filter(|_| !self.mean_log_power.is_empty())?;
        let above = known.partition_point(|speed| *speed < speed_km_h);
        let [low, high] = [above - 1, above];
        let share = (speed_km_h / known[low]).ln() / (known[high] / known[low]).ln();
        let [at_low, at_high] = [&self.mean_log_power[low], &self.mean_log_power[high]];
        let there = at_low.iter().zip(at_high).map(|(low, high)| low + share * (high - low));
        let nearest = &self.mean_log_power[speed];
        let shift = nearest.iter().zip(there).map(|(nearest, there)| nearest - there).collect();
        Some(PassSpeed { speed, bins: self.bins, shift })
    }

    /// Speed in km/h at which a pass is evaluated: the stated one, or that of its positions if these differ and models
    /// can evaluate it.
    fn speed_of(&self, pass: &Pass) -> f64 {
        let by_positions = 3.6 * pass.mean_speed_m_s();
        let differs = is_misstated(pass) && self.of_pass(by_positions).is_some();
        if differs { by_positions } else { pass.speed_km_h }
    }

    /// Sentences on passes at speeds between those of the models and on passes with another speed than stated.
    pub(crate) fn notes(&self, recording: &Recording) -> Vec<String> {
        let misstated = recording.passes.iter().filter(|pass| is_misstated(pass)).map(|pass| {
            format!(
                "{}: recording.json states {} km/h, but the positions give {:.1} km/h; the pass is evaluated as one \
                 at {:.1} km/h. Correct `speed_km_h` or the positions.",
                pass.file,
                rounded(pass.speed_km_h, 4),
                3.6 * pass.mean_speed_m_s(),
                self.speed_of(pass)
            )
        });
        misstated.chain(self.note(recording)).collect()
    }

    /// Sentence on the passes of a recording at speeds between those of the models, if there are any.
    fn note(&self, recording: &Recording) -> Option<String> {
        let mut moved: Vec<[f64; 2]> = Vec::new();
        for pass in &recording.passes {
            let speed_km_h = self.speed_of(pass);
            let found = self.of_pass(speed_km_h).filter(|found| !found.shift.is_empty());
            let pair = found.map(|found| [speed_km_h, self.known_km_h[found.speed]]);
            moved.extend(pair.filter(|pair| !moved.contains(pair)));
        }
        let pair = |[own, models]: &[f64; 2]| {
            format!("{} km/h with those for {} km/h", rounded(*own, 4), rounded(*models, 4))
        };
        let pairs: Vec<String> = moved.iter().map(pair).collect();
        (!pairs.is_empty()).then(|| {
            format!(
                "No models are for the speeds of all passes: evaluated were passes at {}, after the \
                 library's mean change of level between the speeds.",
                pairs.join(", ")
            )
        })
    }

    /// The speed of the models for a pass of a recording.
    ///
    /// # Errors
    /// [`Error::UnknownSpeed`].
    pub(crate) fn of_pass_of(
        &self,
        recording: &Recording,
        pass: &Pass,
    ) -> Result<PassSpeed, Error> {
        let unknown = || unknown(recording, pass.speed_km_h, &self.known_km_h);
        self.of_pass(self.speed_of(pass)).ok_or_else(unknown)
    }
}

/// Whether the positions of a pass give another speed than stated.
fn is_misstated(pass: &Pass) -> bool {
    (3.6 * pass.mean_speed_m_s() / pass.speed_km_h - 1.0).abs() > SPEED_TOLERANCE
}

/// Checks that models for the `known` speeds in km/h, ascending, can evaluate a pass of the recording.
///
/// # Errors
/// [`Error::UnknownSpeed`].
pub(crate) fn check(recording: &Recording, speed_km_h: f64, known: &[f64]) -> Result<(), Error> {
    let found = equal(speed_km_h, known).or_else(|| between(speed_km_h, known));
    found.map(drop).ok_or_else(|| unknown(recording, speed_km_h, known))
}

fn unknown(recording: &Recording, speed_km_h: f64, known: &[f64]) -> Error {
    Error::UnknownSpeed { recording: recording.name.clone(), speed_km_h, known: known.to_vec() }
}

/// Index of the known speed that equals this one within the tolerance, if any; the nearest if there are several.
fn equal(speed_km_h: f64, known: &[f64]) -> Option<usize> {
    nearest(speed_km_h, known, SPEED_TOLERANCE)
}

/// Index of the known speed nearest to this one, if this one lies between two known speeds and near enough.
fn between(speed_km_h: f64, known: &[f64]) -> Option<usize> {
    let [Some(lowest), Some(highest)] = [known.first(), known.last()] else { return None };
    if !(*lowest..=*highest).contains(&speed_km_h) {
        return None;
    }
    nearest(speed_km_h, known, BETWEEN_MAX)
}

/// Index of the known speed nearest to this one, if their relative difference is at most `most`.
fn nearest(speed_km_h: f64, known: &[f64], most: f64) -> Option<usize> {
    let away = |index: &usize| (speed_km_h / known[*index] - 1.0).abs();
    let nearest = (0..known.len()).min_by(|a, b| away(a).total_cmp(&away(b)))?;
    (away(&nearest) <= most).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_pass_between_two_speeds_is_moved_to_the_nearer_one() {
        let mut library = testing::library();
        library.speeds_km_h = vec![10.0, 12.0];
        let speeds = ModelSpeeds::of(&library);
        let exact = PassSpeed { speed: 0, bins: speeds.bins, shift: Vec::new() };
        assert_eq!(speeds.of_pass(10.1), Some(exact));
        let change = |bin: usize| speeds.mean_log_power[1][bin] - speeds.mean_log_power[0][bin];
        for (speed_km_h, nearest) in [(10.7, 0), (11.4, 1)] {
            let PassSpeed { speed, shift, .. } = speeds.of_pass(speed_km_h).unwrap();
            assert_eq!(speed, nearest);
            let share = (speed_km_h / 10.0_f64).ln() / 1.2_f64.ln();
            for (bin, shift) in shift.iter().enumerate() {
                let expected = (nearest as f64 - share) * change(bin);
                assert!((shift - expected).abs() < 1e-12, "{shift} {expected}");
            }
        }
    }

    #[test]
    fn of_two_speeds_within_the_tolerance_the_nearer_one_counts() {
        let speeds = ModelSpeeds::only(&[80.0, 81.0, 82.0]);
        for (speed_km_h, speed) in [(80.4, 0), (81.0, 1), (81.4, 1), (82.0, 2)] {
            assert_eq!(speeds.of_pass(speed_km_h).map(|found| found.speed), Some(speed));
        }
    }

    #[test]
    fn a_pass_with_another_speed_than_stated_is_evaluated_at_its_own() {
        let mut library = testing::library();
        library.speeds_km_h = vec![10.0, 13.0];
        let speeds = ModelSpeeds::of(&library);
        let mut recording = testing::recording(3.0, &[13.0]);
        assert_eq!(speeds.notes(&recording), [""; 0]);
        for place in &mut recording.passes[0].position_m {
            *place *= 0.8;
        }
        let taken = speeds.of_pass_of(&recording, &recording.passes[0]).unwrap();
        assert_eq!(taken, speeds.of_pass(10.4).unwrap());
        let notes = speeds.notes(&recording);
        assert!(notes[0].contains("states 13 km/h, but the positions give 10.4 km/h"), "{notes:?}");
        // No model is for 20 km/h: the stated speed counts, with the note.
        for place in &mut recording.passes[0].position_m {
            *place *= 2.0;
        }
        let taken = speeds.of_pass_of(&recording, &recording.passes[0]).unwrap();
        assert_eq!(taken, speeds.of_pass(13.0).unwrap());
        assert!(speeds.notes(&recording)[0].contains("evaluated as one at 13.0 km/h"));
    }

    #[test]
    fn a_pass_beyond_the_speeds_or_far_from_each_is_refused() {
        let mut library = testing::library();
        library.speeds_km_h = vec![10.0, 16.0];
        let speeds = ModelSpeeds::of(&library);
        for speed_km_h in [9.0, 12.5, 17.0] {
            assert_eq!(speeds.of_pass(speed_km_h), None, "{speed_km_h}");
        }
        assert!(speeds.of_pass(11.0).is_some() && speeds.of_pass(14.0).is_some());
        assert_eq!(ModelSpeeds::only(&[10.0, 13.0]).of_pass(11.0), None);
    }
}
