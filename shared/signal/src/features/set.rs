//! The named ranges of frequency that make a feature vector.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A feature vector: the logarithmic LWPS in a range of frequency (paper, eq. 9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum FeatureSet {
    /// The global feature, 50 to 4000 Hz.
    #[serde(rename = "GF")]
    Gf,
    /// The first local feature, 400 to 700 Hz.
    #[serde(rename = "LF1")]
    Lf1,
    /// The second local feature, 800 to 1500 Hz.
    #[serde(rename = "LF2")]
    Lf2,
    /// The third local feature, 1500 to 2500 Hz: missing from the printed eq. 9, placed around the
    /// third characteristic frequency of Fig. 3.
    #[serde(rename = "LF3")]
    Lf3,
    /// The fourth local feature, 2500 to 4000 Hz: the printed range without LF3.
    #[serde(rename = "LF4")]
    Lf4,
    /// LF4 as printed, 1500 to 4000 Hz.
    #[serde(rename = "LF4-printed")]
    Lf4Printed,
}

impl FeatureSet {
    /// Every set.
    pub const ALL: [Self; 6] =
        [Self::Gf, Self::Lf1, Self::Lf2, Self::Lf3, Self::Lf4, Self::Lf4Printed];

    /// Name of the set in files, on the command line and in the library.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gf => "GF",
            Self::Lf1 => "LF1",
            Self::Lf2 => "LF2",
            Self::Lf3 => "LF3",
            Self::Lf4 => "LF4",
            Self::Lf4Printed => "LF4-printed",
        }
    }

    /// Lowest and highest frequency in Hz, both included.
    pub const fn range_hz(self) -> [f64; 2] {
        match self {
            Self::Gf => [50.0, 4000.0],
            Self::Lf1 => [400.0, 700.0],
            Self::Lf2 => [800.0, 1500.0],
            Self::Lf3 => [1500.0, 2500.0],
            Self::Lf4 => [2500.0, 4000.0],
            Self::Lf4Printed => [1500.0, 4000.0],
        }
    }

    /// The set with this name, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.name() == name)
    }

    /// Indices of the bins of the set in `frequencies_hz`, which must be ascending.
    pub fn bins(self, frequencies_hz: &[f64]) -> Range<usize> {
        let [low, high] = self.range_hz();
        let first = frequencies_hz.partition_point(|&f| f < low);
        first..frequencies_hz.partition_point(|&f| f <= high).max(first)
    }

    /// The feature vector: the part of `log_power` (one value per frequency) that belongs to the set.
    ///
    /// # Panics
    /// If `log_power` has fewer values than `frequencies_hz`.
    pub fn select<'a>(self, frequencies_hz: &[f64], log_power: &'a [f64]) -> &'a [f64] {
        &log_power[self.bins(frequencies_hz)]
    }
}

impl std::fmt::Display for FeatureSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FeatureDefinition;

    #[test]
    fn sets_take_the_bins_within_their_range() {
        let frequencies = FeatureDefinition::default().frequencies_hz();
        let counts = FeatureSet::ALL.map(|set| set.bins(&frequencies).len());
        // Counted apart from the formula of eq. A.2; about 48 log2(high / low).
        assert_eq!(counts, [304, 39, 44, 35, 33, 68]);
        for set in FeatureSet::ALL {
            let [low, high] = set.range_hz();
            let chosen = set.select(&frequencies, &frequencies);
            assert!(chosen.iter().all(|f| (low..=high).contains(f)), "{set}");
        }
    }

    #[test]
    fn names_are_the_same_in_text_and_in_files() {
        for set in FeatureSet::ALL {
            assert_eq!(FeatureSet::from_name(set.name()), Some(set));
            assert_eq!(serde_json::to_string(&set).unwrap(), format!("\"{set}\""));
        }
    }
}
