//! Sleepers that hang on the rail over a void.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::element::SpringDamper;
use crate::model::{Assembly, ForceLaw, Law, Reaction, Support};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "hanging_sleeper",
    summary: "a sleeper hangs on the rail over a gap and meets its ballast only when it closes",
    classes: &[Class::Frequency, Class::Local, Class::Load, Class::Concentrated],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[KindParameter::new("gap_m", "m", "gap between the unloaded sleeper and ballast")
        .ranges([2e-5, 4e-4], [1e-4, 3e-3], 2e-4)
        .bound(Bound::NotNegative)],
    look_alikes: &["support_variation", "rail_joint"],
    would_separate: "passes with another wheel load: a void closes, soft ballast does not",
    build: |inputs| {
        let gap_m = inputs.value("gap_m");
        Ok(Arc::new(HangingSleeper { sleepers: inputs.sleepers(), gap_m }))
    },
};

/// Further closing in m over which the ballast's damper takes hold, so that the force has no jump
/// that no time step could meet; a hundredth of usual gaps.
const ONSET_M: f64 = 1e-6;

/// Ballast that pushes `k_b (u - g) + c_b u'` where the sleeper has sunk by more than the gap `g`,
/// and never pulls (mismatch catalogue 7; Lundqvist & Dahlberg 2005).
///
/// In the matrices the gap stays open.
#[derive(Debug)]
struct HangingSleeper {
    sleepers: Vec<usize>,
    gap_m: f64,
}

impl Extension for HangingSleeper {
    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            for (port, ballast) in assembly.ballast(index) {
                let linear = SpringDamper { stiffness: 0.0, damping: 0.0 };
                let law = Arc::new(Gap { gap_m: self.gap_m, ballast });
                assembly.add_force_law(ForceLaw { port, linear, law });
            }
            let support = assembly.supports()[index];
            let open = Support { ballast_stiffness: 0.0, ballast_damping: 0.0, ..support };
            assembly.set_support(index, open);
        }
    }
}

/// A spring and damper behind a gap.
#[derive(Debug)]
struct Gap {
    gap_m: f64,
    ballast: SpringDamper,
}

impl Law for Gap {
    fn reaction(&self, displacement_m: f64, velocity_m_s: f64) -> Reaction {
        let closed_m = displacement_m - self.gap_m;
        if closed_m <= 0.0 {
            return Reaction::default();
        }
        let SpringDamper { stiffness, damping } = self.ballast;
        let onset = (closed_m / ONSET_M).min(1.0);
        let force = stiffness * closed_m + onset * damping * velocity_m_s;
        if force <= 0.0 {
            return Reaction::default();
        }
        let onset_slope = if onset < 1.0 { damping * velocity_m_s / ONSET_M } else { 0.0 };
        Reaction { force, stiffness: stiffness + onset_slope, damping: onset * damping }
    }
}
