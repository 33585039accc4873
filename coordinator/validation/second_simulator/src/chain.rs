//! The measuring chain: sensor, channel, recorder, odometer, with their hidden faults.
//!
//! Order: mounting of the sensor, shelf of the channel, samples, noise and hum, gain, steps, limit.

use crate::biquad::Biquad;
use crate::defect::smooth;
use crate::nuisance::Nuisances;
use crate::pass::Ride;
use crate::random::{Random, Topic};
use crate::recorder::sampled;
use crate::scale::Scale;
use crate::scheme::STEP_S;
use std::f64::consts::TAU;
use tracktwin_reference_simulator::{Hidden, Scene};

/// Standard deviation of the noise at low frequencies over that of the white noise, and its corner in Hz.
const DRIFT_NOISE: [f64; 2] = [0.5, 5.0];
/// Amplitude of the third harmonic of hum over that of the first.
const THIRD_HARMONIC: f64 = 0.15;

/// What is recorded of a pass.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    pub(crate) position_m: Vec<f64>,
    pub(crate) acceleration_m_s2: Vec<f64>,
}

/// Records pass `pass`.
pub(crate) fn recorded(
    scene: &Scene,
    scale: &Scale,
    nuisances: &Nuisances,
    ride: &Ride,
    pass: usize,
) -> Recorded {
    let mut random = Random::new(scene.seed, Topic::Noise, pass);
    let mut values = ride.acceleration_m_s2.clone();
    pass_channel(&mut values, scene, nuisances);
    let [mut values, true_m] = if scale.is_sample_step() {
        [values.split_off(ride.first), ride.position_m[ride.first..].to_vec()]
    } else {
        sampled(scale.sample_rate_hz, ride.first, &values, &ride.position_m)
    };
    let sample_s = 1.0 / scale.sample_rate_hz;
    add_noise(&mut values, scene.chain.noise_m_s2, sample_s, &mut random);
    for hidden in &scene.left_out {
        if let Hidden::ElectricalHum { frequency_hz, amplitude_m_s2 } = *hidden {
            let phase = random.angle();
            for (step, value) in values.iter_mut().enumerate() {
                let angle = TAU * frequency_hz * sample_s * step as f64 + phase;
                *value += amplitude_m_s2 * (angle.sin() + THIRD_HARMONIC * (3.0 * angle).sin());
            }
        }
    }
    for hidden in &scene.left_out {
        if let Hidden::GainError { factor, pass: of } = *hidden
            && of.is_none_or(|of| of == pass)
        {
            for value in &mut values {
                *value *= factor;
            }
        }
    }
    let step = scene.chain.step_m_s2;
    if step > 0.0 {
        for value in &mut values {
            *value = step * (*value / step).round();
        }
    }
    for hidden in &scene.left_out {
        if let Hidden::Clipping { limit_m_s2 } = *hidden {
            for value in &mut values {
                *value = value.clamp(-limit_m_s2, limit_m_s2);
            }
        }
    }
    let position_m = positions(scene, scale.wander_m, &true_m, pass, &mut random);
    Recorded { position_m, acceleration_m_s2: values }
}

/// Mounting of the sensor and shelf of the channel.
fn pass_channel(values: &mut [f64], scene: &Scene, nuisances: &Nuisances) {
    for hidden in &scene.left_out {
        if let Hidden::SensorMountResonance { frequency_hz, damping_ratio } = *hidden {
            let mut filter = Biquad::shaken(frequency_hz * STEP_S, damping_ratio);
            for value in values.iter_mut() {
                *value = filter.next(*value);
            }
        }
    }
    let [gain, corner_hz] = nuisances.shelf;
    let follow = 1.0 - (-TAU * corner_hz * STEP_S).exp();
    let mut low = 0.0;
    for value in values {
        low += follow * (*value - low);
        *value += gain * low;
    }
}

/// White noise, and slower noise of half its size.
fn add_noise(values: &mut [f64], deviation: f64, sample_s: f64, random: &mut Random) {
    let [share, corner_hz] = DRIFT_NOISE;
    let keep = (-TAU * corner_hz * sample_s).exp();
    let fresh = (1.0 - keep * keep).sqrt();
    let mut slow = random.normal();
    for value in values {
        slow = keep * slow + fresh * random.normal();
        *value += deviation * (random.normal() + share * slow);
    }
}

/// Positions recorded by the odometer, whose error is drawn anew every `apart_m`.
fn positions(
    scene: &Scene,
    apart_m: f64,
    true_m: &[f64],
    pass: usize,
    random: &mut Random,
) -> Vec<f64> {
    let Some(&first_m) = true_m.first() else {
        return Vec::new();
    };
    let length_m = true_m.last().map_or(0.0, |last_m| last_m - first_m);
    let wander_m = scene.chain.wander_m;
    let knots: Vec<f64> = (0..(length_m / apart_m) as usize + 2)
        .map(|_| random.between(-wander_m, wander_m))
        .collect();
    let faults: Vec<[f64; 2]> = scene
        .left_out
        .iter()
        .filter_map(|hidden| match *hidden {
            Hidden::PositionError { offset_m, scale, pass: of }
                if of.is_none_or(|of| of == pass) =>
            {
                Some([offset_m, scale])
            }
            _ => None,
        })
        .collect();
    let says = |&x_m: &f64| {
        let way_m = x_m - first_m;
        let place = way_m / apart_m;
        let knot = (place as usize).min(knots.len() - 2);
        let [from, to] = [knots[knot], knots[knot + 1]];
        let fault: f64 = faults.iter().map(|[offset, scale]| offset + scale * way_m).sum();
        x_m + from + smooth(place - knot as f64) * (to - from) + fault
    };
    true_m.iter().map(says).collect()
}
