//! A layer below the ballast that moves.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::element::SpringDamper;
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind =
    Kind {
        physics: "subgrade_layer",
        summary: "the ballast rests on a mass with a spring and damper of its own",
        family: EffectFamily::Support,
        group: LookAlikeGroup::Support,
        classes: &[Class::Frequency, Class::Global],
        place: PlaceKind::Sleepers,
        measuring_chain: false,
        parameters: &[
            KindParameter::new("mass_kg", "kg", "mass under a half sleeper").ranges(
                [0.3, 4.0],
                [40.0, 600.0],
                3.0,
            ),
            KindParameter::new("stiffness_N_per_m", "N/m", "stiffness under a half sleeper")
                .ranges([1e7, 1e8], [5e7, 5e8], 6e7),
            KindParameter::new("damping_N_s_per_m", "N s/m", "damping under a half sleeper")
                .ranges([2e2, 5e3], [1e4, 1e5], 2e3)
                .bound(Bound::NotNegative),
        ],
        look_alikes: &["support_variation", "hanging_sleeper"],
        would_separate: "a hammer test of a sleeper between 100 and 500 Hz",
        screening: Screening::tried(&[
            Family::new(
                Places::Sleepers,
                &["mass_kg", "stiffness_N_per_m", "damping_N_s_per_m"],
                Trials::Grid(&[&[0.5, 2.0], &[1.5e7, 5e7], &[1e3]]),
            ),
            Family::new(
                Places::Everywhere,
                &["mass_kg", "stiffness_N_per_m", "damping_N_s_per_m"],
                Trials::Grid(&[&[0.5, 1.5, 4.0], &[1.5e7, 3e7, 6e7, 1e8], &[5e2, 2e3]]),
            ),
        ]),
        build: |inputs| {
            Ok(Arc::new(SubgradeLayer {
                sleepers: inputs.sleepers(),
                mass_kg: inputs.value("mass_kg"),
                ground: SpringDamper {
                    stiffness: inputs.value("stiffness_N_per_m"),
                    damping: inputs.value("damping_N_s_per_m"),
                },
            }))
        },
    };

/// One rigid mass under each half sleeper: all of the ballast stands on it, and it on the ground
/// (Zhai et al. 2004 without shear between neighbours).
#[derive(Debug)]
struct SubgradeLayer {
    sleepers: Vec<usize>,
    mass_kg: f64,
    ground: SpringDamper,
}

impl Extension for SubgradeLayer {
    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            let layer = assembly.append_dof();
            assembly.add_mass(&layer, self.mass_kg);
            assembly.add_spring_damper(&layer, self.ground);
            assembly.stand_ballast_on(index, layer);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::ExtensionInstance;
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, direct_receptance, instance, relative_distance, track,
        track_on,
    };
    use crate::frequency::ReceptancePoint;
    use crate::model::Support;
    use tracktwin_parameters::ParameterSet;

    fn layer(mass_kg: f64, stiffness: f64) -> ExtensionInstance {
        let layer = instance("subgrade_layer").with("mass_kg", mass_kg);
        layer.with("stiffness_N_per_m", stiffness).with("damping_N_s_per_m", 2e3)
    }

    #[test]
    fn a_layer_as_hard_as_the_ground_is_none() {
        let with = direct_receptance(&track(&[layer(1e-9, 1e16)]), ReceptancePoint::Rail(0.8));
        let without = direct_receptance(&track(&[]), ReceptancePoint::Rail(0.8));
        // The ballast is a thousand-millionth of the layer's stiffness.
        assert!(relative_distance(&with, &without) < 1e-6);
    }

    #[test]
    fn the_order_of_extensions_on_one_sleeper_does_not_matter() {
        let gap = instance("hanging_sleeper").on([5]).with("gap_m", 1.0);
        let pads = instance("load_dependent_railpad").with("exponent", 0.4);
        let soft = instance("missing_railpad").on([5]).with("stiffness_N_per_m", 1e7);
        for [one, other] in [[layer(3.0, 6e7), gap], [pads, soft]] {
            let felt = |order: &[ExtensionInstance]| {
                direct_receptance(&track(order), ReceptancePoint::Rail(0.75))
            };
            let [there, back] = [felt(&[one.clone(), other.clone()]), felt(&[other.clone(), one])];
            assert!(relative_distance(&there, &back) < 1e-9, "{other:?}");
        }
    }

    #[test]
    fn an_open_gap_over_a_layer_leaves_nothing_to_the_ground() {
        let gap = instance("hanging_sleeper").on([5]).with("gap_m", 1.0);
        let gap = gap.with("damping_share", 0.0);
        let felt =
            |of: &[ExtensionInstance]| direct_receptance(&track(of), ReceptancePoint::Rail(0.75));
        let over_layer = felt(&[layer(3.0, 6e7).on([5]), gap.clone()]);
        assert!(relative_distance(&over_layer, &felt(&[gap])) < 1e-9);
    }

    #[test]
    fn a_standing_load_finds_ballast_and_layer_in_series() {
        let rigid =
            Support { sleeper_bending_stiffness: 5e9, ..Support::from(&ParameterSet::nominal()) };
        let ballast_stiffness = 1.0 / (1.0 / rigid.ballast_stiffness + 1.0 / 6e7);
        let series = Support { ballast_stiffness, ..rigid };
        let layered =
            direct_receptance(&track_on(rigid, &[layer(3.0, 6e7)]), ReceptancePoint::Rail(0.75));
        let series = direct_receptance(&track_on(series, &[]), ReceptancePoint::Rail(0.75));
        // The sleeper bends by a millionth of what it sinks.
        assert!(relative_distance(&layered[..1], &series[..1]) < 1e-5);
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        assert_felt_alike_in_both_solvers(&layer(3.0, 6e7));
    }
}
