//! Loss of contact: the acceleration of the wheel equals load over unsprung mass, because no other force
//! acts.
//!
//! A recorder at its limit makes plateaus too, but on both sides or at any level, and no recorded value
//! exceeds the limit. Loss of contact makes plateaus on one side only and at one level, and the blow of the
//! landing exceeds this level on the other side.

use super::plateau::Plateaus;
use super::standstill::Standstill;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use tracktwin_signal::recording::{Pass, Recording};

/// Largest relative difference between a level and the load over the unsprung mass if they are the same:
/// stated load, mass and gain are accurate to a few per cent.
const NEAR: f64 = 0.03;
/// Largest ratio between the two if load, mass or gain are not as stated.
const OFF_MAX: f64 = 2.0;
/// Smallest ratio of the extreme value on the other side to the level, if the level is not the limit of the
/// recorder.
const BEYOND: f64 = 1.05;
/// Smallest number of flat crests in a pass that determine a level without a stated value, and the largest probability
/// of as many by chance; `EVEN_LN_P` is the largest log probability of a single constant crest by chance.
const CRESTS_MIN: usize = 2;
const CRESTS_BY_CHANCE: f64 = 0.005;
const EVEN_LN_P: f64 = -20.0;
/// Share of equal neighbours in a plateau from which on a recorder holds the value.
const HELD: f64 = 0.8;
/// Number of parts of a pass in which the noise is estimated.
const PARTS: usize = 16;
/// Smallest noise, as a share of the level, for this test. In simulated passes without noise, a wheel on
/// rough rail gives up to 2.3e-4.
const NOISE_MIN: f64 = 3e-4;
/// Largest distance of two contact losses that count as one stretch, in sleeper spacings.
const APART: f64 = 1.0;

/// Loss of contact between wheel and rail.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LossOfContact {
    /// Acceleration in m/s2 during contact loss, with the sign of the recording.
    pub level_m_s2: f64,
    /// Load over unsprung mass in m/s2; `None` if the recording does not state both.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub expected_m_s2: Option<f64>,
    /// Speeds with contact loss in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Stretches `[from, to]` of the track in m, over all passes.
    pub x_m: Vec<[f64; 2]>,
    /// Ids of the sleepers in whose windows the wheel is off the rail.
    pub sleepers: Vec<String>,
    /// The passes with contact loss.
    pub passes: Vec<PassLoss>,
}

/// Contact loss in one pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassLoss {
    /// Number of the pass in the recording, from 1.
    pub pass: usize,
    /// Speed of the pass in km/h.
    pub speed_km_h: f64,
    /// Share of the time without contact, 0 to 1.
    pub share: f64,
    /// Longest single contact loss in s.
    pub longest_s: f64,
    /// Stretches `[from, to]` in m without contact.
    pub x_m: Vec<[f64; 2]>,
}

impl LossOfContact {
    /// The pass with the largest share of contact loss.
    pub fn worst(&self) -> Option<&PassLoss> {
        self.passes.iter().max_by(|a, b| a.share.total_cmp(&b.share))
    }

    /// Longest single contact loss of all passes in s.
    pub fn longest_s(&self) -> f64 {
        self.passes.iter().map(|pass| pass.longest_s).fold(0.0, f64::max)
    }

    /// Description as a sentence; `recorded` is the number of passes in the recording.
    pub fn sentence(&self, recorded: usize) -> String {
        let speeds: Vec<String> = self.speeds_km_h.iter().map(|it| format!("{it:.1}")).collect();
        let [from_m, to_m] = self.reach_m();
        let share = self.worst().map_or(0.0, |pass| 1e2 * pass.share);
        format!(
            "the wheel loses contact with the rail in {} of {recorded} passes (at {} km/h), from {from_m:.3} to {to_m:.3} m{}, for up to {:.1} ms at a time and {share:.1} % of the time; its acceleration then stays at {:.1} m/s2{}. No linear model of the track holds there",
            self.passes.len(),
            speeds.join(", "),
            self.near(),
            1e3 * self.longest_s(),
            self.level_m_s2,
            self.compared(),
        )
    }

    /// First and last position in m without contact.
    pub fn reach_m(&self) -> [f64; 2] {
        self.x_m.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], [from, to]| {
            [first.min(*from), last.max(*to)]
        })
    }

    fn near(&self) -> String {
        match &self.sleepers[..] {
            [] => String::new(),
            [only] => format!(", near {only}"),
            [first, .., last] => format!(", near {first} to {last}"),
        }
    }

    /// Comparison of the level with load over unsprung mass, as part of the sentence.
    fn compared(&self) -> String {
        let Some(expected) = self.expected_m_s2 else { return String::new() };
        let off = self.level_m_s2.abs() / expected - 1.0;
        let known = format!(", where load over unsprung mass is {expected:.1} m/s2");
        if off.abs() > NEAR {
            let percent = 1e2 * off;
            return known + &format!(" as stated: load, mass or gain deviate by {percent:+.0} %");
        }
        if self.level_m_s2 < 0.0 {
            known + ", upwards: the sign of the sensor is reversed"
        } else {
            known
        }
    }
}

/// Detects the stretches on which the wheel loses contact with the rail; `None` if there are none.
pub fn loss_of_contact(recording: &Recording) -> Option<LossOfContact> {
    let airborne = airborne(recording);
    let lost = airborne.iter().enumerate().filter_map(|(pass, it)| Some((pass, it.as_ref()?)));
    let sign = lost.clone().next()?.1.sign;
    let passes: Vec<PassLoss> =
        lost.clone().map(|(pass, found)| pass_loss(recording, pass, found)).collect();
    let levels: Vec<f64> = lost.map(|(_, found)| found.plateaus.level).collect();
    let mut speeds_km_h: Vec<f64> = passes.iter().map(|pass| pass.speed_km_h).collect();
    speeds_km_h.sort_by(f64::total_cmp);
    speeds_km_h.dedup();
    let half_m = 0.5 * recording.spacing_m;
    let flies_over = |x_m: f64| {
        let mut flights = passes.iter().flat_map(|pass| &pass.x_m);
        flights.any(|[from, to]| from - half_m <= x_m && x_m <= to + half_m)
    };
    let sleepers = recording.sleepers.iter().filter(|sleeper| flies_over(sleeper.x_m));
    Some(LossOfContact {
        level_m_s2: sign * levels.iter().sum::<f64>() / levels.len() as f64,
        expected_m_s2: expected_m_s2(recording),
        speeds_km_h,
        x_m: stretches(&passes, APART * recording.spacing_m),
        sleepers: sleepers.map(|sleeper| sleeper.id.clone()).collect(),
        passes,
    })
}

/// Load over unsprung mass in m/s2; `None` if the recording does not state both or its gain is unknown.
pub(crate) fn expected_m_s2(recording: &Recording) -> Option<f64> {
    let [load_n, mass_kg] =
        ["load_N", "mass_kg"].map(|name| recording.nominal_value("wheel", name));
    let level = load_n? / mass_kg?;
    (recording.gain_known() && level.is_finite() && level > 0.0).then_some(level)
}

/// Whether the acceleration in m/s2 equals the stated value for contact loss. A recorder limit at this
/// level cannot be distinguished from contact loss.
pub(super) fn is_at_flight_level(recording: &Recording, level_m_s2: f64) -> bool {
    expected_m_s2(recording).is_some_and(|level| (level_m_s2 / level - 1.0).abs() <= NEAR)
}

/// Plateaus of a pass with contact loss.
#[derive(Debug)]
pub(super) struct Airborne {
    /// Side of the plateaus: 1 for positive accelerations.
    pub(super) sign: f64,
    plateaus: Plateaus,
    samples: usize,
}

impl Airborne {
    fn new(sign: f64, plateaus: Plateaus, pass: &Pass) -> Self {
        Self { sign, plateaus, samples: pass.signal.len() }
    }

    /// Share of the time of the pass without contact, 0 to 1.
    pub(super) fn share(&self) -> f64 {
        self.plateaus.samples as f64 / self.samples as f64
    }
}

/// Detects contact loss in every pass; `None` for a pass without it.
pub(super) fn airborne(recording: &Recording) -> Vec<Option<Airborne>> {
    let (expected, ends) = (expected_m_s2(recording), ends(recording));
    let passes = || recording.passes.iter();
    let mut all: Vec<Option<Airborne>> =
        passes().map(|pass| of_pass(pass, expected, ends)).collect();
    // What one pass shows of the level holds for all: they are of one vehicle.
    let level = all.iter().flatten().find(|found| found.sign > 0.0).map(|it| it.plateaus.level);
    for (pass, found) in passes().zip(&mut all) {
        if found.is_none()
            && let Some(level) = level
        {
            let plateaus = known(pass.signal.samples(), level, 1.0);
            *found = plateaus.map(|plateaus| Airborne::new(1.0, plateaus, pass));
        }
    }
    all
}

fn of_pass(pass: &Pass, expected: Option<f64>, [least, greatest]: [f64; 2]) -> Option<Airborne> {
    let samples = pass.signal.samples();
    let stated = expected.and_then(|level| known(samples, level, 1.0));
    if let Some(plateaus) = stated.or_else(|| by_shape(pass, expected, least)) {
        return Some(Airborne::new(1.0, plateaus, pass));
    }
    // A sensor mounted upside down.
    let turned = known(samples, expected?, -1.0);
    let plateaus = turned.filter(|found| greatest >= BEYOND * found.level)?;
    Some(Airborne::new(-1.0, plateaus, pass))
}

/// Plateaus at a known level in m/s2, relative to zero or to the mean of the pass: a sensor may have an
/// offset, and clipping changes the mean.
fn known(samples: &[f64], level: f64, sign: f64) -> Option<Plateaus> {
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let about =
        |zero: f64| -> Vec<f64> { samples.iter().map(|sample| sign * (sample - zero)).collect() };
    let is_there =
        |found: &Plateaus| !found.crests.is_empty() && (found.level / level - 1.0).abs() <= NEAR;
    [0.0, mean].into_iter().map(|zero| Plateaus::at(&about(zero), level)).find(is_there)
}

/// Plateaus at an unknown or wrongly stated level, identified by their shape.
fn by_shape(pass: &Pass, expected: Option<f64>, least: f64) -> Option<Plateaus> {
    let samples = pass.signal.samples();
    let found = Plateaus::at_top(samples)?;
    let standstill = Standstill::longest(samples);
    let is_even = standstill.is_at_limit(samples, 1.0) && standstill.ln_p < EVEN_LN_P;
    let may_be = |level: f64| (1.0 / OFF_MAX..=OFF_MAX).contains(&(found.level / level));
    let are_flat = found.crests.len() >= CRESTS_MIN && found.ln_p() <= CRESTS_BY_CHANCE.ln();
    let is_flight = (are_flat || is_even)
        && expected.is_none_or(may_be)
        && -least >= BEYOND * found.level
        && !is_held(pass, &found.crests);
    is_flight.then_some(found)
}

/// The least and the greatest acceleration of all passes; all passes have the same recorder.
fn ends(recording: &Recording) -> [f64; 2] {
    let samples = recording.passes.iter().flat_map(|pass| pass.signal.samples());
    samples.fold([0.0, 0.0], |[least, greatest]: [f64; 2], &sample| {
        [least.min(sample), greatest.max(sample)]
    })
}

/// Whether a recorder holds the value: neighbouring samples are equal although the pass has noise.
fn is_held(pass: &Pass, crests: &[Range<usize>]) -> bool {
    let samples = pass.signal.samples();
    let inside = crests.iter().flat_map(|crest| samples[crest.clone()].windows(2));
    let (mut equal, mut pairs) = (0_u32, 0_u32);
    for pair in inside {
        equal += u32::from(pair[0] == pair[1]);
        pairs += 1;
    }
    let level = crests.first().map_or(0.0, |crest| samples[crest.start].abs());
    f64::from(equal) >= HELD * f64::from(pairs) && noise(samples) > NOISE_MIN * level
}

/// Standard deviation of a pass's noise. The estimate uses fourth differences, which suppress slower
/// components, in the part with the lowest noise.
fn noise(samples: &[f64]) -> f64 {
    let of_part = |part: &[f64]| {
        let fourth = |w: &[f64]| w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4];
        let square: f64 = part.windows(5).map(|window| fourth(window).powi(2)).sum();
        // The squares of the factors add up to 70.
        (square / 70.0 / part.len() as f64).sqrt()
    };
    let length = (samples.len() / PARTS).max(5);
    samples.chunks_exact(length).map(of_part).fold(f64::INFINITY, f64::min)
}

fn pass_loss(recording: &Recording, index: usize, found: &Airborne) -> PassLoss {
    let pass = &recording.passes[index];
    let x_m = |crest: &Range<usize>| [pass.position_m[crest.start], pass.position_m[crest.end - 1]];
    let crests = &found.plateaus.crests;
    let longest = crests.iter().map(Range::len).max().unwrap_or(0);
    PassLoss {
        pass: index + 1,
        speed_km_h: pass.speed_km_h,
        share: found.share(),
        longest_s: longest as f64 / pass.signal.sample_rate_hz(),
        x_m: crests.iter().map(x_m).collect(),
    }
}

/// Stretches of all contact losses; those less than `apart_m` from each other are joined.
fn stretches(passes: &[PassLoss], apart_m: f64) -> Vec<[f64; 2]> {
    let mut flights: Vec<[f64; 2]> = passes.iter().flat_map(|pass| pass.x_m.clone()).collect();
    flights.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for [from, to] in flights {
        match joined.last_mut() {
            Some(last) if from - last[1] <= apart_m => last[1] = last[1].max(to),
            _ => joined.push([from, to]),
        }
    }
    joined
}
