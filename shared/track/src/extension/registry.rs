//! The registry of all kinds of extension.

use super::Kind;
use std::sync::OnceLock;

/// All kinds, physics first, the measuring chain last.
pub(super) static KINDS: &[Kind] = &[
    super::rail_joint::KIND,
    super::squat::KIND,
    super::corrugation::KIND,
    super::roughness_spectrum::KIND,
    super::contact_patch_filter::KIND,
    super::wheel_flat::KIND,
    super::wheel_out_of_round::KIND,
    super::second_wheel::KIND,
    super::flexible_axle_box::KIND,
    super::fastening_clamp::KIND,
    super::missing_railpad::KIND,
    super::load_dependent_railpad::KIND,
    super::frequency_dependent_railpad::KIND,
    super::sleeper_bolt::KIND,
    super::hanging_sleeper::KIND,
    super::cracked_sleeper::KIND,
    super::subgrade_layer::KIND,
    super::support_variation::KIND,
    super::rail_cross_section::KIND,
    super::sensor_mount_resonance::KIND,
    super::clipping::KIND,
    super::position_error::KIND,
    super::gain_error::KIND,
    super::electrical_hum::KIND,
];

/// A kind that a test adds.
pub(super) static ADDED: OnceLock<&'static Kind> = OnceLock::new();

// Kinds that code names: those that the passes of a recording show by themselves, and those that need a rule
// of their own.
/// Clipping.
pub static CLIPPING: &Kind = &super::clipping::KIND;
/// Position error.
pub static POSITION_ERROR: &Kind = &super::position_error::KIND;
/// Gain error.
pub static GAIN_ERROR: &Kind = &super::gain_error::KIND;
/// Electrical hum.
pub static ELECTRICAL_HUM: &Kind = &super::electrical_hum::KIND;
/// Wheel flat.
pub static WHEEL_FLAT: &Kind = &super::wheel_flat::KIND;
/// Wheel out of round.
pub static WHEEL_OUT_OF_ROUND: &Kind = &super::wheel_out_of_round::KIND;
/// Cracked sleeper.
pub static CRACKED_SLEEPER: &Kind = &super::cracked_sleeper::KIND;
/// Layer of subgrade.
pub static SUBGRADE_LAYER: &Kind = &super::subgrade_layer::KIND;
/// Clamps that hold the rail at some sleepers.
pub static FASTENING_CLAMP: &Kind = &super::fastening_clamp::KIND;
/// Flexible axle box.
pub static FLEXIBLE_AXLE_BOX: &Kind = &super::flexible_axle_box::KIND;
/// Resonance of the sensor on its mounting.
pub static SENSOR_MOUNT_RESONANCE: &Kind = &super::sensor_mount_resonance::KIND;
/// Corrugation.
pub static CORRUGATION: &Kind = &super::corrugation::KIND;
/// Squat.
pub static SQUAT: &Kind = &super::squat::KIND;
/// Rail joint.
pub static RAIL_JOINT: &Kind = &super::rail_joint::KIND;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::{Bound, ExtensionInstance, PlaceKind, Screening};
    use crate::model::{Mesh, Support, TrackModel};
    use std::collections::HashSet;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPANS: usize = 12;

    /// An extension with typical values at a place in the middle of the track.
    fn typical(kind: &Kind) -> ExtensionInstance {
        let instance = ExtensionInstance::new(kind.physics);
        let instance = match kind.place {
            PlaceKind::Nowhere => instance,
            PlaceKind::Point => instance.at([0.8, 0.8]),
            PlaceKind::Stretch => instance.at([0.6, 0.9]),
            PlaceKind::Sleepers => instance.on([4, 5]),
        };
        let named = kind.parameters.iter().filter(|parameter| parameter.typical != 0.0);
        named.fold(instance, |instance, parameter| instance.with(parameter.name, parameter.typical))
    }

    #[test]
    fn every_kind_builds_a_track_at_its_typical_values() {
        let design = TrackDesign::v_track();
        let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
        let mesh = Mesh::uniform(SPANS, 4, 4);
        for kind in Kind::all() {
            let extension = typical(kind).build(&design, SPANS);
            let extension = extension.unwrap_or_else(|error| panic!("{error}"));
            TrackModel::build(&design, &mesh, &supports, &[extension]).unwrap();
        }
    }

    #[test]
    fn names_are_unique_and_look_alikes_exist() {
        let names: HashSet<_> = Kind::all().map(|kind| kind.physics).collect();
        assert_eq!(names.len(), KINDS.len());
        for kind in Kind::all() {
            for other in kind.look_alikes {
                assert!(names.contains(other) && other != &kind.physics, "{}", kind.physics);
            }
        }
    }

    #[test]
    fn every_kind_is_searched_for_or_says_why_not() {
        for kind in Kind::all() {
            let Screening { families, suggested, not_tried, .. } = &kind.screening;
            let is_searched = !families.is_empty() || !suggested.is_empty();
            assert!(is_searched != not_tried.is_some_and(|it| !it.is_empty()), "{}", kind.physics);
            let has = |name: &&str| kind.parameter(name).is_some();
            assert!(suggested.iter().all(has), "{}", kind.physics);
            for family in *families {
                assert!(family.free.iter().all(has), "{}", kind.physics);
                assert!(family.held.iter().all(|(name, _)| has(name)), "{}", kind.physics);
                for trial in family.trials.values() {
                    assert_eq!(trial.len(), family.free.len(), "{}", kind.physics);
                }
            }
        }
    }

    #[test]
    fn typical_values_lie_inside_their_ranges_and_bounds() {
        for kind in Kind::all() {
            for parameter in kind.parameters {
                let [low, high] = parameter.v_track;
                let inside = (low..=high).contains(&parameter.typical);
                assert!(inside, "{} {}", kind.physics, parameter.name);
                let zero = parameter.typical == 0.0 && parameter.bound == Bound::Positive;
                assert!(zero || parameter.bound.holds(parameter.typical), "{}", parameter.name);
            }
        }
    }

    #[test]
    fn defaults_have_the_scale_of_the_track() {
        let default = |kind: &Kind, name, ratio| kind.parameter(name).unwrap().default_at(ratio);
        assert_eq!(default(RAIL_JOINT, "length_m", 1.0), Some(2e-2));
        // Two thirds of the way from 5 mm to 4 cm, and from 0.1 m to 0.5 m.
        let on_line = default(RAIL_JOINT, "length_m", 4.8).unwrap();
        assert!((on_line - 0.1 * 5f64.powf(2.0 / 3.0)).abs() < 1e-12, "{on_line}");
        // What changes nothing on the rig changes nothing on a line.
        assert_eq!(default(RAIL_JOINT, "dip_m", 4.8), Some(0.0));
        assert_eq!(default(RAIL_JOINT, "bending_factor", 4.8), Some(1.0));
        assert_eq!(default(ELECTRICAL_HUM, "frequency_Hz", 4.8), Some(50.0));
    }

    #[test]
    fn the_catalogue_in_the_documentation_has_every_kind_and_parameter() {
        let catalogue = include_str!("../../../../docs/extensions.md");
        for kind in Kind::all() {
            for parameter in kind.parameters {
                let row = format!("| `{}` | `{}` |", kind.physics, parameter.name);
                assert!(catalogue.contains(&row), "{row}");
            }
            assert!(catalogue.contains(&format!("\n| `{}` | ", kind.physics)));
        }
    }

    #[test]
    fn an_instance_survives_json_with_its_parameters_beside_its_name() {
        for kind in Kind::all() {
            let instance = typical(kind);
            let json = serde_json::to_value(&instance).unwrap();
            for (name, value) in &instance.parameters {
                assert_eq!(json[name], *value);
            }
            assert_eq!(serde_json::from_value::<ExtensionInstance>(json).unwrap(), instance);
        }
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let refusal = |instance: ExtensionInstance| {
            instance.build(&TrackDesign::v_track(), SPANS).unwrap_err().to_string()
        };
        assert!(refusal(ExtensionInstance::new("loose_bolt")).contains("sleeper_bolt"));
        let bolt = ExtensionInstance::new("sleeper_bolt");
        assert!(refusal(bolt.clone()).contains("needs stiffness_N_per_m"));
        assert!(refusal(bolt.clone().with("stiffness", 1.0)).contains("has no parameter"));
        let bolt = bolt.with("stiffness_N_per_m", 1e7);
        assert!(refusal(bolt.clone().with("stiffness_N_per_m", -1.0)).contains("more than zero"));
        assert!(refusal(bolt.clone().on([3, 2])).contains("sleepers = [numbers, ascending]"));
        assert!(refusal(bolt.on([11])).contains("no sleeper SN12; it has SN1 to SN11 "));
        let joint = ExtensionInstance::new("rail_joint").with("dip_m", 1e-4);
        assert!(refusal(joint.clone()).contains("a point of the rail"));
        assert!(refusal(joint.at([1.6, 1.6])).contains("track of 1.5 m"));
    }
}
