//! Sensitivities of the sensors of several axles, which ride over the same track at the same time.

use super::gain::{LevelDifference, Levels, USUAL_DB};
use crate::along::{by_speed, median};
use std::collections::BTreeMap;
use tracktwin_number::significant;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording};

/// Largest probability of a difference by chance at which it is corrected.
const ALPHA: f64 = 0.01;

/// The recording with passes as if the sensors of all axles had one sensitivity, and a note in its
/// `doubts` for each axle that differs.
///
/// Every axle rolls over the same rail, so a level difference between axles that is the same in every band and at
/// most speeds is a sensitivity. It is measured relative to the first axle, as the median over the speeds. Because
/// nothing tells which sensor is right, passes are scaled to the mean of all axles in dB. A difference that depends on
/// the band has another cause, such as the unsprung mass, and is stated only.
pub fn with_equal_axles(mut recording: Recording) -> Recording {
    let axles = axles(&recording.passes);
    let Some((first, others)) = axles.split_first() else { return recording };
    let mut gains_db = BTreeMap::from([(first.clone(), 0.0)]);
    for axle in others {
        match relative(&recording, axle, first) {
            Relative::Sensitivity(gain_db) => {
                gains_db.insert(axle.clone(), gain_db);
            }
            Relative::Alike => {
                gains_db.insert(axle.clone(), 0.0);
            }
            Relative::Unlike(spread_db) => recording.doubts.push(format!(
                "doubt: the levels of axles {first} and {axle} differ, and not alike in all bands (by {} dB between \
                 bands): masses, loads or sensor mountings differ; evaluate each with --axle",
                significant(spread_db, 2)
            )),
            Relative::Unknown => recording.doubts.push(format!(
                "doubt: axles {first} and {axle} share no speed and stretch, so that their sensitivities were \
                 not compared"
            )),
        }
    }
    let mean_db = gains_db.values().sum::<f64>() / gains_db.len() as f64;
    if gains_db.values().all(|gain_db| *gain_db == 0.0) {
        return recording;
    }
    let scaled = |mut pass: Pass| {
        let gain_db = pass.axle.as_ref().and_then(|axle| gains_db.get(axle));
        if let Some(gain_db) = gain_db {
            pass.signal = scaled(&pass.signal, 10f64.powf((mean_db - gain_db) / 20.0));
        }
        pass
    };
    recording.passes = recording.passes.into_iter().map(scaled).collect();
    let of_axle =
        |(axle, gain_db): (&String, &f64)| format!("axle {axle} {:+.1} dB", gain_db - mean_db);
    let levels: Vec<String> = gains_db.iter().map(of_axle).collect();
    recording.doubts.push(format!(
        "the axles differ in level, alike in all bands and at most speeds ({} from their mean): probably their sensors \
         differ in sensitivity; the passes were scaled to the mean, because nothing tells which sensor is right",
        levels.join(", ")
    ));
    recording
}

/// Level of an axle relative to another one.
enum Relative {
    /// The same difference in all bands, in dB.
    Sensitivity(f64),
    /// No difference beyond chance.
    Alike,
    /// Another difference in each band; largest difference between bands in dB.
    Unlike(f64),
    /// Nothing to compare.
    Unknown,
}

fn relative(recording: &Recording, axle: &str, first: &str) -> Relative {
    let of_speed = |group: Vec<usize>| {
        let of = |name: &str| {
            let is_of =
                |&place: &usize| recording.passes[group[place]].axle.as_deref() == Some(name);
            (0..group.len()).filter(is_of).collect::<Vec<usize>>()
        };
        let (own, other) = (of(axle), of(first));
        if own.is_empty() || other.is_empty() {
            return None;
        }
        Levels::of(recording, &group)?.difference(&own, &other)
    };
    let groups = by_speed(&recording.passes);
    let differences: Vec<LevelDifference> = groups.into_iter().filter_map(of_speed).collect();
    if differences.is_empty() {
        return Relative::Unknown;
    }
    let over_speeds =
        |of: fn(&LevelDifference) -> f64| median(differences.iter().map(of).collect());
    let gain_db = over_speeds(|level| level.mean_db.0);
    let uniform = differences.iter().filter(|level| level.is_uniform()).count();
    if 2 * uniform < differences.len() {
        Relative::Unlike(over_speeds(|level| level.spread_db))
    } else if gain_db.abs() < USUAL_DB || over_speeds(|level| level.ln_p) > ALPHA.ln() {
        Relative::Alike
    } else {
        Relative::Sensitivity(gain_db)
    }
}

/// Names of the axles in their order.
fn axles(passes: &[Pass]) -> Vec<String> {
    let mut axles: Vec<String> = Vec::new();
    for axle in passes.iter().filter_map(|pass| pass.axle.as_ref()) {
        if !axles.contains(axle) {
            axles.push(axle.clone());
        }
    }
    axles
}

fn scaled(signal: &Signal, factor: f64) -> Signal {
    let samples = signal.samples().iter().map(|sample| factor * sample).collect();
    Signal::new(signal.sample_rate_hz(), samples).expect("finite samples times a finite factor")
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ALPHA as FALSE_ALARMS, measured};
    use super::*;
    use crate::chain::gains;

    /// Axle 1, then axle 2 at each of two speeds; the samples of axle 2 pass through a filter.
    fn two_axles(axle_2: &dyn Fn(&mut [f64])) -> Recording {
        let mut recording = measured(3, &|pass, samples, _| {
            if pass % 2 == 1 {
                axle_2(samples);
            }
        });
        for (pass, axle) in recording.passes.iter_mut().zip(["1", "2", "1", "2"]) {
            pass.axle = Some(axle.to_owned());
        }
        recording
    }

    #[test]
    fn sensors_of_two_axles_get_one_sensitivity() {
        let recording = two_axles(&|samples| samples.iter_mut().for_each(|sample| *sample *= 0.7));
        assert!(gains(&recording).iter().all(|gain| gain.is_error(FALSE_ALARMS)), "no test");
        let before = recording.doubts.len();
        let equal = with_equal_axles(recording.clone());
        assert!(gains(&equal).iter().all(|gain| !gain.is_error(FALSE_ALARMS)));
        // 0.7 is -3.1 dB: half of it for each axle.
        assert!(
            equal.doubts[before].contains("axle 1 +1.5 dB, axle 2 -1.5 dB"),
            "{:?}",
            equal.doubts
        );
        let factor = |pass: usize| {
            equal.passes[pass].signal.samples()[100] / recording.passes[pass].signal.samples()[100]
        };
        assert!((factor(0) * factor(1) - 1.0).abs() < 1e-12);
        assert!((factor(1) - 0.7f64.powf(-0.5)).abs() < 0.01, "{}", factor(1));
    }

    #[test]
    fn passes_of_one_axle_keep_their_gains() {
        let mut recording =
            two_axles(&|samples| samples.iter_mut().for_each(|sample| *sample *= 0.7));
        recording.passes.iter_mut().for_each(|pass| pass.axle = Some("1".to_owned()));
        let kept = with_equal_axles(recording.clone());
        assert_eq!(kept.doubts, recording.doubts);
        assert_eq!(kept.passes[1].signal.samples(), recording.passes[1].signal.samples());
    }

    #[test]
    fn one_pass_of_another_gain_remains_one() {
        let mut recording = two_axles(&|_| ());
        // A third speed, so that most speeds agree.
        let slow: Vec<Pass> = recording.passes[2..].to_vec();
        recording.passes.extend(slow.into_iter().map(|pass| Pass { speed_km_h: 6.0, ..pass }));
        recording.passes[1].signal = scaled(&recording.passes[1].signal, 0.7);
        let kept = with_equal_axles(recording.clone());
        assert_eq!(kept.doubts, recording.doubts);
        assert!(gains(&kept)[1].is_error(FALSE_ALARMS));
    }

    #[test]
    fn axles_that_differ_by_bands_are_doubted() {
        // A sum of two neighbouring samples, twelve times: a low pass.
        let recording = two_axles(&|samples| {
            for _ in 0..12 {
                for index in (1..samples.len()).rev() {
                    samples[index] = 0.5 * (samples[index] + samples[index - 1]);
                }
            }
        });
        let kept = with_equal_axles(recording.clone());
        assert!(kept.doubts.last().unwrap().contains("--axle"), "{:?}", kept.doubts);
        assert_eq!(kept.passes[1].signal.samples(), recording.passes[1].signal.samples());
    }
}
