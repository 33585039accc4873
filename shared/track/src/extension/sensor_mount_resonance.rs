//! A sensor whose mounting resonates.

use super::{Class, Extension, Kind, KindParameter, Measured, PlaceKind};
use rustfft::num_complex::Complex64;
use std::sync::Arc;

pub(super) const KIND: Kind =
    Kind {
        physics: "sensor_mount_resonance",
        summary: "the sensor resonates on its mounting",
        classes: &[Class::Frequency, Class::Global],
        place: PlaceKind::Nowhere,
        measuring_chain: true,
        parameters: &[
            KindParameter::new("frequency_Hz", "Hz", "resonance of the sensor on its mounting")
                .ranges([1.5e3, 8e3], [1.5e3, 8e3], 3.2e3),
            KindParameter::new("damping_ratio", "1", "damping over critical damping").ranges(
                [0.01, 0.1],
                [0.01, 0.1],
                0.03,
            ),
        ],
        look_alikes: &["rail_cross_section", "flexible_axle_box"],
        would_separate: "another sensor, another mounting, or the other axes of the same sensor",
        build: |inputs| {
            Ok(Arc::new(SensorMountResonance {
                frequency_hz: inputs.value("frequency_Hz"),
                damping_ratio: inputs.value("damping_ratio"),
            }))
        },
    };

/// The sensor as a mass on a spring and damper, shaken at its foot:
/// `(1 + 2 i zeta r) / (1 - r² + 2 i zeta r)` with `r = f / f_s` (mismatch catalogue 24).
#[derive(Debug)]
struct SensorMountResonance {
    frequency_hz: f64,
    damping_ratio: f64,
}

impl Extension for SensorMountResonance {
    fn sensor_transfer(&self, frequency_hz: f64) -> Complex64 {
        let ratio = frequency_hz / self.frequency_hz;
        let damping = 2.0 * self.damping_ratio * ratio;
        Complex64::new(1.0, damping) / Complex64::new(1.0 - ratio * ratio, damping)
    }

    fn measure(&self, measured: &mut Measured) {
        measured.filter(|frequency_hz| self.sensor_transfer(frequency_hz));
    }
}
