//! Candidates: kinds of physics with places and strengths for the screening.

use crate::section::Section;
use tracktwin_track::extension::{Class, ExtensionInstance, Family, Kind, KindParameter, Places};

/// Of a parameter that may be zero, the least part of its greatest value that counts.
const LEAST: f64 = 1e-2;

/// A piece of physics at a place, in terms of the recording, with the parameters to be found.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What it is.
    pub kind: &'static Kind,
    /// The physics with its place; compared sleepers count from 0, places are the recording's.
    pub extension: ExtensionInstance,
    /// Parameters to be fitted, inside their ranges.
    pub free: Vec<&'static KindParameter>,
    /// Values of the free parameters that screening tries.
    pub trials: Vec<Vec<f64>>,
    /// Length ratio of the track to V-Track, by which parameters have their ranges.
    pub length_ratio: f64,
}

impl Candidate {
    /// Whether it is nowhere in particular: all along the track, at the wheel or in the sensor.
    pub fn is_everywhere(&self) -> bool {
        self.extension.sleepers.is_none() && self.extension.x_m.is_none()
    }

    /// Whether it acts by laws that the wheel's load decides about.
    pub(crate) fn is_under_load(&self) -> bool {
        self.kind.classes.contains(&Class::Load)
    }

    /// Whether it does nothing but add to the dynamic stiffness of track, vehicle or sensor: its model
    /// lacks neither what a load decides nor the phase of a shape.
    pub(crate) fn is_linear(&self) -> bool {
        let classes = self.kind.classes;
        !classes.contains(&Class::Load) && !classes.contains(&Class::Wavelength)
    }

    /// The extension with values for the free parameters.
    pub fn with(&self, values: &[f64]) -> ExtensionInstance {
        let pairs = self.free.iter().zip(values);
        pairs.fold(self.extension.clone(), |extension, (parameter, &value)| {
            extension.with(parameter.name, value)
        })
    }

    /// Logarithms of values of the free parameters; of none a hundredth of what is usual.
    pub fn logarithms(&self, values: &[f64]) -> Vec<f64> {
        let logarithm = |(parameter, &value): (&&KindParameter, &f64)| {
            value.max(LEAST * parameter.range(self.length_ratio)[1]).ln()
        };
        self.free.iter().zip(values).map(logarithm).collect()
    }

    /// Whether what was found, by the logarithms of the free parameters, may be of this kind.
    pub fn is_plausible(&self, logarithms: &[f64]) -> bool {
        let plausible = |(parameter, &value): (&&KindParameter, &f64)| {
            let [low, high] = parameter.range(self.length_ratio).map(f64::ln);
            let beyond = (low - value).max(value - high);
            beyond <= parameter.slack
        };
        self.free.iter().zip(logarithms).all(plausible)
    }

    /// Middle and standard deviation of a parameter's logarithm before anything is measured: its
    /// range holds two deviations.
    pub fn prior(&self, parameter: &KindParameter) -> (f64, f64) {
        let [low, high] = self.range(parameter);
        (0.5 * (low + high), 0.5 * (high - low) + 0.1)
    }

    /// Logarithms of the ends of a parameter's range; of one that may be zero the lower end is a
    /// hundredth of the upper.
    pub fn range(&self, parameter: &KindParameter) -> [f64; 2] {
        let [low, high] = parameter.range(self.length_ratio);
        [low.max(LEAST * high).ln(), high.ln()]
    }
}

/// Every candidate for a section: each kind at each possible place, according to its screening.
pub fn candidates(section: &Section) -> Vec<Candidate> {
    let design = &section.track.design;
    let kinds = Kind::all().filter(|kind| !(kind.screening.is_stated)(design));
    kinds.flat_map(|kind| of_kind(kind, section)).collect()
}

/// Those of a kind: families with the same places go through them together.
fn of_kind(kind: &'static Kind, section: &Section) -> Vec<Candidate> {
    let mut all = Vec::new();
    let length_ratio = section.track.design.length_ratio();
    for families in kind.screening.families.chunk_by(|a, b| a.places == b.places) {
        for place in places(families[0].places, section) {
            let at_place = place.put(ExtensionInstance::new(kind.physics));
            all.extend(
                families
                    .iter()
                    .map(|family| of_family(kind, family, at_place.clone(), length_ratio)),
            );
        }
    }
    all
}

fn of_family(
    kind: &'static Kind,
    family: &Family,
    place: ExtensionInstance,
    length_ratio: f64,
) -> Candidate {
    let scaled = |name: &str, value| parameter(kind, name).scaled(value, length_ratio);
    let held = family.held.iter();
    let free: Vec<_> = family.free.iter().map(|name| parameter(kind, name)).collect();
    let trial = |values: Vec<f64>| {
        let pairs = free.iter().zip(values);
        pairs.map(|(parameter, value)| parameter.scaled(value, length_ratio)).collect()
    };
    Candidate {
        kind,
        extension: held
            .fold(place, |extension, &(name, value)| extension.with(name, scaled(name, value))),
        trials: family.trials.values().into_iter().map(trial).collect(),
        free,
        length_ratio,
    }
}

pub(crate) fn parameter(kind: &'static Kind, name: &str) -> &'static KindParameter {
    kind.parameter(name).expect("a kind's screening names parameters of its own")
}

/// A place on the recording's track; compared sleepers count from 0.
enum Place {
    Everywhere,
    Sleepers(Vec<usize>),
    Point(f64),
}

impl Place {
    fn put(self, extension: ExtensionInstance) -> ExtensionInstance {
        match self {
            Self::Everywhere => extension,
            Self::Sleepers(sleepers) => extension.on(sleepers),
            Self::Point(x_m) => extension.at([x_m, x_m]),
        }
    }
}

fn places(places: Places, section: &Section) -> Vec<Place> {
    let single = || (0..section.sleepers).map(|sleeper| Place::Sleepers(vec![sleeper]));
    match places {
        Places::Everywhere => vec![Place::Everywhere],
        Places::Sleepers => single().collect(),
        Places::SleepersAndPairs => {
            let pairs = (1..section.sleepers).map(|it| Place::Sleepers(vec![it - 1, it]));
            single().chain(pairs).collect()
        }
        Places::Points => {
            let half_span_m = 0.5 * section.track.design.sleeper.spacing_m;
            let point = |half: usize| Place::Point(section.first_x_m + half as f64 * half_span_m);
            (0..2 * section.sleepers - 1).map(point).collect()
        }
        Places::Patterns => {
            let patterns = (2..=5).flat_map(|every| (0..every).map(move |first| (every, first)));
            let pattern = |(every, first)| (first..section.sleepers).step_by(every).collect();
            patterns.map(pattern).map(Place::Sleepers).collect()
        }
    }
}
