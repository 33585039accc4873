//! Railpads that are missing or worn out.

use super::{Class, Extension, Kind, KindParameter, PlaceKind};
use crate::model::{Assembly, Support};
use std::sync::Arc;

pub(super) const KIND: Kind =
    Kind {
        physics: "missing_railpad",
        summary: "a railpad is missing or has lost most of its stiffness",
        classes: &[Class::Frequency, Class::Local],
        place: PlaceKind::Sleepers,
        measuring_chain: false,
        parameters: &[KindParameter::new("stiffness_N_per_m", "N/m", "what stiffness remains")
            .ranges([5e6, 2e7], [2e7, 6e7], 1e7)],
        look_alikes: &["support_variation", "load_dependent_railpad"],
        would_separate: "a second speed, or a hammer test of the sleeper",
        build: |inputs| {
            let stiffness_n_m = inputs.value("stiffness_N_per_m");
            Ok(Arc::new(MissingRailpad { sleepers: inputs.sleepers(), stiffness_n_m }))
        },
    };

/// Another stiffness of some railpads; their damping changes in proportion (mismatch catalogue 5).
#[derive(Debug)]
struct MissingRailpad {
    sleepers: Vec<usize>,
    stiffness_n_m: f64,
}

impl Extension for MissingRailpad {
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
