//! What shows in the passes themselves, but has no name in the catalogue.

use super::finding::seen;
use super::{Evidence, FAILED_SHARE};
use crate::outcome::{Hypothesis, Location, UNKNOWN};
use std::collections::BTreeMap;
use tracktwin_inspection::Finding;
use tracktwin_track::extension::{Class, Kind};

impl Evidence<'_> {
    /// A finding without a name is unknown, at its place, unless something other than a shape of
    /// rail or wheel was accepted: another shape's name is not given to it.
    pub(super) fn add_nameless(&self, finding: &Finding, all: &mut Vec<Hypothesis>) {
        let Some(kind) = Kind::from_name(finding.physics).filter(|kind| !kind.measuring_chain)
        else {
            return;
        };
        let location = self.location_of_finding(finding);
        let there = |other: &&mut Hypothesis| {
            is_shape(&other.physics) && meet(location.as_ref(), other.location.as_ref())
        };
        for other in all.iter_mut().filter(there) {
            other.accepted = false;
            other.probability *= FAILED_SHARE;
        }
        if all.iter().any(|other| other.accepted && other.physics != UNKNOWN) {
            return;
        }
        let at_wheel = kind.classes.contains(&Class::WheelAngle);
        let (port, would_separate) = if at_wheel {
            ("wheel_surface", "a look at the wheel's tread, or its measured profile")
        } else {
            ("rail_surface", "a look at the rail at the place, or its measured profile")
        };
        all.retain(|other| other.physics != UNKNOWN);
        all.push(Hypothesis {
            physics: UNKNOWN.to_owned(),
            port: Some(port.to_owned()),
            parameters: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: would_separate.to_owned(),
            ..seen(finding, kind, location)
        });
    }
}

fn is_shape(physics: &str) -> bool {
    Kind::from_name(physics).is_some_and(|kind| kind.classes.contains(&Class::Wavelength))
}

/// Whether two places have a sleeper in common; none is everywhere.
fn meet(one: Option<&Location>, other: Option<&Location>) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return true };
    one.sleepers.iter().any(|sleeper| other.sleepers.contains(sleeper))
}
