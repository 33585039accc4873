//! Candidates: kinds of physics with locations and trial values for the screening.

use crate::section::Section;
use tracktwin_track::extension::{
    CRACKED_SLEEPER, Class, ExtensionInstance, Family, Kind, KindParameter, Places,
};

/// Smallest value of a parameter that may be zero, as a share of its greatest value.
const LEAST: f64 = 1e-2;

/// An extension at one location of the recording, with free parameters.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Kind of the extension.
    pub kind: &'static Kind,
    /// The extension with its location: indices of compared sleepers from 0, positions in m of the
    /// recording.
    pub extension: ExtensionInstance,
    /// Parameters to be fitted within their ranges.
    pub free: Vec<&'static KindParameter>,
    /// Trial values of the free parameters for the screening.
    pub trials: Vec<Vec<f64>>,
    /// Length ratio of the track to V-Track; it scales the ranges of the parameters.
    pub length_ratio: f64,
    /// Evidence in nats that the choice of its sleepers costs: zero where it is one of few places.
    pub choice_nats: f64,
}

impl Candidate {
    /// Whether it has no particular location: all along the track, at the wheel or in the sensor.
    pub fn is_everywhere(&self) -> bool {
        self.extension.sleepers.is_none() && self.extension.x_m.is_none()
    }

    /// Whether it acts by force laws that depend on the wheel load.
    pub(crate) fn is_under_load(&self) -> bool {
        self.kind.classes.contains(&Class::Load)
    }

    /// Whether its kind affects few sleepers: one or two, or a short run.
    pub(crate) fn is_of_few(&self) -> bool {
        self.is_under_load() || self.kind.physics == CRACKED_SLEEPER.physics
    }

    /// Whether it only adds to the dynamic stiffness of track, vehicle or sensor. Its linear model is then
    /// complete, without effects of the load and without the phase of a shape.
    pub(crate) fn is_linear(&self) -> bool {
        let classes = self.kind.classes;
        !classes.contains(&Class::Load) && !classes.contains(&Class::Wavelength)
    }

    /// The extension with these values of the free parameters.
    pub fn with(&self, values: &[f64]) -> ExtensionInstance {
        let pairs = self.free.iter().zip(values);
        pairs.fold(self.extension.clone(), |extension, (parameter, &value)| {
            extension.with(parameter.name, value)
        })
    }

    /// The first trial; empty if nothing is free.
    pub(crate) fn first_trial(&self) -> &[f64] {
        self.trials.first().map_or(&[], Vec::as_slice)
    }

    /// The same with the values of its first trial and no free parameter.
    pub(crate) fn held(&self) -> Self {
        let extension = self.with(self.first_trial());
        Self { extension, free: Vec::new(), trials: Vec::new(), ..self.clone() }
    }

    /// Logarithms of values of the free parameters; zero counts as a hundredth of the greatest value.
    pub fn logarithms(&self, values: &[f64]) -> Vec<f64> {
        let logarithm = |(parameter, &value): (&&KindParameter, &f64)| {
            value.max(LEAST * parameter.range(self.length_ratio)[1]).ln()
        };
        self.free.iter().zip(values).map(logarithm).collect()
    }

    /// Whether fitted values (logarithms of the free parameters) are plausible for this kind.
    pub fn is_plausible(&self, logarithms: &[f64]) -> bool {
        let plausible = |(parameter, &value): (&&KindParameter, &f64)| {
            let [low, high] = parameter.range(self.length_ratio).map(f64::ln);
            let beyond = (low - value).max(value - high);
            beyond <= parameter.slack
        };
        self.free.iter().zip(logarithms).all(plausible)
    }

    /// Prior mean and standard deviation of a parameter's logarithm; the half width of the range is about
    /// one standard deviation.
    pub fn prior(&self, parameter: &KindParameter) -> (f64, f64) {
        let [low, high] = self.range(parameter);
        (0.5 * (low + high), 0.5 * (high - low) + 0.1)
    }

    /// Logarithms of the ends of a parameter's range. If the parameter may be zero, the lower end is a
    /// hundredth of the upper end.
    pub fn range(&self, parameter: &KindParameter) -> [f64; 2] {
        let [low, high] = parameter.range(self.length_ratio);
        [low.max(LEAST * high).ln(), high.ln()]
    }
}

/// All candidates for a section: each kind at each location that its screening defines.
pub fn candidates(section: &Section) -> Vec<Candidate> {
    let design = &section.track.design;
    let kinds = Kind::all().filter(|kind| !(kind.screening.is_stated)(design));
    kinds.flat_map(|kind| of_kind(kind, section)).collect()
}

/// Candidates of a kind; families with the same locations share one loop.
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
        choice_nats: 0.0,
    }
}

pub(crate) fn parameter(kind: &'static Kind, name: &str) -> &'static KindParameter {
    kind.parameter(name).expect("a kind's screening names parameters of its own")
}

/// A location on the recording's track; indices of compared sleepers begin at 0.
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
    let single = || (0..section.sleepers()).map(|sleeper| Place::Sleepers(vec![sleeper]));
    match places {
        Places::Everywhere => vec![Place::Everywhere],
        Places::Sleepers => single().collect(),
        Places::SleepersAndPairs => {
            let pairs = (1..section.sleepers()).map(|it| Place::Sleepers(vec![it - 1, it]));
            single().chain(pairs).collect()
        }
        Places::Points => {
            // Above each sleeper and in the middle of each span.
            let ends = |half: usize| [half / 2, half.div_ceil(2)].map(|it| section.x_m(it));
            let point = |half| Place::Point(0.5 * ends(half).iter().sum::<f64>());
            (0..2 * section.sleepers() - 1).map(point).collect()
        }
        Places::Patterns => {
            let patterns = (2..=5).flat_map(|every| (0..every).map(move |first| (every, first)));
            let pattern = |(every, first)| (first..section.sleepers()).step_by(every).collect();
            patterns.map(pattern).map(Place::Sleepers).collect()
        }
    }
}
