//! Deformation of the rail's cross-section under the wheel.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::model::{ContactOscillator, Vehicle};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "rail_cross_section",
    summary: "the rail's cross-section deforms under the wheel",
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("frequency_Hz", "Hz", "resonance of the cross-section").ranges(
            [6e3, 1.4e4],
            [4e3, 7e3],
            8e3,
        ),
        KindParameter::new("stiffness_N_per_m", "N/m", "local stiffness of the cross-section")
            .ranges([5e8, 3e9], [1e9, 1e10], 1e9),
        KindParameter::new("loss_factor", "1", "loss factor at the resonance")
            .ranges([0.02, 0.2], [0.02, 0.2], 0.05)
            .bound(Bound::NotNegative)
            .or(0.05),
    ],
    look_alikes: &["flexible_axle_box", "sensor_mount_resonance"],
    would_separate: "features up to 8 kHz, or a hammer test on the railhead",
    build: |inputs| {
        Ok(Arc::new(RailCrossSection {
            resonance_rad_s: TAU * inputs.value("frequency_Hz"),
            stiffness_n_m: inputs.value("stiffness_N_per_m"),
            loss_factor: inputs.value("loss_factor"),
        }))
    },
};

/// A compliance `1 / (k (1 - (f/f_c)² + i eta f/f_c))` in series with the contact, wherever the
/// wheel is (mismatch catalogue 16, minimal form; Wu & Thompson 1999).
#[derive(Debug)]
struct RailCrossSection {
    resonance_rad_s: f64,
    stiffness_n_m: f64,
    loss_factor: f64,
}

impl Extension for RailCrossSection {
    fn equip(&self, vehicle: &mut Vehicle) {
        vehicle.oscillators.push(ContactOscillator {
            mass_kg: self.stiffness_n_m / self.resonance_rad_s.powi(2),
            damping_n_s_m: self.loss_factor * self.stiffness_n_m / self.resonance_rad_s,
            stiffness_n_m: self.stiffness_n_m,
            sensed: 0.0,
        });
    }
}
