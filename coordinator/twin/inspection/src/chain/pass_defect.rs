//! Pass defects: reasons why passes are unusable.

use super::contact::{Airborne, airborne};
use super::offset::Offsets;
use super::speed_coherence::speed_coherences;
use super::standstill::Standstill;
use crate::along::{Background, by_speed};
use std::fmt;
use tracktwin_number::rounded;
use tracktwin_signal::recording::{Pass, Recording};

/// Longest constant stretch in s of a working sensor.
const STILL_S: f64 = 2e-3;
/// Largest log probability by chance of a constant stretch that counts as a drop-out.
const STILL_LN_P: f64 = -20.0;
/// A pass is saturated if a larger share of its samples is at the limit.
const SATURATED: f64 = 0.02;
/// A pass is unusable if the share of the time without contact is larger.
const AIRBORNE: f64 = 0.5;
/// Two passes at one speed with a smaller correlation have no common track.
const UNLIKE: f64 = 0.3;
/// Passes at two speeds with a smaller coherence have no common surface.
const STRANGE: f64 = 0.1;
/// A pass contains a signal if its power is this ratio above the noise floor at least up to the frequency
/// `AUDIBLE_M_S` over the sleeper spacing (80 Hz on V-Track). Below this frequency the signal depends on
/// the vehicle rather than on the track.
const AUDIBLE: f64 = 4.0;
const AUDIBLE_M_S: f64 = 10.0;
/// Smallest length of a pass in sleeper spacings.
const SPANS_MIN: f64 = 4.0;

/// Reason why a pass is unusable.
#[derive(Clone, Debug, PartialEq)]
pub enum PassDefect {
    /// The signal is constant for some time.
    DropOut {
        /// Index of the pass.
        pass: usize,
        /// Position in m at which the constant stretch begins.
        from_m: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// The whole signal is constant.
    Dead {
        /// Index of the pass.
        pass: usize,
    },
    /// The pass contains only the noise of sensor and recorder, and no other pass has its speed.
    Noise {
        /// Index of the pass.
        pass: usize,
    },
    /// A large share of the samples is at the limit of the recorder.
    Saturated {
        /// Index of the pass.
        pass: usize,
        /// Share of these samples, 0 to 1.
        share: f64,
    },
    /// The wheel is off the rail for most of the time; the signal hardly depends on the track.
    Airborne {
        /// Index of the pass.
        pass: usize,
        /// Share of the time without contact, 0 to 1.
        share: f64,
    },
    /// Two passes over the same track at one speed are uncorrelated. Possible reasons: noise, another
    /// track, or position errors of more than half a sleeper spacing.
    UnrelatedPasses {
        /// Indices of the passes.
        passes: [usize; 2],
        /// Median correlation of the passes, 0 to 1.
        correlation: f64,
        /// Lowest compared frequency in Hz.
        low_hz: f64,
    },
    /// The passes at one speed have no common surface with those at any other speed. Possible reasons:
    /// noise, another track, or position errors of more than a sleeper spacing.
    UnrelatedSpeed {
        /// Nominal speed in km/h.
        speed_km_h: f64,
        /// Greatest coherence of one of these passes with a pass at another speed, at most 1.
        coherence: f64,
    },
    /// The pass covers too few sleepers.
    Short {
        /// Index of the pass.
        pass: usize,
        /// Length of the pass in m.
        length_m: f64,
    },
}

impl fmt::Display for PassDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DropOut { pass, from_m, duration_s } => write!(
                f,
                "pass {}: no change for {:.1} ms from {from_m:.3} m on: a drop-out; remove that stretch",
                pass + 1,
                1e3 * duration_s
            ),
            Self::Dead { pass } => {
                write!(f, "pass {}: the signal does not change; check sensor and cable", pass + 1)
            }
            Self::Noise { pass } => write!(
                f,
                "pass {}: no signal above the noise floor; check sensor, cable and gain",
                pass + 1
            ),
            Self::Saturated { pass, share } => write!(
                f,
                "pass {}: {:.1} % of the samples are at the recorder's limit; record again with less gain",
                pass + 1,
                1e2 * share
            ),
            Self::Airborne { pass, share } => write!(
                f,
                "pass {}: the wheel is off the rail for {:.0} % of the time; check load and \
                     unsprung mass, and record at a lower speed or on a smoother rail",
                pass + 1,
                1e2 * share
            ),
            Self::UnrelatedPasses { passes: [first, second], correlation, low_hz } => write!(
                f,
                "passes {} and {}, at one speed: their correlation above {low_hz:.0} Hz is {correlation:.2}; noise, another track, or positions that are off by more than half a sleeper spacing or wander within one",
                first + 1,
                second + 1
            ),
            Self::UnrelatedSpeed { speed_km_h, coherence } => write!(
                f,
                "the passes at {} km/h: their coherence with those at other speeds, in waves of a tenth of a sleeper spacing to one, is {coherence:.2}; noise, another track, or positions off by more than a sleeper spacing",
                rounded(*speed_km_h, 4)
            ),
            Self::Short { pass, length_m } => write!(
                f,
                "pass {}: covers {length_m:.2} m, fewer than {SPANS_MIN:.0} sleeper spacings; \
                     record a longer stretch",
                pass + 1
            ),
        }
    }
}

/// All defects of the passes of a recording; `offsets` must belong to the same recording.
pub fn pass_defects(recording: &Recording, offsets: &[Offsets]) -> Vec<PassDefect> {
    let mut all = of_passes(recording);
    all.extend(between_passes(recording, offsets));
    all
}

/// Defects of single passes.
pub(super) fn of_passes(recording: &Recording) -> Vec<PassDefect> {
    let passes = recording.passes.iter().enumerate();
    let flying = airborne(recording);
    let mut all: Vec<PassDefect> = passes
        .flat_map(|(index, pass)| of_pass(index, pass, recording.spacing_m, flying[index].as_ref()))
        .collect();
    let speeds = by_speed(&recording.passes);
    let alone = speeds.iter().filter(|passes| passes.len() == 1).map(|passes| passes[0]);
    let audible_hz = AUDIBLE_M_S / recording.spacing_m;
    let noise = alone.filter(|&pass| is_noise(&recording.passes[pass], audible_hz));
    all.extend(noise.map(|pass| PassDefect::Noise { pass }));
    all
}

/// Defects of passes without a common track.
pub(super) fn between_passes(recording: &Recording, offsets: &[Offsets]) -> Vec<PassDefect> {
    let unlike = |offsets: &&Offsets| {
        // Where half of the stretches match, the rest is noise or a worn clock, not another track.
        2 * offsets.matched.len() < offsets.stretches && offsets.correlation < UNLIKE
    };
    let mut all: Vec<PassDefect> = offsets
        .iter()
        .filter(unlike)
        .map(|offsets| PassDefect::UnrelatedPasses {
            passes: offsets.passes,
            correlation: offsets.correlation,
            low_hz: offsets.low_hz,
        })
        .collect();
    let speed_coherences = speed_coherences(recording);
    let unrelated =
        speed_coherences.iter().filter(|speed_coherence| speed_coherence.coherence < STRANGE);
    all.extend(unrelated.map(|speed_coherence| PassDefect::UnrelatedSpeed {
        speed_km_h: speed_coherence.speed_km_h,
        coherence: speed_coherence.coherence,
    }));
    all
}

fn of_pass(
    index: usize,
    pass: &Pass,
    spacing_m: f64,
    flying: Option<&Airborne>,
) -> Vec<PassDefect> {
    let samples = pass.signal.samples();
    let length_m = pass.position_m[samples.len() - 1] - pass.position_m[0];
    let mut all = Vec::new();
    if length_m < SPANS_MIN * spacing_m {
        all.push(PassDefect::Short { pass: index, length_m });
    }
    if Background::of(&pass.signal).is_none() && samples.windows(2).all(|pair| pair[0] == pair[1]) {
        all.push(PassDefect::Dead { pass: index });
        return all;
    }
    if let Some(share) = flying.map(Airborne::share).filter(|share| *share > AIRBORNE) {
        all.push(PassDefect::Airborne { pass: index, share });
        return all;
    }
    let share = share_at_limits(samples, flying.map(|found| found.sign));
    if share > SATURATED {
        all.push(PassDefect::Saturated { pass: index, share });
        return all;
    }
    all.extend(drop_out(index, pass));
    all
}

/// Whether the signal does not exceed the noise floor. For repeated passes the comparison of passes is the
/// better test.
fn is_noise(pass: &Pass, audible_hz: f64) -> bool {
    let background = Background::of(&pass.signal);
    background.is_some_and(|background| background.audible_hz(AUDIBLE) < audible_hz)
}

/// Share of samples that equal the greatest or the least value. A side on which the wheel loses contact has
/// no limit.
fn share_at_limits(samples: &[f64], airborne_sign: Option<f64>) -> f64 {
    let mut ends = samples.iter().fold([f64::MAX, f64::MIN], |e, s| [e[0].min(*s), e[1].max(*s)]);
    match airborne_sign {
        Some(sign) if sign > 0.0 => ends[1] = f64::NAN,
        Some(_) => ends[0] = f64::NAN,
        None => {}
    }
    samples.iter().filter(|sample| ends.contains(sample)).count() as f64 / samples.len() as f64
}

/// The longest constant stretch, if it is too improbable by chance.
fn drop_out(index: usize, pass: &Pass) -> Option<PassDefect> {
    let samples = pass.signal.samples();
    let standstill = Standstill::longest(samples);
    let duration_s = standstill.samples as f64 / pass.signal.sample_rate_hz();
    // At the recorder's limit it is a crest that is cut off.
    let is_cut = [1.0, -1.0].iter().any(|&sign| standstill.is_at_limit(samples, sign));
    let is_drop_out = duration_s >= STILL_S && standstill.ln_p < STILL_LN_P && !is_cut;
    is_drop_out.then(|| PassDefect::DropOut {
        pass: index,
        from_m: pass.position_m[standstill.from],
        duration_s,
    })
}
