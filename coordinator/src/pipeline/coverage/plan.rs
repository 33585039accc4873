//! Selection of the simulated tracks: unseen tracks inside the library's ranges, beyond each end of a
//! range, uneven ones, and those requested by the user.

use super::track::Track;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use tracktwin_parameters::{Parameter, ParameterSet, unit};
use tracktwin_surrogate::{Side, TrainingSet};

/// Unevenness from sleeper to sleeper, relative to the mean.
const SCATTER: [f64; 4] = [0.0, 0.05, 0.15, 0.3];
/// Factors of a value beyond the ends of a range, applied to the end.
const BEYOND: [(Side, f64); 2] = [(Side::Low, 0.7), (Side::High, 1.3)];
/// Ratio of the ends of a range above which values are drawn log-uniformly.
const LOGARITHMIC_FROM: f64 = 4.0;

/// Kind of the tracks of a row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Kind {
    /// All parameters are inside their ranges. Railpad and ballast stiffness differ from sleeper to
    /// sleeper.
    Inside {
        /// Unevenness: standard deviation divided by the mean.
        scatter: f64,
    },
    /// One parameter is beyond an end of its range; the others are inside.
    Beyond {
        /// The parameter.
        parameter: Parameter,
        /// The end of the range.
        side: Side,
    },
    /// One parameter has a given value; the others are in the middle of their ranges.
    Set {
        /// The parameter.
        parameter: Parameter,
        /// Value in the unit of the parameter.
        value: f64,
    },
}

/// The rows of the table, each with its tracks.
pub(super) fn rows(
    library: &TrainingSet,
    fixed: &ParameterSet,
    settings: &[(Parameter, f64)],
    counts: Counts,
) -> Vec<(Kind, Vec<Track>)> {
    let inside = SCATTER.map(|scatter| Kind::Inside { scatter });
    let beyond = library
        .varied
        .iter()
        .flat_map(|&parameter| BEYOND.map(|(side, _)| Kind::Beyond { parameter, side }));
    let set = settings.iter().map(|&(parameter, value)| Kind::Set { parameter, value });
    let kinds = inside.into_iter().chain(beyond).chain(set);
    let tracks = |(number, kind): (usize, Kind)| {
        let many = match kind {
            Kind::Set { .. } => 1,
            Kind::Inside { .. } => 2 * counts.tracks,
            Kind::Beyond { .. } => counts.tracks,
        };
        let seed = |index: usize| seed(counts.seed, number, index);
        let track = |index| track(library, fixed, kind, counts.sleepers, seed(index));
        (kind, (0..many).map(track).collect())
    };
    kinds.enumerate().map(tracks).collect()
}

/// Numbers of tracks and sleepers.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// Number of tracks beyond each end of a range; twice this number inside.
    pub tracks: usize,
    /// Number of sleepers per track.
    pub sleepers: usize,
    /// Seed of parameters and surfaces.
    pub seed: u64,
}

fn seed(seed: u64, row: usize, index: usize) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin coverage track 1");
    for number in [seed, row as u64, index as u64] {
        hasher.update(&number.to_le_bytes());
    }
    let hash = hasher.finalize();
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

fn track(
    library: &TrainingSet,
    fixed: &ParameterSet,
    kind: Kind,
    sleepers: usize,
    seed: u64,
) -> Track {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let surface_seed = random.next_u64() >> 1;
    let mut set = *fixed;
    for (column, &parameter) in library.varied.iter().enumerate() {
        let range = library.range(column);
        let place = unit(random.next_u64());
        set = set.with(parameter, value(kind, parameter, range, place));
    }
    if let Kind::Set { parameter, value } = kind {
        set = set.with(parameter, value);
    }
    let scatter = if let Kind::Inside { scatter } = kind { scatter } else { 0.0 };
    let sleepers = (0..sleepers).map(|_| uneven(set, scatter, &mut random)).collect();
    Track { sleepers, surface_seed }
}

/// Mean of a parameter along the track; `place` (0 to 1) is the relative position in the allowed range.
fn value(kind: Kind, parameter: Parameter, [low, high]: [f64; 2], place: f64) -> f64 {
    match kind {
        Kind::Beyond { parameter: beyond, side } if beyond == parameter => match side {
            Side::Low => BEYOND[0].1 * low,
            Side::High => BEYOND[1].1 * high,
        },
        Kind::Set { .. } => middle(low, high),
        Kind::Inside { scatter } if differs(parameter) => {
            // So that nearly all sleepers lie inside, not only the mean.
            let factor = (2.0 * scatter).exp();
            let [low, high] = if low * factor < high / factor {
                [low * factor, high / factor]
            } else {
                [middle(low, high); 2]
            };
            between(low, high, place)
        }
        _ => between(low, high, place),
    }
}

fn between(low: f64, high: f64, place: f64) -> f64 {
    if high / low > LOGARITHMIC_FROM {
        low * (high / low).powf(place)
    } else {
        low + place * (high - low)
    }
}

fn middle(low: f64, high: f64) -> f64 {
    0.5 * (low + high)
}

fn differs(parameter: Parameter) -> bool {
    matches!(parameter, Parameter::RailpadStiffness | Parameter::BallastStiffness)
}

/// The set with random log-normal railpad and ballast stiffness of unchanged mean.
fn uneven(set: ParameterSet, scatter: f64, random: &mut impl Rng) -> ParameterSet {
    let variance = (scatter * scatter).ln_1p();
    [Parameter::RailpadStiffness, Parameter::BallastStiffness].into_iter().fold(
        set,
        |set, parameter| {
            let normal: f64 = StandardNormal.sample(random);
            set.with(parameter, set[parameter] * (variance.sqrt() * normal - 0.5 * variance).exp())
        },
    )
}
