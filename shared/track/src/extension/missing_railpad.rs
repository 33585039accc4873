//! Railpads that are missing or worn out.

use super::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind, Places,
    Screening, Stage, Trials,
};
use crate::model::{Assembly, Support};
use std::sync::Arc;
use tracktwin_parameters::Parameter;

pub(super) const KIND: Kind = Kind {
    physics: "missing_railpad",
    summary: "a railpad is missing or has lost most of its stiffness",
    family: EffectFamily::Fastening,
    group: LookAlikeGroup::Fastening,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[KindParameter::new("stiffness_N_per_m", "N/m", "what stiffness remains")
        .ranges([5e6, 2e7], [2e7, 6e7], 1e7)
        // What carries more is a soft railpad, not a missing one.
        .slack(0.4)
        .replaces(Parameter::RailpadStiffness)],
    look_alikes: &["support_variation", "load_dependent_railpad", "cracked_sleeper"],
    would_separate: "a second speed, or a hammer test of the sleeper",
    screening: Screening::tried(&[Family::new(
        Places::Sleepers,
        &["stiffness_N_per_m"],
        Trials::Grid(&[&[5e6, 1.5e7]]),
    )]),
    build: |inputs| {
        let stiffness_n_m = inputs.value("stiffness_N_per_m");
        Ok(Arc::new(MissingRailpad { sleepers: inputs.sleepers(), stiffness_n_m }))
    },
};

/// A changed stiffness of some railpads. Their damping changes in proportion.
#[derive(Debug)]
struct MissingRailpad {
    sleepers: Vec<usize>,
    stiffness_n_m: f64,
}

impl Extension for MissingRailpad {
    fn stage(&self) -> Stage {
        Stage::Statement
    }

    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            let support = assembly.supports()[index];
            let remains = self.stiffness_n_m / support.railpad_stiffness;
            let railpad_damping = remains * support.railpad_damping;
            let railpad_stiffness = self.stiffness_n_m;
            let changed = Support { railpad_stiffness, railpad_damping, ..support };
            assembly.set_support(index, changed);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, direct_receptance, instance, relative_distance, track,
        track_on,
    };
    use crate::frequency::ReceptancePoint;
    use crate::model::Support;
    use tracktwin_parameters::ParameterSet;

    #[test]
    fn without_all_its_pads_the_track_is_one_on_soft_pads() {
        let missing = instance("missing_railpad").with("stiffness_N_per_m", 1e7);
        let soft = Support::from(&ParameterSet::nominal());
        let railpad_damping = soft.railpad_damping * 1e7 / soft.railpad_stiffness;
        let soft = Support { railpad_stiffness: 1e7, railpad_damping, ..soft };
        let missing = direct_receptance(&track(&[missing]), ReceptancePoint::Rail(0.75));
        let soft = direct_receptance(&track_on(soft, &[]), ReceptancePoint::Rail(0.75));
        // What is taken out again cancels up to rounding.
        assert!(relative_distance(&missing, &soft) < 1e-9);
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let missing = instance("missing_railpad").on([4]).with("stiffness_N_per_m", 1e7);
        assert_felt_alike_in_both_solvers(&missing);
    }
}
