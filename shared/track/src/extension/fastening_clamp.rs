//! Clamps that hold the rail at some sleepers.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::element::SpringDamper;
use crate::model::{Assembly, Port};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "fastening_clamp",
    summary: "clamps at some sleepers hold the rail down and against rotation",
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
    build: |inputs| {
        Ok(Arc::new(FasteningClamp {
            sleepers: inputs.sleepers(),
            vertical_n_m: inputs.value("vertical_N_per_m"),
            rotational_n_m_rad: inputs.value("rotational_N_m_per_rad"),
        }))
    },
};

/// Springs between rail and rail seat, and against the rail's rotation over the sleeper, which
/// itself does not tilt (mismatch catalogue 10).
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
