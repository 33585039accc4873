//! An axle box on a spring of its own.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::model::{ContactOscillator, Vehicle};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "flexible_axle_box",
    summary: "part of the unsprung mass, such as the axle box, is held to the wheel by a spring",
    family: EffectFamily::Vehicle,
    group: LookAlikeGroup::Vehicle,
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("mass_kg", "kg", "mass of the axle box, part of the unsprung mass")
            .ranges([2.0, 40.0], [50.0, 500.0], 10.0),
        KindParameter::new("stiffness_N_per_m", "N/m", "stiffness between wheel and axle box")
            .ranges([1e7, 1e9], [2.5e7, 5e9], 4e8),
        KindParameter::new("damping_N_s_per_m", "N s/m", "damping between wheel and axle box")
            .ranges([5e2, 2e4], [1e3, 5e5], 3e3)
            .bound(Bound::NotNegative),
        KindParameter::new(
            SENSOR_ON_WHEEL,
            "1",
            "1 where the sensor moves with the wheel, 0 where it moves with the axle box",
        )
        .ranges([0.0, 1.0], [0.0, 1.0], 0.0)
        .bound(Bound::Choice)
        .or(0.0),
    ],
    look_alikes: &["rail_cross_section", "sensor_mount_resonance"],
    would_separate: "a tap test on wheel and axle box, or a second sensor",
    screening: Screening::tried(&[
        Family::new(Places::Everywhere, FREE, TRIALS),
        Family::new(Places::Everywhere, FREE, TRIALS).held(&[(SENSOR_ON_WHEEL, 1.0)]),
    ]),
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
            sensor_on_wheel: inputs.value(SENSOR_ON_WHEEL) == 1.0,
        }))
    },
};

const SENSOR_ON_WHEEL: &str = "sensor_on_wheel";

const FREE: &[&str] = &["mass_kg", "stiffness_N_per_m", "damping_N_s_per_m"];

/// Resonances a tenth apart, for they are sharp.
const TRIALS: Trials = Trials::Grid(&[
    &[2.0, 6.0, 15.0],
    &[
        1e7, 1.2e7, 1.5e7, 1.9e7, 2.3e7, 2.8e7, 3.5e7, 4.2e7, 5e7, 6.2e7, 7.6e7, 9.4e7, 1.2e8,
        1.4e8, 1.8e8, 2.2e8, 2.7e8, 3.3e8, 4.1e8, 5e8, 6.2e8, 7.6e8, 9.4e8,
    ],
    &[2e3],
]);

/// Two masses `m_1 + m_2 = m_w` with a spring between, the contact on the first and the sensor on
/// one of them.
///
/// The relative motion `r = u_1 - u_2` is an oscillator of the reduced mass `mu = m_1 m_2 / m_w`, driven
/// by `-mu F / m_1`. The contact point is displaced by `q = -r m_2 / m_w`. Written in `q`, all
/// coefficients of the oscillator are multiplied by `(m_w / m_2)²`. A sensor on the second mass measures
/// the motion `u_c + q m_1 / m_2`, a sensor on the first mass `u_c - q`.
#[derive(Debug)]
struct FlexibleAxleBox {
    box_kg: f64,
    stiffness_n_m: f64,
    damping_n_s_m: f64,
    sensor_on_wheel: bool,
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
            sensed: if self.sensor_on_wheel { -1.0 } else { wheel_kg / self.box_kg },
        });
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{instance, track};
    use num_complex::Complex64;
    use std::f64::consts::TAU;

    const BOX_KG: f64 = 10.0;
    const WHEEL_KG: f64 = 34.0;

    #[test]
    fn wheel_and_axle_box_move_as_two_masses_on_a_spring() {
        let (stiffness, damping) = (4e8, 3e3);
        let axle_box = instance("flexible_axle_box").with("mass_kg", BOX_KG);
        let axle_box = axle_box.with("stiffness_N_per_m", stiffness);
        let axle_box = axle_box.with("damping_N_s_per_m", damping);
        let on_wheel = track(&[axle_box.clone().with("sensor_on_wheel", 1.0)]);
        let on_box = track(&[axle_box]);
        for frequency_hz in [50.0, 700.0, 1100.0, 3000.0] {
            let omega = TAU * frequency_hz;
            let spring = Complex64::new(stiffness, omega * damping);
            // Cramer's rule for a unit force upwards on the wheel, displacements downwards.
            let (wheel, axle) =
                (spring - WHEEL_KG * omega * omega, spring - BOX_KG * omega * omega);
            let determinant = wheel * axle - spring * spring;
            let (wheel_up, axle_down) = (axle / determinant, -spring / determinant);
            for (model, motion) in [(&on_box, axle_down), (&on_wheel, -wheel_up)] {
                let (vehicle, sensed) = (model.vehicle(), -omega * omega * motion);
                // Rounding, amplified where both masses nearly cancel.
                let error = (vehicle.receptance(omega) - wheel_up).norm() / wheel_up.norm();
                assert!(error < 1e-9, "{frequency_hz} Hz: {error}");
                let error = (vehicle.acceleration_per_force(omega) - sensed).norm() / sensed.norm();
                assert!(error < 1e-9, "{frequency_hz} Hz: {error}");
            }
        }
    }

    #[test]
    fn a_stiff_axle_box_is_part_of_the_wheel() {
        let axle_box = instance("flexible_axle_box").with("mass_kg", BOX_KG);
        let axle_box = axle_box.with("stiffness_N_per_m", 1e15).with("damping_N_s_per_m", 0.0);
        let (stiff, rigid) = (track(&[axle_box]), track(&[]));
        let omega = TAU * 4000.0;
        let [stiff, rigid] = [stiff, rigid].map(|model| model.vehicle().receptance(omega));
        assert!((stiff / rigid - 1.0).norm() < 1e-3);
    }
}
