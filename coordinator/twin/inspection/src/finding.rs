//! Findings: results of single tests of a recording.

use std::collections::BTreeMap;

/// Position of a finding on the track.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// Everywhere, or not on the track.
    Everywhere,
    /// A stretch along the track in m.
    Stretch {
        /// First position in m.
        from_m: f64,
        /// Last position in m.
        to_m: f64,
    },
}

/// Result of a positive test: a kind of physics, or a fault of the measuring chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Name of the kind in the catalogue, such as `wheel_flat`.
    pub physics: &'static str,
    /// False-alarm rate: probability of such a result without this kind.
    pub p_value: f64,
    /// Position on the track.
    pub place: Place,
    /// Estimated parameters by their catalogue names, each with mean and standard deviation.
    pub parameters: BTreeMap<&'static str, (f64, f64)>,
    /// Measured quantities as a sentence.
    pub evidence: String,
}

impl Finding {
    /// The finding as a sentence.
    pub fn sentence(&self) -> String {
        format!("The passes alone show {}: {}.", self.physics, self.evidence)
    }
}
