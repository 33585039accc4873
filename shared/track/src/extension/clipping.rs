//! A sensor or converter at the end of its range.

use super::{Class, Extension, Kind, KindParameter, Measured, PlaceKind};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "clipping",
    summary: "accelerations beyond a limit are recorded as the limit",
    classes: &[Class::Noise],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[KindParameter::new("limit_m_s2", "m/s2", "largest acceleration of either sign")
        .ranges([5.0, 500.0], [50.0, 5000.0], 50.0)],
    look_alikes: &["gain_error"],
    would_separate: "a sensor of larger range",
    build: |inputs| Ok(Arc::new(Clipping { limit_m_s2: inputs.value("limit_m_s2") })),
};

/// The nearest value within `-limit` to `limit`.
#[derive(Debug)]
struct Clipping {
    limit_m_s2: f64,
}

impl Extension for Clipping {
    fn measure(&self, measured: &mut Measured) {
        for value in &mut measured.acceleration_m_s2 {
            *value = value.clamp(-self.limit_m_s2, self.limit_m_s2);
        }
    }
}
