//! Unusable passes, and why.

use super::contact::{Airborne, airborne};
use super::offset::Offsets;
use super::speed_coherence::speed_coherences;
use super::standstill::Standstill;
use crate::along::{Background, by_speed};
use std::fmt;
use tracktwin_number::rounded;
use tracktwin_signal::recording::{Pass, Recording};

/// Longest stretch in s without a change that a sensor at work shows.
const STILL_S: f64 = 2e-3;
/// Logarithm of the probability of a stretch without a change by chance.
const STILL_LN_P: f64 = -20.0;
/// Share of samples at the limit above which a pass is saturated.
const SATURATED: f64 = 0.02;
/// Share of the time without contact above which a pass is unusable.
const AIRBORNE: f64 = 0.5;
/// Correlation of two passes at one speed below which they have no track in common.
const UNLIKE: f64 = 0.3;
/// Coherence of passes at two speeds below which they have no surface in common.
const STRANGE: f64 = 0.1;
/// Ratio to the noise floor above which a pass contains a signal, and frequency times sleeper
/// spacing in m/s up to which it must (80 Hz on V-Track): below, the signal is of the vehicle, not
/// of the track.
const AUDIBLE: f64 = 4.0;
const AUDIBLE_M_S: f64 = 10.0;
/// Sleeper spacings that a pass must cover to be compared with itself elsewhere.
const SPANS_MIN: f64 = 4.0;

/// Why a pass can't be used.
#[derive(Clone, Debug, PartialEq)]
pub enum PassDefect {
    /// The signal doesn't change for a while.
    DropOut {
        /// Index of the pass.
        pass: usize,
        /// Where in m it begins.
        from_m: f64,
        /// For how long in s.
        duration_s: f64,
    },
    /// The signal doesn't change at all.
    Dead {
        /// Index of the pass.
        pass: usize,
    },
    /// The only pass at its speed, and nothing but the noise of sensor and recorder.
    Noise {
        /// Index of the pass.
        pass: usize,
    },
    /// A large part of the samples is at the recorder's limit.
    Saturated {
        /// Index of the pass.
        pass: usize,
        /// Their share.
        share: f64,
    },
    /// The wheel is in the air for most of the time: there is hardly a track in it.
    Airborne {
        /// Index of the pass.
        pass: usize,
        /// Share of the time in the air.
        share: f64,
    },
    /// Two passes over the same track at one speed have nothing in common: noise, another track, or
    /// positions that are off by more than half a sleeper spacing.
    UnrelatedPasses {
        /// Indices of the passes.
        passes: [usize; 2],
        /// Their median correlation.
        correlation: f64,
        /// Lowest frequency compared in Hz.
        low_hz: f64,
    },
    /// The passes at one speed share no surface with those at any other: noise, another track, or
    /// positions that are off by more than a sleeper spacing.
    UnrelatedSpeed {
        /// Nominal speed in km/h.
        speed_km_h: f64,
        /// Their greatest coherence with a pass at another speed.
        coherence: f64,
    },
    /// The pass covers too few sleepers.
    Short {
        /// Index of the pass.
        pass: usize,
        /// What it covers in m.
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
                "passes {} and {}, at one speed: their correlation above {low_hz:.0} Hz is {correlation:.2}; noise, another track, or positions off by more than half a sleeper spacing",
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

/// Everything that makes passes unusable; `offsets` are those of the same recording.
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

/// Passes that have no track in common.
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

/// Whether no signal exceeds the noise floor. For repeated passes the comparison between them is
/// the better test.
fn is_noise(pass: &Pass, audible_hz: f64) -> bool {
    let background = Background::of(&pass.signal);
    background.is_some_and(|background| background.audible_hz(AUDIBLE) < audible_hz)
}

/// Share of samples that have exactly the greatest or the least value; a side on which the wheel is in the
/// air has no limit.
fn share_at_limits(samples: &[f64], airborne_sign: Option<f64>) -> f64 {
    let mut ends = samples.iter().fold([f64::MAX, f64::MIN], |e, s| [e[0].min(*s), e[1].max(*s)]);
    match airborne_sign {
        Some(sign) if sign > 0.0 => ends[1] = f64::NAN,
        Some(_) => ends[0] = f64::NAN,
        None => {}
    }
    samples.iter().filter(|sample| ends.contains(sample)).count() as f64 / samples.len() as f64
}

/// The longest stretch without a change, if chance doesn't make it.
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
