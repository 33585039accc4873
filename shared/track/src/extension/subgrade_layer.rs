//! A layer below the ballast that moves.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::element::SpringDamper;
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind =
    Kind {
        physics: "subgrade_layer",
        summary: "the ballast rests on a mass with a spring and damper of its own",
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
/// (mismatch catalogue 9 and 15; Zhai et al. 2004 without shear between neighbours).
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
            for (port, ballast) in assembly.ballast(index) {
                assembly.add_spring_damper(&port, ballast.share(-1.0));
                assembly.add_spring_damper(&port.minus(&layer), ballast);
            }
        }
    }
}
