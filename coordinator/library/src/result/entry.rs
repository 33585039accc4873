//! An entry of a training set.

use tracktwin_parameters::Case;
use tracktwin_signal::Features;

/// A finished case: what went in and what came out.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryEntry {
    /// The case.
    pub case: Case,
    /// Features, one a speed of the campaign, by ascending speed.
    pub features: Vec<Features>,
}
