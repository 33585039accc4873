//! An axle box on a spring of its own.

use super::{Bound, Class, Extension, Kind, KindParameter, PlaceKind};
use crate::model::{ContactOscillator, Vehicle};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "flexible_axle_box",
    summary: "part of the unsprung mass, with the sensor, is held to the wheel by a spring",
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("mass_kg", "kg", "mass of the axle box, part of the unsprung mass")
            .ranges([2.0, 40.0], [100.0, 500.0], 10.0),
        KindParameter::new("stiffness_N_per_m", "N/m", "stiffness between wheel and axle box")
            .ranges([5e7, 1e9], [2.5e8, 5e9], 4e8),
        KindParameter::new("damping_N_s_per_m", "N s/m", "damping between wheel and axle box")
            .ranges([5e2, 2e4], [1e4, 5e5], 3e3)
            .bound(Bound::NotNegative),
    ],
    look_alikes: &["rail_cross_section", "sensor_mount_resonance"],
    would_separate: "a tap test on wheel and axle box, or a second sensor",
    build: |inputs| {
        let total = inputs.design.wheel.mass_kg;
        let box_kg = inputs.value("mass_kg");
        if box_kg >= total {
            return Err(inputs.refuse("mass_kg", "less than the unsprung mass"));
        }
        Ok(Arc::new(FlexibleAxleBox {
            box_kg,
            stiffness_n_m: inputs.value("stiffness_N_per_m"),
            damping_n_s_m: inputs.value("damping_N_s_per_m"),
        }))
    },
};

/// Two masses `m_1 + m_2 = m_w` with a spring between, the contact on the first and the sensor on
/// the second (mismatch catalogue 22).
///
/// Their relative motion `r = u_1 - u_2` is an oscillator of its own, of the reduced mass
/// `mu = m_1 m_2 / m_w`, driven by `-mu F / m_1`. In terms of `q = -r m_2 / m_w`, by which the
/// contact gives way, all its coefficients are multiplied by `(m_w / m_2)²`; the sensor feels
/// `u_c + q m_1 / m_2`.
#[derive(Debug)]
struct FlexibleAxleBox {
    box_kg: f64,
    stiffness_n_m: f64,
    damping_n_s_m: f64,
}

impl Extension for FlexibleAxleBox {
    fn equip(&self, vehicle: &mut Vehicle) {
        let total_kg = vehicle.wheel.mass_kg;
        let wheel_kg = total_kg - self.box_kg;
        let scale = (total_kg / self.box_kg).powi(2);
        vehicle.oscillators.push(ContactOscillator {
            mass_kg: scale * wheel_kg * self.box_kg / total_kg,
            damping_n_s_m: scale * self.damping_n_s_m,
            stiffness_n_m: scale * self.stiffness_n_m,
            sensed: wheel_kg / self.box_kg,
        });
    }
}
