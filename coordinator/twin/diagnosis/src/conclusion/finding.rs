//! Findings of an inspection as hypotheses, in addition to those of the model.

use super::{Evidence, FAILED_SHARE, NAMED_SHARE, names};
use crate::estimate::Estimate;
use crate::outcome::{Hypothesis, Location, UNKNOWN, meet};
use crate::section::are_most;
use std::collections::BTreeMap;
use tracktwin_inspection::Finding;
use tracktwin_track::extension::{Class, Kind, LookAlikeGroup, PlaceKind};

/// Distance in sleeper spacings within which the signature of an accepted extension may resemble a finding.
const REACH_SPANS: f64 = 3.0;

/// Odds of an effect of a kind that an inspection finds, before the recording was seen.
const ODDS_BEFORE: f64 = 0.1;

/// Smallest p-value that is believed: the tails of the tests are not known further out.
const P_MIN: f64 = 1e-6;

/// Parameter of waves on the rail.
const WAVELENGTH: &str = "wavelength_m";

impl Evidence<'_> {
    /// Adds a finding of the inspection as a separate hypothesis, unless the search with the model also
    /// found it.
    pub(super) fn add_finding(&self, finding: &Finding, all: &mut Vec<Hypothesis>) {
        let Some(kind) = Kind::from_name(finding.physics) else { return };
        let probability = probability(finding);
        let location = self.location_of_finding(finding);
        let reach_m = REACH_SPANS * self.prepared.forward.section.track.design.sleeper.spacing_m;
        let is_same = |known: &Hypothesis| {
            let place = known.location.as_ref();
            known.physics == finding.physics && are_near(place, location.as_ref(), reach_m)
        };
        let same = all.iter_mut().filter(|known| is_same(known));
        // Of several accepted ones the finding is of the nearest.
        let distance_m =
            |known: &Hypothesis| distance_m(known.location.as_ref(), location.as_ref());
        let nearest = same.min_by(|a, b| {
            b.accepted.cmp(&a.accepted).then(distance_m(a).total_cmp(&distance_m(b)))
        });
        if let Some(known) = nearest {
            known.probability = known.probability.max(probability);
            if known.accepted {
                take_wavelength(known, finding);
                return;
            }
        }
        let shown = seen(finding, kind, location.clone());
        let accepted = &self.search.accepted;
        let is_fitted =
            |physics: &str| accepted.iter().any(|candidate| candidate.kind.physics == physics);
        if share_with_fitted(shown, is_fitted, self.probability_max(), all) {
            return;
        }
        let sleepers = self.prepared.forward.section.sleepers();
        let explained = !kind.measuring_chain
            && all.iter().any(|known| {
                explains(known, kind, location.as_ref(), reach_m)
                    && !(kind.group == LookAlikeGroup::RailDefect && is_even(known, sleepers))
            });
        all.retain(|known| known.accepted || !is_same(known));
        if !explained {
            // The name that came near it is right after all, and what the wheel does everywhere, which was not
            // fitted, is nothing else that acts everywhere.
            let at_wheel = kind.classes.contains(&Class::WheelAngle);
            let is_it = |known: &&mut Hypothesis| {
                let comes_near = known.look_alikes.iter().any(|it| it == finding.physics);
                known.physics == UNKNOWN && (comes_near || at_wheel && known.location.is_none())
            };
            for unknown in all.iter_mut().filter(is_it) {
                unknown.accepted = false;
                unknown.probability *= FAILED_SHARE;
            }
        }
        all.push(Hypothesis {
            probability: if explained { probability.min(0.5) } else { probability },
            accepted: !explained,
            ..seen(finding, kind, location)
        });
    }
}

/// If the model explains a defect of the rail by another kind than the passes show there, each method can be wrong:
/// divides the probability of both, at most `most`, between the two kinds. Returns whether it did. `is_fitted` tells
/// of a kind whether the model contains it.
fn share_with_fitted(
    shown: Hypothesis,
    is_fitted: impl Fn(&str) -> bool,
    most: f64,
    all: &mut Vec<Hypothesis>,
) -> bool {
    let group = |known: &Hypothesis| Kind::from_name(&known.physics).map(|it| it.group);
    let is_there = |known: &Hypothesis| meet(known.location.as_ref(), shown.location.as_ref());
    let is_alternative =
        |known: &Hypothesis| !known.accepted && known.physics == shown.physics && is_there(known);
    let explains_it = |known: &&mut Hypothesis| {
        known.accepted
            && is_fitted(&known.physics)
            && known.physics != shown.physics
            && group(known) == Some(LookAlikeGroup::RailDefect)
            && is_there(known)
    };
    if group(&shown) != Some(LookAlikeGroup::RailDefect) {
        return false;
    }
    let before: f64 =
        all.iter().filter(|it| is_alternative(it)).map(|known| known.probability).sum();
    let Some(fitted) = all.iter_mut().find(explains_it) else { return false };
    let whole = (fitted.probability + before).min(most);
    fitted.probability = NAMED_SHARE * whole;
    all.retain(|known| !is_alternative(known));
    all.push(Hypothesis { probability: (1.0 - NAMED_SHARE) * whole, accepted: false, ..shown });
    true
}

/// Takes the wavelength of a finding if it is known better than the fitted one: the passes resolve a line, the
/// fit has six bands per octave.
fn take_wavelength(known: &mut Hypothesis, finding: &Finding) {
    let fitted = known.parameters.get_mut(WAVELENGTH);
    if let (Some(fitted), Some(&(mean, sd))) = (fitted, finding.parameters.get(WAVELENGTH))
        && sd < fitted.sd
    {
        *fitted = Estimate { mean, sd };
    }
}

/// Whether a hypothesis is the same under three in four of a section's sleepers or more. It explains no shape at one place.
fn is_even(known: &Hypothesis, sleepers: usize) -> bool {
    let acts_on_sleepers =
        Kind::from_name(&known.physics).is_some_and(|kind| kind.place == PlaceKind::Sleepers);
    let is_on_most = known.location.as_ref().is_none_or(|it| are_most(it.sleepers.len(), sleepers));
    acts_on_sleepers && is_on_most
}

/// Whether an accepted extension explains a finding of this kind at a location. It explains neither a
/// finding beyond the reach of its signature nor one that repeats with every turn of the wheel.
fn explains(known: &Hypothesis, kind: &Kind, place: Option<&Location>, reach_m: f64) -> bool {
    let at_wheel = |kind: &Kind| kind.classes.contains(&Class::WheelAngle);
    let known_at_wheel = Kind::from_name(&known.physics).is_some_and(at_wheel);
    known.accepted
        && known.physics != UNKNOWN
        && (known_at_wheel || !at_wheel(kind))
        && are_near(known.location.as_ref(), place, reach_m)
}

/// Whether two locations are at most `reach_m` apart.
fn are_near(one: Option<&Location>, other: Option<&Location>, reach_m: f64) -> bool {
    distance_m(one, other) <= reach_m
}

/// Distance of two locations in m, zero if they overlap; `None` is everywhere.
fn distance_m(one: Option<&Location>, other: Option<&Location>) -> f64 {
    let (Some(one), Some(other)) = (one, other) else { return 0.0 };
    (one.x_m[0] - other.x_m[1]).max(other.x_m[0] - one.x_m[1]).max(0.0)
}

/// A finding as an accepted hypothesis with its probability.
pub(super) fn seen(finding: &Finding, kind: &Kind, location: Option<Location>) -> Hypothesis {
    let estimate =
        |(&name, &(mean, sd)): (&&str, &(f64, f64))| (name.to_owned(), Estimate { mean, sd });
    Hypothesis {
        physics: finding.physics.to_owned(),
        family: Some(kind.family.name().to_owned()),
        family_probability: probability(finding),
        probability: probability(finding),
        accepted: true,
        location,
        port: None,
        behaviour: None,
        parameters: finding.parameters.iter().map(estimate).collect(),
        assumed: BTreeMap::new(),
        look_alikes: names(kind),
        would_separate: kind.would_separate.to_owned(),
        detectability: 0.0,
        log_evidence: -finding.p_value.ln(),
    }
}

/// Probability of a finding.
pub(super) fn probability(finding: &Finding) -> f64 {
    probability_of(finding.p_value)
}

/// Probability of what a test found, an upper limit: the evidence of a p-value is at most `1 / (-e p ln p)` times that
/// of chance (Sellke, Bayarri & Berger 2001, The American Statistician 55).
pub(super) fn probability_of(p_value: f64) -> f64 {
    let p_value = p_value.clamp(P_MIN, (-1_f64).exp());
    let odds = ODDS_BEFORE / (-std::f64::consts::E * p_value * p_value.ln());
    odds / (1.0 + odds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_at_the_limit_of_its_test_is_likely_and_not_sure() {
        // 1 / (-e p ln p) is 29.6 at 0.002: odds of 2.96.
        assert!((probability_of(0.002) - 2.96 / 3.96).abs() < 1e-3, "{}", probability_of(0.002));
        assert!(probability_of(1e-4) > 0.97 && probability_of(1e-9) > 0.999);
        assert!((probability_of(0.9) - ODDS_BEFORE / (1.0 + ODDS_BEFORE)).abs() < 1e-12);
    }

    #[test]
    fn of_two_wavelengths_the_better_known_one_is_stated() {
        let mut known = Hypothesis::accepted("corrugation", None);
        let fitted = Estimate { mean: 0.047, sd: 1e-4 };
        known.parameters.insert(WAVELENGTH.to_owned(), fitted);
        let mut finding = Finding {
            physics: "corrugation",
            p_value: 1e-9,
            place: tracktwin_inspection::Place::Everywhere,
            parameters: BTreeMap::from([("wavelength_m", (0.045, 2e-4))]),
            evidence: String::new(),
        };
        take_wavelength(&mut known, &finding);
        assert_eq!(known.parameters[WAVELENGTH], fitted);
        finding.parameters.insert(WAVELENGTH, (0.045, 5e-5));
        take_wavelength(&mut known, &finding);
        assert_eq!(known.parameters[WAVELENGTH], Estimate { mean: 0.045, sd: 5e-5 });
    }

    #[test]
    fn where_fit_and_passes_disagree_about_a_shape_no_name_is_sure() {
        let at = |ids: [&str; 2]| Location {
            x_m: [1.0, 1.0],
            sleepers: ids.map(str::to_owned).to_vec(),
        };
        let fitted = Hypothesis {
            probability: 1.0,
            ..Hypothesis::accepted("squat", Some(at(["SN12", "SN13"])))
        };
        let shown = |ids| Hypothesis::accepted("rail_joint", Some(at(ids)));
        let mut all = vec![fitted];
        let share = |ids, fitted, all: &mut _| {
            share_with_fitted(shown(ids), |physics| physics == fitted, 0.97, all)
        };
        assert!(!share(["SN20", "SN21"], "squat", &mut all));
        assert!(!share(["SN12", "SN13"], "rail_joint", &mut all));
        // A second finding of the same shape changes nothing.
        for _ in 0..2 {
            assert!(share(["SN12", "SN13"], "squat", &mut all));
            let [squat, joint] = &all[..] else { panic!("{all:?}") };
            assert!(squat.accepted && !joint.accepted);
            assert!((squat.probability - 0.6305).abs() < 1e-9, "{}", squat.probability);
            assert!((joint.probability - 0.3395).abs() < 1e-9, "{}", joint.probability);
        }
    }

    #[test]
    fn an_effect_explains_what_is_found_beside_it_and_not_what_is_found_far_away() {
        let at = |x_m: f64| Location { x_m: [x_m, x_m], sleepers: Vec::new() };
        let mut void = Hypothesis::accepted("hanging_sleeper", Some(at(3.375)));
        let joint = Kind::from_name("rail_joint").unwrap();
        let flat = Kind::from_name("wheel_flat").unwrap();
        assert!(explains(&void, joint, Some(&at(3.2)), 0.375));
        assert!(!explains(&void, joint, Some(&at(1.81)), 0.375));
        assert!(!explains(&void, flat, None, 0.375));
        void.location = None;
        assert!(explains(&void, joint, Some(&at(1.81)), 0.375));
        void.accepted = false;
        assert!(!explains(&void, joint, Some(&at(1.81)), 0.375));
        // Bolts under all of three sleepers are even, under one of them not; a flat has no sleepers.
        void.physics = "sleeper_bolt".to_owned();
        assert!(is_even(&void, 3));
        let under = |sleepers: &[&str]| Location {
            x_m: [0.0, 1.0],
            sleepers: sleepers.iter().map(|&id| id.to_owned()).collect(),
        };
        void.location = Some(under(&["SN1", "SN2", "SN3"]));
        assert!(is_even(&void, 3));
        void.location = Some(under(&["SN2"]));
        assert!(!is_even(&void, 3));
        (void.location, void.physics) = (None, "wheel_flat".to_owned());
        assert!(!is_even(&void, 3));
    }
}
