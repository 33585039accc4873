//! An entry of a training set.

use tracktwin_parameters::Case;
use tracktwin_signal::Features;

/// A finished case: its parameters and its features.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryEntry {
    /// The case.
    pub case: Case,
    /// Features, one element per speed of the campaign, by ascending speed.
    pub features: Vec<Features>,
}
