//! Hum of the electrical mains in the signal.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, Measured,
    PlaceKind, Screening,
};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "electrical_hum",
    summary: "a tone of the electrical supply is added to the signal",
    family: EffectFamily::Sensor,
    group: LookAlikeGroup::MeasuringChain,
    classes: &[Class::Noise, Class::Frequency],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[
        KindParameter::new("frequency_Hz", "Hz", "frequency of the tone")
            .ranges([16.7, 1000.0], [16.7, 1000.0], 50.0)
            .or(50.0),
        KindParameter::new("amplitude_m_s2", "m/s2", "amplitude of the tone").ranges(
            [0.05, 5.0],
            [0.05, 20.0],
            0.5,
        ),
        KindParameter::new("phase_rad", "rad", "phase at the first sample")
            .ranges([0.0, TAU], [0.0, TAU], 0.0)
            .bound(Bound::Any)
            .or(0.0),
    ],
    look_alikes: &["wheel_out_of_round"],
    would_separate: "a recording at standstill",
    screening: Screening::not_tried("the spectrum of a pass shows it without a model of the track"),
    build: |inputs| {
        Ok(Arc::new(ElectricalHum {
            omega: TAU * inputs.value("frequency_Hz"),
            amplitude_m_s2: inputs.value("amplitude_m_s2"),
            phase_rad: inputs.value("phase_rad"),
        }))
    },
};

/// `a sin(w t + phi)`, with `t` from the first kept sample.
#[derive(Debug)]
struct ElectricalHum {
    /// Angular frequency in rad/s.
    omega: f64,
    amplitude_m_s2: f64,
    phase_rad: f64,
}

impl Extension for ElectricalHum {
    fn measure(&self, measured: &mut Measured) {
        let per_sample = self.omega * measured.time_step_s;
        for (index, value) in measured.acceleration_m_s2.iter_mut().enumerate() {
            let samples = index as f64 - measured.first as f64;
            *value += self.amplitude_m_s2 * (per_sample * samples + self.phase_rad).sin();
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::Measured;
    use crate::extension::testing::{extension, instance};

    #[test]
    fn a_tone_of_its_frequency_is_added() {
        let hum = extension(&instance("electrical_hum").with("amplitude_m_s2", 0.5));
        let mut measured = Measured {
            time_step_s: 1e-3,
            acceleration_m_s2: vec![1.0; 40],
            position_m: vec![0.0; 40],
            first: 2,
        };
        hum.measure(&mut measured);
        // 50 Hz: a quarter of a wave is five samples.
        let at = |index: usize| measured.acceleration_m_s2[index];
        for (index, expected) in [(2, 1.0), (7, 1.5), (17, 0.5), (27, 1.5)] {
            assert!((at(index) - expected).abs() < 1e-9, "{index}: {}", at(index));
        }
    }
}
