//! A sensor whose mounting resonates.

use super::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, Measured,
    PlaceKind, Places, Screening, Trials,
};
use num_complex::Complex64;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "sensor_mount_resonance",
    summary: "the sensor resonates on its mounting",
    family: EffectFamily::Sensor,
    group: LookAlikeGroup::MeasuringChain,
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[
        KindParameter::new("frequency_Hz", "Hz", "resonance of the sensor on its mounting")
            .ranges([1.5e3, 8e3], [1.5e3, 8e3], 3.2e3)
            // What resonates is known to a hundredth.
            .slack(0.03),
        KindParameter::new("damping_ratio", "1", "damping over critical damping").ranges(
            [0.01, 0.1],
            [0.01, 0.1],
            0.03,
        ),
    ],
    look_alikes: &["rail_cross_section", "flexible_axle_box"],
    would_separate: "another sensor, another mounting, or the other axes of the same sensor",
    screening: Screening::tried(&[Family::new(
        Places::Everywhere,
        &["frequency_Hz", "damping_ratio"],
        Trials::Grid(&[
            &[
                1.2e3, 1.4e3, 1.7e3, 2e3, 2.3e3, 2.6e3, 2.9e3, 3.2e3, 3.6e3, 4e3, 4.5e3, 5e3, 6e3,
                7e3, 9e3,
            ],
            &[0.02, 0.05, 0.15],
        ]),
    )]),
    build: |inputs| {
        Ok(Arc::new(SensorMountResonance {
            frequency_hz: inputs.value("frequency_Hz"),
            damping_ratio: inputs.value("damping_ratio"),
        }))
    },
};

/// The sensor as a mass on a spring and damper with base excitation:
/// `(1 + 2 i zeta r) / (1 - r² + 2 i zeta r)` with `r = f / f_s`.
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

#[cfg(test)]
mod tests {
    use crate::extension::Measured;
    use crate::extension::testing::{extension, instance};
    use num_complex::Complex64;
    use std::f64::consts::TAU;

    #[test]
    fn a_tone_is_recorded_as_the_transfer_says() {
        let mount = instance("sensor_mount_resonance").with("frequency_Hz", 3200.0);
        let mount = extension(&mount.with("damping_ratio", 0.03));
        for frequency_hz in [100.0, 3100.0, 4500.0] {
            let phase = |index: usize| TAU * frequency_hz * 1e-5 * index as f64;
            let mut measured = Measured {
                time_step_s: 1e-5,
                acceleration_m_s2: (0..20_000).map(|index| phase(index).sin()).collect(),
                position_m: vec![0.0; 20_000],
                first: 0,
            };
            mount.measure(&mut measured);
            // Tenths of a second from either end: the filter has rung itself out.
            let sum = (5_000..15_000)
                .map(|index| measured.acceleration_m_s2[index] * Complex64::cis(-phase(index)))
                .sum::<Complex64>();
            let found = sum * Complex64::new(0.0, 2.0 / 10_000.0);
            let expected = mount.sensor_transfer(frequency_hz);
            let error = (found - expected).norm() / expected.norm();
            // 1000 to 45000 whole waves less a part of one.
            assert!(error < 5e-3, "{frequency_hz} Hz: {found} {expected}");
        }
    }

    #[test]
    fn far_below_its_resonance_the_sensor_tells_the_truth() {
        let mount = instance("sensor_mount_resonance").with("frequency_Hz", 3200.0);
        let mount = extension(&mount.with("damping_ratio", 0.03));
        assert!((mount.sensor_transfer(32.0) - 1.0).norm() < 2e-4);
        // At resonance 1 / (2 zeta), and the quadrature of the damper.
        assert!((mount.sensor_transfer(3200.0).norm() - 16.7).abs() < 0.05);
    }
}
