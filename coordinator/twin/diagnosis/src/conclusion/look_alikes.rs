//! Probability divided between a name and what looks like it.

use super::round::ORDER;
use super::{NAMED_SHARE, names};
use crate::outcome::{Hypothesis, UNKNOWN, meet};
use crate::port_scan::PortPlace;
use std::collections::BTreeMap;
use tracktwin_track::extension::{
    CORRUGATION, EffectFamily, FASTENING_CLAMP, FLEXIBLE_AXLE_BOX, Kind, LookAlikeGroup,
    SENSOR_MOUNT_RESONANCE, SUBGRADE_LAYER, WHEEL_OUT_OF_ROUND,
};

/// Divides the probability of a rail shape that only the inspection detected among the kinds of its group.
/// Without a fit the group is more certain than the kind: a rail joint may have a reduced bending
/// stiffness, or only a dip. If kinds of the group that the search fitted and did not accept have more than their share,
/// all of them keep their ratio.
pub(super) fn add_siblings(hypotheses: &mut Vec<Hypothesis>, fitted: &[&str]) {
    let accepted: Vec<_> = hypotheses.iter().filter(|it| it.accepted).cloned().collect();
    for named in accepted {
        let kind = Kind::from_name(&named.physics);
        let Some(kind) = kind.filter(|it| it.group == LookAlikeGroup::RailDefect) else { continue };
        if fitted.contains(&kind.physics) {
            continue;
        }
        let is_sibling = |other: &Hypothesis| {
            other.physics != named.physics
                && Kind::from_name(&other.physics).is_some_and(|it| it.group == kind.group)
                && meet(other.location.as_ref(), named.location.as_ref())
        };
        let known: Vec<&Hypothesis> = hypotheses.iter().filter(|it| is_sibling(it)).collect();
        let theirs: f64 = known.iter().map(|it| it.probability).sum();
        let whole = named.probability;
        if known.iter().any(|it| it.accepted) {
            continue;
        }
        if theirs >= (1.0 - NAMED_SHARE) * whole {
            for it in hypotheses.iter_mut().filter(|it| **it == named || is_sibling(it)) {
                it.probability *= whole / (whole + theirs);
            }
            continue;
        }
        let others = kind.look_alikes.iter().filter_map(|name| Kind::from_name(name));
        let others: Vec<_> = others.filter(|other| other.group == kind.group).collect();
        if others.is_empty() {
            continue;
        }
        hypotheses.retain(|it| !is_sibling(it));
        for it in hypotheses.iter_mut().filter(|it| **it == named) {
            it.probability = NAMED_SHARE * whole;
        }
        hypotheses.extend(others.iter().map(|other| Hypothesis {
            physics: other.physics.to_owned(),
            family: Some(other.family.name().to_owned()),
            probability: (1.0 - NAMED_SHARE) * whole / others.len() as f64,
            accepted: false,
            parameters: BTreeMap::new(),
            assumed: BTreeMap::new(),
            look_alikes: names(other),
            would_separate: other.would_separate.to_owned(),
            ..named.clone()
        }));
    }
}

/// Divides the probability of an accepted flexible axle box, or resonance of the sensor, between it and a mode of the
/// wheel's disc. All are a mass on a spring between the contact and the sensor, and the catalogue has no mode of the
/// disc. A name that already shares its probability with the other one keeps it.
pub(super) fn add_wheel_mode(hypotheses: &mut Vec<Hypothesis>) {
    let is_alike = |it: &&mut Hypothesis| {
        let kinds = [FLEXIBLE_AXLE_BOX.physics, SENSOR_MOUNT_RESONANCE.physics];
        it.accepted && it.probability > NAMED_SHARE && kinds.contains(&it.physics.as_str())
    };
    let Some(named) = hypotheses.iter_mut().find(is_alike) else { return };
    let mode = Hypothesis {
        family: Some(EffectFamily::UnknownWheel.name().to_owned()),
        accepted: false,
        ..unknown_like(named, &PortPlace::Wheel, 1.0 - NAMED_SHARE)
    };
    named.probability *= NAMED_SHARE;
    hypotheses.push(mode);
}

/// Largest number of sleepers at which a kind that usually acts at more of them looks like something that no kind
/// describes. A subgrade does not change from one sleeper to the next: an absorber on the rail has the signature of a
/// layer under one. Clamps come back every few sleepers: a link between two sleepers looks like a clamp at one or both.
fn lone_max(physics: &str) -> usize {
    if physics == SUBGRADE_LAYER.physics {
        1
    } else if physics == FASTENING_CLAMP.physics {
        2
    } else {
        0
    }
}

/// Divides the probability of an accepted kind at fewer sleepers than it usually has ([`lone_max`]) between it and an unknown
/// element there. The unknown element comes first; the kind stays in the model. A weaker effect that was found at these
/// sleepers beside it is not more certain than it.
pub(super) fn add_unknown_of_lone(hypotheses: &mut Vec<Hypothesis>, unknown_max: f64) {
    let is_lone = |it: &Hypothesis| {
        let sleepers = it.location.as_ref().map_or(0, |place| place.sleepers.len());
        it.accepted && (1..=lone_max(&it.physics)).contains(&sleepers)
    };
    let mut added = Vec::new();
    for lone in hypotheses.iter_mut().filter(|it| is_lone(it)) {
        let mut unknown = unknown_like(lone, &PortPlace::Seats(Vec::new()), NAMED_SHARE);
        unknown.probability = unknown.probability.min(unknown_max);
        added.push(unknown);
        lone.probability *= 1.0 - NAMED_SHARE;
    }
    let all: Vec<Hypothesis> = hypotheses.iter().filter(|it| is_lone(it)).cloned().collect();
    for other in hypotheses.iter_mut().filter(|it| it.accepted && !is_lone(it)) {
        let beside = all.iter().filter(|lone| {
            other.location == lone.location && other.log_evidence < lone.log_evidence
        });
        other.probability = beside.fold(other.probability, |most, it| most.min(it.probability));
    }
    hypotheses.extend(added);
}

/// Divides the probability of an accepted order of the wheel between it and corrugation of the whole rail, if no two
/// passes at one speed differ by the order. Waves of the rail lie near a high order more often by chance: `by_chance`
/// is that probability for the number of an order, `None` if passes differ by it.
pub(super) fn add_rail_waves(
    hypotheses: &mut Vec<Hypothesis>,
    by_chance: impl Fn(usize) -> Option<f64>,
) {
    let is_order = |it: &Hypothesis| it.accepted && it.physics == WHEEL_OUT_OF_ROUND.physics;
    let Some(named) = hypotheses.iter_mut().find(|it| is_order(it)) else { return };
    let number = named.parameters.get(ORDER).map(|order| order.mean as usize);
    let Some(by_chance) = number.and_then(by_chance) else { return };
    let share = by_chance / (1.0 + by_chance);
    let waves = Hypothesis {
        physics: CORRUGATION.physics.to_owned(),
        family: Some(CORRUGATION.family.name().to_owned()),
        probability: share * named.probability,
        accepted: false,
        parameters: BTreeMap::new(),
        assumed: BTreeMap::new(),
        look_alikes: names(CORRUGATION),
        would_separate: named.would_separate.clone(),
        ..named.clone()
    };
    named.probability *= 1.0 - share;
    hypotheses.push(waves);
}

/// Unknown physics that acts as this hypothesis does, with a share of its probability.
fn unknown_like(named: &Hypothesis, port: &PortPlace, share: f64) -> Hypothesis {
    Hypothesis {
        physics: UNKNOWN.to_owned(),
        probability: share * named.probability,
        port: Some(port.name().to_owned()),
        parameters: BTreeMap::new(),
        assumed: BTreeMap::new(),
        look_alikes: vec![named.physics.clone()],
        ..named.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::Estimate;
    use crate::outcome::Location;

    fn layer(sleepers: &[&str]) -> Hypothesis {
        let sleepers = sleepers.iter().map(|id| (*id).to_owned()).collect();
        let place = Location { x_m: [1.0, 1.0], sleepers };
        Hypothesis { probability: 0.96, ..Hypothesis::accepted("subgrade_layer", Some(place)) }
    }

    #[test]
    fn a_resonance_of_the_sensor_may_be_a_mode_of_the_wheel() {
        let named = |probability| Hypothesis {
            probability,
            ..Hypothesis::accepted("sensor_mount_resonance", None)
        };
        let mut sure = vec![named(0.97)];
        add_wheel_mode(&mut sure);
        let [sensor, mode] = &sure[..] else { panic!("{sure:?}") };
        assert!((sensor.probability - 0.6305).abs() < 1e-9 && sensor.accepted);
        assert!((mode.probability - 0.3395).abs() < 1e-9 && !mode.accepted);
        assert_eq!((mode.physics.as_str(), mode.port.as_deref()), (UNKNOWN, Some("wheel")));
        // An axle box has its share already.
        let mut shared = vec![named(0.57)];
        add_wheel_mode(&mut shared);
        assert_eq!(shared.len(), 1);
    }

    #[test]
    fn an_order_by_which_no_passes_differ_may_be_corrugation_of_the_whole_rail() {
        let order = Estimate { mean: 30.0, sd: 0.0 };
        let mut known = Hypothesis::accepted("wheel_out_of_round", None);
        known.probability = 0.97;
        known.parameters.insert(ORDER.to_owned(), order);
        let mut turned = vec![known.clone()];
        add_rail_waves(&mut turned, |_| None);
        assert_eq!(turned, [known.clone()]);
        let mut same = vec![known];
        add_rail_waves(&mut same, |number| Some(0.01 * number as f64));
        let [wheel, rail] = &same[..] else { panic!("{same:?}") };
        assert!((wheel.probability - 0.97 / 1.3).abs() < 1e-9 && wheel.accepted);
        assert!((rail.probability - 0.97 * 0.3 / 1.3).abs() < 1e-9 && !rail.accepted);
        assert_eq!((rail.physics.as_str(), rail.parameters.len()), ("corrugation", 0));
    }

    #[test]
    fn a_layer_under_one_sleeper_is_first_of_all_a_mass_on_a_spring() {
        let mut one = vec![layer(&["SN8"])];
        add_unknown_of_lone(&mut one, 0.97);
        let [layer_again, unknown] = &one[..] else { panic!("{one:?}") };
        assert!((unknown.probability - 0.624).abs() < 1e-9 && unknown.accepted);
        assert!((layer_again.probability - 0.336).abs() < 1e-9 && layer_again.accepted);
        assert_eq!(unknown.physics, UNKNOWN);
        assert_eq!(unknown.family, layer_again.family);
        let bolt = Hypothesis { log_evidence: 40.0, ..layer(&["SN8"]) };
        let bolt = Hypothesis { physics: "sleeper_bolt".to_owned(), ..bolt };
        let elsewhere = Hypothesis { location: layer(&["SN9"]).location, ..bolt.clone() };
        let strong = Hypothesis { log_evidence: 170.0, ..layer(&["SN8"]) };
        let mut beside = vec![bolt, elsewhere, strong];
        add_unknown_of_lone(&mut beside, 0.97);
        assert!((beside[0].probability - 0.336).abs() < 1e-9 && beside[1].probability == 0.96);
        let mut run = vec![layer(&["SN8", "SN9"])];
        add_unknown_of_lone(&mut run, 0.97);
        assert_eq!(run.len(), 1);
        let clamps = |sleepers| {
            let place = layer(sleepers).location;
            let mut all = vec![Hypothesis::accepted("fastening_clamp", place)];
            add_unknown_of_lone(&mut all, 0.97);
            all.len()
        };
        assert_eq!([clamps(&["SN8", "SN9"]), clamps(&["SN8", "SN9", "SN12"])], [2, 1]);
    }

    #[test]
    fn a_shape_that_only_the_passes_show_is_shared_with_a_kind_that_the_fit_rejected() {
        let at = |x_m: f64| Some(Location { x_m: [x_m, x_m], sleepers: vec!["SN40".to_owned()] });
        let squat = Hypothesis { probability: 0.97, ..Hypothesis::accepted("squat", at(24.7)) };
        let joint = |probability, x_m| Hypothesis {
            probability,
            accepted: false,
            ..Hypothesis::accepted("rail_joint", at(x_m))
        };
        for known in [vec![], vec![joint(0.003, 24.9)]] {
            let mut all = [vec![squat.clone()], known].concat();
            add_siblings(&mut all, &[]);
            let [named, other] = &all[..] else { panic!("{all:?}") };
            assert!((named.probability - 0.6305).abs() < 1e-9 && named.physics == "squat");
            assert!((other.probability - 0.3395).abs() < 1e-9 && other.physics == "rail_joint");
        }
        let mut likely = vec![squat.clone(), joint(0.4, 24.9)];
        add_siblings(&mut likely, &[]);
        let shares = [&likely[0], &likely[1]].map(|it| it.probability);
        assert!((shares[0] + shares[1] - 0.97).abs() < 1e-9, "{shares:?}");
        assert!((shares[0] / shares[1] - 0.97 / 0.4).abs() < 1e-9, "{shares:?}");
        let mut of_a_fit = vec![squat];
        add_siblings(&mut of_a_fit, &["squat"]);
        assert_eq!(of_a_fit.len(), 1);
    }
}
