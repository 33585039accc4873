//! Findings of an inspection whose kind is not in the catalogue.

use super::finding::{probability_of, seen};
use super::{Evidence, FAILED_SHARE};
use crate::estimate::Estimate;
use crate::outcome::{Hypothesis, UNKNOWN, meet};
use crate::patch_scan::Fixed;
use std::collections::BTreeMap;
use tracktwin_inspection::Finding;
use tracktwin_track::extension::{Class, EffectFamily, Kind};

/// Largest probability by chance of a patch that is reported.
const PATCH_ALARM: f64 = 0.01;

/// Standard deviation of the frequency or wavelength of a patch, relative: half the distance of two bands.
const BAND_WIDTH: f64 = 0.06;

impl Evidence<'_> {
    /// Adds a finding of a missing kind as unknown physics at its location, unless an extension other than
    /// a shape of rail or wheel was accepted. A shape of another kind at this location is rejected.
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
        let (port, family, would_separate) = if at_wheel {
            let tread = "an inspection or a profile measurement of the wheel's tread";
            ("wheel_surface", EffectFamily::UnknownWheel, tread)
        } else {
            let rail = "an inspection or a profile measurement of the rail at the place";
            ("rail_surface", EffectFamily::UnknownSurface, rail)
        };
        all.retain(|other| other.physics != UNKNOWN);
        all.push(Hypothesis {
            physics: UNKNOWN.to_owned(),
            family: Some(family.name().to_owned()),
            port: Some(port.to_owned()),
            parameters: BTreeMap::new(),
            assumed: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: would_separate.to_owned(),
            ..seen(finding, kind, location)
        });
    }
}

impl Evidence<'_> {
    /// Adds a visible patch of the final residual as unknown physics with its family, if nothing was
    /// accepted.
    pub(super) fn add_patch(&self, all: &mut Vec<Hypothesis>) {
        let Some((patch, p_value)) = &self.search.patch else { return };
        if *p_value > PATCH_ALARM || all.iter().any(|known| known.accepted) {
            return;
        }
        let sleepers: Vec<usize> = patch.sleepers.clone().collect();
        let (port, family, would_separate) = match patch.fixed {
            Fixed::Wavelength(_) => {
                let rail = "an inspection or a profile measurement of the rail at the place";
                ("rail_surface", EffectFamily::UnknownSurface, rail)
            }
            Fixed::Frequency(_) => {
                let hammer = "a hammer test at the place, above and between the sleepers";
                ("rail_seat", EffectFamily::UnknownStructure, hammer)
            }
        };
        let parameters = match patch.fixed {
            Fixed::Wavelength(length_m) => ("wavelength_m", length_m),
            Fixed::Frequency(frequency_hz) => ("frequency_Hz", frequency_hz),
        };
        let estimate = Estimate { mean: parameters.1, sd: BAND_WIDTH * parameters.1 };
        all.retain(|known| known.physics != UNKNOWN);
        all.push(Hypothesis {
            physics: UNKNOWN.to_owned(),
            family: Some(family.name().to_owned()),
            family_probability: probability_of(*p_value),
            probability: probability_of(*p_value),
            accepted: true,
            location: Some(self.location(&sleepers)),
            port: Some(port.to_owned()),
            behaviour: None,
            parameters: BTreeMap::from([(parameters.0.to_owned(), estimate)]),
            assumed: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: would_separate.to_owned(),
            detectability: patch.deviations,
            log_evidence: 0.5 * patch.deviations.powi(2),
        });
    }
}

fn is_shape(physics: &str) -> bool {
    Kind::from_name(physics).is_some_and(|kind| kind.classes.contains(&Class::Wavelength))
}
