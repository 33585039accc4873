//! How the diagnosis searches a recording for a kind: places, free parameters and trial values.

use tracktwin_parameters::TrackDesign;

/// How the diagnosis searches a recording for a kind.
#[derive(Debug)]
pub struct Screening {
    /// Families of candidates that the screening evaluates.
    pub families: &'static [Family],
    /// Parameters that are fitted if the passes suggest the kind without a track model. Empty if the
    /// passes never suggest the kind.
    pub suggested: &'static [&'static str],
    /// Reason why the kind is neither screened nor suggested.
    pub not_tried: Option<&'static str>,
    /// Whether the track description already contains the kind. Such a kind cannot be left-out physics.
    pub is_stated: fn(&TrackDesign) -> bool,
}

/// Candidates of a kind that differ only in their place.
#[derive(Debug)]
pub struct Family {
    /// Places of the candidates.
    pub places: Places,
    /// Parameters with a fixed value.
    pub held: &'static [(&'static str, f64)],
    /// Parameters that are fitted within their ranges.
    pub free: &'static [&'static str],
    /// Values of the free parameters that the screening evaluates.
    pub trials: Trials,
}

/// Places at which the screening evaluates a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// No single place: the whole track, the wheel or the sensor.
    Everywhere,
    /// Every sleeper.
    Sleepers,
    /// Every sleeper and every pair of neighbours.
    SleepersAndPairs,
    /// Every sleeper and every middle of a span, as points of the rail.
    Points,
    /// Every second, third, fourth and fifth sleeper. Each pattern is tested from each possible first
    /// sleeper.
    Patterns,
}

/// Values of the free parameters that the screening evaluates.
#[derive(Clone, Copy, Debug)]
pub enum Trials {
    /// All combinations of one value from each list, with one list per parameter.
    Grid(&'static [&'static [f64]]),
    /// These sets of values, each with one value per parameter.
    List(&'static [&'static [f64]]),
}

impl Screening {
    /// The kind is screened with these families. The passes alone never suggest the kind.
    pub const fn tried(families: &'static [Family]) -> Self {
        Self { families, suggested: &[], not_tried: None, is_stated: |_| false }
    }

    /// The kind is neither screened nor suggested, for this reason.
    pub const fn not_tried(reason: &'static str) -> Self {
        Self { families: &[], suggested: &[], not_tried: Some(reason), is_stated: |_| false }
    }

    /// The kind is not screened on tracks whose description already contains the kind.
    #[must_use]
    pub const fn unless_stated(self, is_stated: fn(&TrackDesign) -> bool) -> Self {
        Self { is_stated, ..self }
    }

    /// The passes alone can suggest the kind. These parameters are then fitted.
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

    /// Sets parameters with a fixed value.
    #[must_use]
    pub const fn held(self, held: &'static [(&'static str, f64)]) -> Self {
        Self { held, ..self }
    }
}

impl Trials {
    /// Every set of values, each in the order of the free parameters.
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
