//! How a recording is searched for a kind: at which places, with which parameters, from which values.

use tracktwin_parameters::TrackDesign;

/// How a kind is searched for.
#[derive(Debug)]
pub struct Screening {
    /// What the model of the track is tried with.
    pub families: &'static [Family],
    /// Parameters that are fitted where the passes alone suggest the kind; none where they never do.
    pub suggested: &'static [&'static str],
    /// Why it is neither tried nor suggested.
    pub not_tried: Option<&'static str>,
    /// Whether the track's description states it already, so that it cannot be left out.
    pub is_stated: fn(&TrackDesign) -> bool,
}

/// Candidates of a kind that differ in nothing but their place.
#[derive(Debug)]
pub struct Family {
    /// Where.
    pub places: Places,
    /// Parameters held at a value.
    pub held: &'static [(&'static str, f64)],
    /// Parameters to be fitted, inside their ranges.
    pub free: &'static [&'static str],
    /// Values of the free parameters that screening tries.
    pub trials: Trials,
}

/// The places that a family is tried at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// Everywhere at once: all along the track, at the wheel or in the sensor.
    Everywhere,
    /// Every sleeper.
    Sleepers,
    /// Every sleeper and every pair of neighbours.
    SleepersAndPairs,
    /// Every sleeper and every middle of a span, as points of the rail.
    Points,
    /// Every second, third, fourth and fifth sleeper, each pattern from each of its first sleepers.
    Patterns,
}

/// Values of the free parameters that are tried.
#[derive(Clone, Copy, Debug)]
pub enum Trials {
    /// All combinations of one value from each list, a list a parameter.
    Grid(&'static [&'static [f64]]),
    /// These values, each of all parameters.
    List(&'static [&'static [f64]]),
}

impl Screening {
    /// Tried with these families, and never suggested by the passes alone.
    pub const fn tried(families: &'static [Family]) -> Self {
        Self { families, suggested: &[], not_tried: None, is_stated: |_| false }
    }

    /// Neither tried nor suggested, for this reason.
    pub const fn not_tried(reason: &'static str) -> Self {
        Self { families: &[], suggested: &[], not_tried: Some(reason), is_stated: |_| false }
    }

    /// Not tried on tracks whose description states it.
    #[must_use]
    pub const fn unless_stated(self, is_stated: fn(&TrackDesign) -> bool) -> Self {
        Self { is_stated, ..self }
    }

    /// Suggested by the passes alone, with these parameters to be fitted.
    #[must_use]
    pub const fn suggested(self, free: &'static [&'static str]) -> Self {
        Self { suggested: free, ..self }
    }
}

impl Family {
    /// A family at these places with these parameters free.
    pub const fn new(places: Places, free: &'static [&'static str], trials: Trials) -> Self {
        Self { places, held: &[], free, trials }
    }

    /// With parameters held at a value.
    #[must_use]
    pub const fn held(self, held: &'static [(&'static str, f64)]) -> Self {
        Self { held, ..self }
    }
}

impl Trials {
    /// Every set of values, in the order of the free parameters.
    pub fn values(self) -> Vec<Vec<f64>> {
        match self {
            Self::List(list) => list.iter().map(|values| values.to_vec()).collect(),
            Self::Grid(lists) => lists.iter().fold(vec![Vec::new()], |all, list| {
                all.iter()
                    .flat_map(|head| list.iter().map(|&value| [&head[..], &[value]].concat()))
                    .collect()
            }),
        }
    }
}
