//! A joint of the rail: a dip of its surface, a loss of its bending stiffness, or both.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "rail_joint",
    summary: "a rail joint: the surface dips and the rail bends more easily",
    classes: &[Class::Frequency, Class::Wavelength, Class::Local, Class::Concentrated],
    place: PlaceKind::Point,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("dip_m", "m", "depth of the dip")
            .ranges([2e-5, 3e-4], [5e-4, 2e-3], 8e-5)
            .bound(Bound::NotNegative)
            .or(0.0),
        KindParameter::new("length_m", "m", "distance over which the dip falls to 1/e")
            .ranges([5e-3, 3e-2], [0.1, 0.5], 1.5e-2)
            .or(1.5e-2),
        KindParameter::new("bending_factor", "1", "what remains of the bending stiffness")
            .ranges([0.1, 0.6], [0.2, 0.5], 0.3)
            .or(1.0),
        KindParameter::new("bending_length_m", "m", "length of the rail that is softened")
            .ranges([1e-2, 8e-2], [0.5, 0.9], 2.5e-2)
            .or(2.5e-2),
    ],
    look_alikes: &["squat", "support_variation", "hanging_sleeper"],
    would_separate: "a slower pass: the dip's part moves with the speed, the bending's does not",
    build: |inputs| {
        let (centre_m, length_m) = (inputs.point_m(), inputs.value("bending_length_m"));
        Ok(Arc::new(RailJoint {
            centre_m,
            dip_m: inputs.value("dip_m"),
            dip_length_m: inputs.value("length_m"),
            softened_m: [centre_m - 0.5 * length_m, centre_m + 0.5 * length_m],
            bending_factor: inputs.value("bending_factor"),
        }))
    },
};

/// Dip `d exp(-|x - x0| / l)`, a kink of angle `2 d / l`, over a rail whose bending stiffness is
/// `beta EI` on a short length (mismatch catalogue 1 to 3; Jenkins 1974).
#[derive(Debug)]
struct RailJoint {
    centre_m: f64,
    dip_m: f64,
    dip_length_m: f64,
    softened_m: [f64; 2],
    bending_factor: f64,
}

impl Extension for RailJoint {
    fn assemble(&self, assembly: &mut Assembly) {
        // A factor of one changes no bit, so that a joint may be a dip alone.
        if self.bending_factor != 1.0 {
            assembly.soften_rail(self.softened_m, self.bending_factor);
        }
    }

    fn profile_m(&self, x_m: f64) -> f64 {
        self.dip_m * (-(x_m - self.centre_m).abs() / self.dip_length_m).exp()
    }
}
