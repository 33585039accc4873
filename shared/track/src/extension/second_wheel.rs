//! A second wheel on the same rail.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::model::Vehicle;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "second_wheel",
    summary: "a second wheel on the same rail, which reflects waves",
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[KindParameter::new("distance_m", "m", "how far ahead it runs; negative: behind")
        .ranges([0.2, 3.2], [1.8, 3.0], 0.5)
        .bound(Bound::Any)],
    look_alikes: &["support_variation", "rail_cross_section"],
    would_separate: "a run with the second wheel lifted or at another distance",
    build: |inputs| {
        if inputs.value("distance_m") == 0.0 {
            return Err(inputs.refuse("distance_m", "other than zero"));
        }
        Ok(Arc::new(SecondWheel { distance_m: inputs.value("distance_m") }))
    },
};

/// A wheel of the same mass and load, rigid, at a fixed distance; its contact makes the rail
/// `alpha_xx - alpha_xd² / (alpha_dd + 1/k_H + alpha_w)` under the first (mismatch catalogue 17;
/// Wu & Thompson 2001).
#[derive(Debug)]
struct SecondWheel {
    distance_m: f64,
}

impl Extension for SecondWheel {
    fn equip(&self, vehicle: &mut Vehicle) {
        vehicle.further_wheels_m.push(self.distance_m);
    }
}
