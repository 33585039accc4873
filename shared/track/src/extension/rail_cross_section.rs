//! Deformation of the rail's cross-section under the wheel.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::model::{ContactOscillator, Vehicle};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "rail_cross_section",
    summary: "the rail's cross-section deforms under the wheel",
    family: EffectFamily::RailBending,
    group: LookAlikeGroup::RailSection,
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
    screening: Screening::tried(&[Family::new(
        Places::Everywhere,
        &["frequency_Hz", "stiffness_N_per_m"],
        Trials::Grid(&[&[6e3, 8e3, 1.1e4], &[5e8, 1e9, 2e9]]),
    )]),
    build: |inputs| {
        Ok(Arc::new(RailCrossSection {
            resonance_rad_s: TAU * inputs.value("frequency_Hz"),
            stiffness_n_m: inputs.value("stiffness_N_per_m"),
            loss_factor: inputs.value("loss_factor"),
        }))
    },
};

/// A compliance `1 / (k (1 - (f/f_c)² + i eta f/f_c))` in series with the contact, wherever the
/// wheel is (Wu & Thompson 1999).
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

#[cfg(test)]
mod tests {
    use crate::extension::testing::{FREQUENCIES_HZ, instance, pass_at, track};
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{HertzContact, Surface, TrackModel};
    use crate::time;
    use num_complex::Complex64;
    use std::f64::consts::TAU;

    #[test]
    fn the_contact_gives_way_by_one_over_its_stiffness_and_resonates() {
        let section = instance("rail_cross_section").with("frequency_Hz", 8e3);
        let model = track(&[section.with("stiffness_N_per_m", 1e9).with("loss_factor", 0.05)]);
        let local =
            |frequency_hz: f64| model.vehicle().oscillators[0].receptance(TAU * frequency_hz);
        assert!((local(0.0) - 1e-9).norm() < 1e-18);
        assert!((local(8e3) * Complex64::new(0.0, 5e7) - 1.0).norm() < 1e-9);
        assert_eq!(model.vehicle().acceleration_per_force(TAU * FREQUENCIES_HZ[1]), {
            Complex64::from(-1.0 / 44.0)
        });
    }

    /// Amplitude in m/s2 at 2000 Hz that a small corrugation of 1 mm makes at 2 m/s.
    fn amplitude(extensions: &[crate::extension::ExtensionInstance]) -> f64 {
        let waves = instance("corrugation").with("wavelength_m", 1e-3).with("amplitude_m", 1e-9);
        let (with, without): (TrackModel, TrackModel) =
            (track(&[extensions, &[waves]].concat()), track(extensions));
        let pass = time::Pass { start_m: 0.65, end_m: 0.8, ..pass_at(2.0) };
        let run = |model| time::pass(model, &pass, &Surface::smooth()).unwrap().acceleration_m_s2;
        let (with, without) = (run(&with), run(&without));
        // 0.02 m around mid-span at 0.6875 m; the smooth rail's own part is taken out.
        let sum = (1000..2000)
            .map(|step| {
                let phase = Complex64::cis(-TAU * 2e3 * 1e-5 * step as f64);
                (with[step] - without[step]) * phase
            })
            .sum::<Complex64>();
        sum.norm() * 2.0 / 1000.0
    }

    #[test]
    fn both_domains_agree_on_what_a_wave_makes_of_vehicle_and_contact() {
        let section = instance("rail_cross_section").with("frequency_Hz", 3e3);
        let section = section.with("stiffness_N_per_m", 1e9);
        let axle_box = instance("flexible_axle_box").with("mass_kg", 10.0);
        let axle_box = axle_box.with("stiffness_N_per_m", 4e8).with("damping_N_s_per_m", 3e3);
        for extension in [section, axle_box] {
            let expected = |model: &TrackModel| {
                let (omega, contact) = (TAU * 2e3, HertzContact::new(model.design()));
                let stiffness = 1.5 * 4500.0 / contact.approach(4500.0);
                let place = ReceptancePoint::Rail(0.68);
                let rail = receptance(model, place, place, &[2e3]).unwrap()[0];
                let vehicle = model.vehicle();
                let force = 1e-9 / (1.0 / stiffness + rail + vehicle.receptance(omega));
                (vehicle.acceleration_per_force(omega) * force).norm()
            };
            let (plain, extended) = (track(&[]), track(std::slice::from_ref(&extension)));
            let in_time = amplitude(std::slice::from_ref(&extension)) / amplitude(&[]);
            let in_frequency = expected(&extended) / expected(&plain);
            // The receptance under the wheel changes over the 0.02 m, alike in both.
            let ratio = in_time / in_frequency;
            assert!((ratio - 1.0).abs() < 0.03, "{}: {in_time} {in_frequency}", extension.physics);
            assert!((in_frequency - 1.0).abs() > 0.1, "{}", extension.physics);
        }
    }
}
