//! A section and its candidates, for tests.

use crate::candidate::{Candidate, candidates};
use crate::section::Section;
use tracktwin_parameters::TrackDesign;

/// A section of twenty-four sleepers of V-Track, and all its candidates.
pub(super) fn section_with_candidates() -> (Section, Vec<Candidate>) {
    let section = Section::new(TrackDesign::v_track(), 24, 1.0);
    let all = candidates(&section);
    (section, all)
}
