//! Clamps that hold the rail at some sleepers.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::element::SpringDamper;
use crate::model::{Assembly, Port};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "fastening_clamp",
    summary: "clamps at some sleepers hold the rail down and against rotation",
    family: EffectFamily::Fastening,
    group: LookAlikeGroup::Fastening,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("vertical_N_per_m", "N/m", "stiffness beside the railpad")
            .ranges([1e7, 1.5e8], [5e5, 2e6], 1.5e8)
            .bound(Bound::NotNegative)
            .or(0.0),
        KindParameter::new("rotational_N_m_per_rad", "N m/rad", "stiffness against rotation")
            .ranges([1e4, 3e5], [1e6, 1e8], 1e5)
            .bound(Bound::NotNegative)
            .or(0.0),
    ],
    look_alikes: &["support_variation"],
    would_separate: "25 or more spans: the clamps come back every few sleepers",
    screening: Screening::tried(&[
        Family::new(Places::Patterns, &FREE, TRIALS),
        Family::new(Places::Sleepers, &FREE, TRIALS),
    ]),
    build: |inputs| {
        Ok(Arc::new(FasteningClamp {
            sleepers: inputs.sleepers(),
            vertical_n_m: inputs.value("vertical_N_per_m"),
            rotational_n_m_rad: inputs.value("rotational_N_m_per_rad"),
        }))
    },
};

const FREE: [&str; 2] = ["vertical_N_per_m", "rotational_N_m_per_rad"];
const TRIALS: Trials = Trials::Grid(&[&[3e7, 1.5e8], &[3e4, 3e5]]);

/// Springs between rail and rail seat, and against the rail's rotation over the sleeper, which
/// itself does not tilt.
#[derive(Debug)]
struct FasteningClamp {
    sleepers: Vec<usize>,
    vertical_n_m: f64,
    rotational_n_m_rad: f64,
}

impl Extension for FasteningClamp {
    fn assemble(&self, assembly: &mut Assembly) {
        let spring = |stiffness| SpringDamper { stiffness, damping: 0.0 };
        for &index in &self.sleepers {
            let railpad = assembly.layout().railpad_port(index);
            assembly.add_spring_damper(&railpad, spring(self.vertical_n_m));
            let node = assembly.layout().sleepers()[index].rail_node;
            let rotation = assembly.layout().rail_node_dofs(node)[1];
            let port: Port = rotation.map(|dof| (dof, 1.0)).into_iter().collect();
            assembly.add_spring_damper(&port, spring(self.rotational_n_m_rad));
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
    fn a_vertical_clamp_is_more_stiffness_of_the_railpad() {
        let clamps = instance("fastening_clamp").with("vertical_N_per_m", 5e7);
        let mut support = Support::from(&ParameterSet::nominal());
        let clamped = direct_receptance(&track(&[clamps]), ReceptancePoint::Rail(0.8));
        support.railpad_stiffness += 5e7;
        let stiffer = direct_receptance(&track_on(support, &[]), ReceptancePoint::Rail(0.8));
        // Sums in another order.
        assert!(relative_distance(&clamped, &stiffer) < 1e-9);
    }

    #[test]
    fn a_clamp_against_rotation_is_not_felt_above_it_but_beside_it() {
        // The track is symmetric about sleeper 5 at 0.75 m, where the rail does not rotate.
        let clamp = instance("fastening_clamp").on([5]).with("rotational_N_m_per_rad", 3e5);
        let (with, without) = (track(&[clamp]), track(&[]));
        let felt = |x_m: f64| {
            let place = ReceptancePoint::Rail(x_m);
            relative_distance(&direct_receptance(&with, place), &direct_receptance(&without, place))
        };
        assert!(felt(0.75) < 1e-9, "{}", felt(0.75));
        assert!(felt(0.8125) > 0.01, "{}", felt(0.8125));
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let clamps = instance("fastening_clamp").on([3, 5]).with("rotational_N_m_per_rad", 3e5);
        assert_felt_alike_in_both_solvers(&clamps.with("vertical_N_per_m", 1.5e8));
    }
}
