//! Findings: results of single tests of a recording.

use std::collections::BTreeMap;

/// Where on the track something was found.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// Everywhere, or not on the track at all.
    Everywhere,
    /// From here to there along the track in m.
    Stretch {
        /// First place in m.
        from_m: f64,
        /// Last place in m.
        to_m: f64,
    },
}

/// One kind of physics, or a fault of the measuring chain, found by one test.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its name in the catalogue, such as `wheel_flat`.
    pub physics: &'static str,
    /// Probability to see as much without it.
    pub p_value: f64,
    /// Where.
    pub place: Place,
    /// Estimated parameters by their catalogue names, each with mean and standard deviation.
    pub parameters: BTreeMap<&'static str, (f64, f64)>,
    /// The sentence a reader sees: what was seen, in numbers.
    pub evidence: String,
}
