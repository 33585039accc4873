//! Railpads that are stiffer the faster they are loaded.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::element::SpringDamper;
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "frequency_dependent_railpad",
    summary: "railpads that relax: stiffer at high than at low frequency",
    family: EffectFamily::Fastening,
    group: LookAlikeGroup::Fastening,
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("stiffness_ratio", "1", "what relaxes, over the railpad's stiffness")
            .ranges([0.2, 3.0], [0.2, 3.0], 1.0),
        KindParameter::new("relaxation_time_s", "s", "time in which it relaxes").ranges(
            [2e-5, 1e-3],
            [1e-4, 5e-3],
            1e-4,
        ),
        KindParameter::new("second_stiffness_ratio", "1", "the same of a second branch")
            .ranges([0.0, 3.0], [0.0, 3.0], 0.0)
            .bound(Bound::NotNegative)
            .or(0.0),
        KindParameter::new("second_relaxation_time_s", "s", "relaxation time of a second branch")
            .ranges([2e-5, 1e-3], [1e-4, 5e-3], 5e-4)
            .or(1e-3),
    ],
    look_alikes: &["rail_cross_section", "load_dependent_railpad"],
    would_separate: "a hundred spans, or recordings at two temperatures",
    screening: Screening::tried(&[Family::new(
        Places::Everywhere,
        &["stiffness_ratio", "relaxation_time_s"],
        Trials::Grid(&[&[0.5, 1.5, 3.0], &[3e-5, 1e-4, 3e-4, 1e-3]]),
    )]),
    build: |inputs| {
        Ok(Arc::new(FrequencyDependentRailpad {
            sleepers: inputs.sleepers(),
            branches: [
                ["stiffness_ratio", "relaxation_time_s"],
                ["second_stiffness_ratio", "second_relaxation_time_s"],
            ]
            .map(|[ratio, time]| Branch {
                stiffness_ratio: inputs.value(ratio),
                relaxation_time_s: inputs.value(time),
            }),
        }))
    },
};

/// One or two Maxwell branches beside spring and damper of the railpad:
/// `k_0 + sum k_n i w tau_n / (1 + i w tau_n)` with `k_n` a multiple of `k_0` (standard linear solid;
/// generalised Maxwell model).
#[derive(Debug)]
struct FrequencyDependentRailpad {
    sleepers: Vec<usize>,
    branches: [Branch; 2],
}

/// A spring and a damper in series.
#[derive(Debug)]
struct Branch {
    stiffness_ratio: f64,
    relaxation_time_s: f64,
}

impl Extension for FrequencyDependentRailpad {
    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            for branch in self.branches.iter().filter(|branch| branch.stiffness_ratio > 0.0) {
                let railpad = assembly.supports()[index].railpad_stiffness;
                let stiffness = branch.stiffness_ratio * railpad;
                let damping = branch.relaxation_time_s * stiffness;
                // How far the damper of the branch is pressed together; the spring takes the rest.
                let dashpot = assembly.append_dof();
                let spring = assembly.layout().railpad_port(index).minus(&dashpot);
                assembly.add_spring_damper(&spring, SpringDamper { stiffness, damping: 0.0 });
                assembly.add_spring_damper(&dashpot, SpringDamper { stiffness: 0.0, damping });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        FREQUENCIES_HZ, assert_felt_alike_in_both_solvers, direct_receptance, instance,
        relative_distance, track, track_on,
    };
    use crate::frequency::ReceptancePoint;
    use crate::model::Support;
    use tracktwin_parameters::ParameterSet;

    fn relaxing(time_s: f64) -> Vec<num_complex::Complex64> {
        let pads = instance("frequency_dependent_railpad").with("stiffness_ratio", 0.5);
        direct_receptance(
            &track(&[pads.with("relaxation_time_s", time_s)]),
            ReceptancePoint::Rail(0.75),
        )
    }

    /// The branches of a railpad are multiples of what is left of it.
    #[test]
    fn the_order_of_a_list_does_not_matter() {
        let relaxing = instance("frequency_dependent_railpad")
            .with("stiffness_ratio", 1.0)
            .with("relaxation_time_s", 3e-4);
        let missing = instance("missing_railpad").on([5]).with("stiffness_N_per_m", 1e7);
        let of = |all: &[_]| direct_receptance(&track(all), ReceptancePoint::Rail(0.75));
        assert_eq!(of(&[relaxing.clone(), missing.clone()]), of(&[missing, relaxing]));
    }

    #[test]
    fn a_pad_that_relaxes_at_once_is_the_plain_one() {
        let plain = direct_receptance(&track(&[]), ReceptancePoint::Rail(0.75));
        // Omega tau is 2e-6 at the highest frequency.
        assert!(relative_distance(&relaxing(1e-10), &plain) < 1e-5);
        // At rest it is the plain one in any case.
        let at_rest = relative_distance(&relaxing(1e-3)[..1], &plain[..1]);
        assert!(at_rest < 1e-9, "{at_rest}");
    }

    #[test]
    fn a_pad_that_never_relaxes_has_both_stiffnesses() {
        let mut support = Support::from(&ParameterSet::nominal());
        support.railpad_stiffness *= 1.5;
        let stiffer = direct_receptance(&track_on(support, &[]), ReceptancePoint::Rail(0.75));
        // From 120 Hz on: omega tau is above 7e5.
        let error = relative_distance(&relaxing(1e3)[1..], &stiffer[1..]);
        assert!(error < 1e-5, "{error}");
        assert_eq!(FREQUENCIES_HZ[0], 0.0);
    }

    #[test]
    fn two_equal_branches_are_one_of_both_stiffnesses() {
        let pads = |ratio: f64| {
            let pads = instance("frequency_dependent_railpad").with("relaxation_time_s", 2e-4);
            pads.with("stiffness_ratio", ratio)
        };
        let two = pads(0.5).with("second_stiffness_ratio", 0.3);
        let two = track(&[two.with("second_relaxation_time_s", 2e-4)]);
        let of = |model| direct_receptance(model, ReceptancePoint::Rail(0.75));
        assert!(relative_distance(&of(&two), &of(&track(&[pads(0.8)]))) < 1e-9);
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let pads = instance("frequency_dependent_railpad").with("stiffness_ratio", 1.0);
        assert_felt_alike_in_both_solvers(&pads.with("relaxation_time_s", 1e-4));
    }
}
