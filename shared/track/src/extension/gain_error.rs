//! A sensor or amplifier of wrong gain.

use super::{
    Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, Measured, PlaceKind,
    Screening,
};
use num_complex::Complex64;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "gain_error",
    summary: "accelerations are recorded too large or too small by one factor",
    family: EffectFamily::Sensor,
    group: LookAlikeGroup::MeasuringChain,
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[KindParameter::new("factor", "1", "recorded over true acceleration").ranges(
        [0.5, 2.0],
        [0.5, 2.0],
        1.2,
    )],
    look_alikes: &["roughness_spectrum"],
    would_separate: "a calibration of the sensor, or a measurement of the railhead's roughness",
    screening: Screening::not_tried(
        "passes show it by what they have in common, without a model of the track",
    ),
    build: |inputs| Ok(Arc::new(GainError { factor: inputs.value("factor") })),
};

/// A constant factor.
#[derive(Debug)]
struct GainError {
    factor: f64,
}

impl Extension for GainError {
    fn sensor_transfer(&self, _frequency_hz: f64) -> Complex64 {
        Complex64::from(self.factor)
    }

    fn measure(&self, measured: &mut Measured) {
        for value in &mut measured.acceleration_m_s2 {
            *value *= self.factor;
        }
    }
}
