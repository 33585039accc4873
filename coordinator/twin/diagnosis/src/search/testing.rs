//! A section and its candidates, for tests.

use crate::bands::Bands;
use crate::candidate::{Candidate, candidates};
use crate::forward::Forward;
use crate::observation::Observation;
use crate::section::Section;
use nalgebra::DMatrix;
use tracktwin_parameters::TrackDesign;
use tracktwin_track::extension::ExtensionInstance;

/// A section of twenty-four sleepers of V-Track, and all its candidates.
pub(super) fn section_with_candidates() -> (Section, Vec<Candidate>) {
    let section = Section::new(TrackDesign::v_track(), 24, 1.0);
    let all = candidates(&section);
    (section, all)
}

/// A section of this many sleepers of V-Track at two speeds, and its exact log powers with an extension on typical
/// supports.
pub(super) fn observed(sleepers: usize, extension: &ExtensionInstance) -> (Forward, Observation) {
    let section = Section::new(TrackDesign::v_track(), sleepers, 1.0);
    let forward = Forward::new(section, Bands::new(100.0, 3300.0), &[7.0, 13.0], vec![0.0; 2]);
    let section = &forward.section;
    let built = section.in_model(extension).build(&section.track.design, section.spans()).unwrap();
    let log_power = forward.log_power(&forward.unknowns.typical(), &[built]).unwrap();
    let covariance = 0.02 * DMatrix::identity(forward.per_sleeper(), forward.per_sleeper());
    let observation = Observation::new(log_power, &covariance, |_| false).unwrap();
    (forward, observation)
}
