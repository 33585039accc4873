//! The measuring chain: from the motion of the wheel to the recorded signal.

use crate::filter::halve_rate;
use crate::hidden::Hidden;
use crate::pass::Driven;
use crate::scene::{Chain, Scene};
use crate::system::LinearSystem;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use std::f64::consts::TAU;

/// Shortest and longest wavelength in m of the odometer's wander, and how many waves it has.
const WANDER_M: [f64; 2] = [0.7, 5.0];
const WAVES: usize = 3;

/// What a pass records.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Measured {
    pub(crate) sample_rate_hz: f64,
    pub(crate) acceleration_m_s2: Vec<f64>,
    pub(crate) position_m: Vec<f64>,
}

/// What a scene's chain with its faults records of pass number `pass`.
pub(crate) fn measure(
    scene: &Scene,
    pass: usize,
    driven: &Driven,
    random: &mut ChaCha12Rng,
) -> Measured {
    let Scene { left_out, chain, nuisances, recorded_m: [from_m, to_m], .. } = scene;
    let faults: Vec<&Hidden> = left_out.iter().filter(|hidden| concerns(hidden, pass)).collect();
    let felt = faults.iter().fold(driven.acceleration_m_s2.clone(), |felt, fault| match fault {
        Hidden::SensorMountResonance { frequency_hz, damping_ratio } => {
            mounted(&felt, TAU * frequency_hz, *damping_ratio, driven.time_step_s)
        }
        _ => felt,
    });
    let step_s = 2.0 * driven.time_step_s;
    let positions: Vec<f64> = driven.position_m.iter().step_by(2).copied().collect();
    let first = positions.partition_point(|&x_m| x_m < *from_m);
    let last = positions.partition_point(|&x_m| x_m <= *to_m);
    let mut samples = halve_rate(&felt);
    if let Some(response) = nuisances.response {
        samples = response.of(&samples, step_s);
    }
    let mut samples = samples[first..last].to_vec();
    nuisances.add_slow_noise(&mut samples, step_s, random);
    record(chain, &faults, &mut samples, step_s, random);
    let mut position_m = positions[first..last].to_vec();
    wander(chain.wander_m, &mut position_m, random);
    for fault in faults {
        if let Hidden::PositionError { offset_m, scale, .. } = fault {
            let begin = position_m.first().copied().unwrap_or_default();
            for x_m in &mut position_m {
                *x_m = begin + offset_m + (1.0 + scale) * (*x_m - begin);
            }
        }
    }
    Measured { sample_rate_hz: (1.0 / step_s).round(), acceleration_m_s2: samples, position_m }
}

/// Whether a fault is in this pass.
fn concerns(hidden: &Hidden, pass: usize) -> bool {
    match hidden {
        Hidden::GainError { pass: Some(only), .. }
        | Hidden::PositionError { pass: Some(only), .. } => *only == pass,
        _ => true,
    }
}

/// Acceleration of a sensor on a spring and damper with base excitation. The motion `r` relative to the
/// base follows `r'' + 2 zeta w r' + w² r = -a`; the sensor measures `-2 zeta w r' - w² r`.
fn mounted(shaken: &[f64], omega: f64, damping_ratio: f64, step_s: f64) -> Vec<f64> {
    let (damping, stiffness) = (2.0 * damping_ratio * omega, omega * omega);
    let sensor = LinearSystem::oscillator(1.0, damping, stiffness, step_s);
    let mut state = [0.0; 2];
    let mut before = 0.0;
    let feel = |&foot: &f64| {
        let mut next = [0.0; 2];
        sensor.free(&state, &[-before], &mut next);
        sensor.push(0, -foot, &mut next);
        (state, before) = (next, foot);
        -damping * next[1] - stiffness * next[0]
    };
    shaken.iter().map(feel).collect()
}

/// Gain, hum, noise, limit and steps of the recorder.
fn record(
    chain: &Chain,
    faults: &[&Hidden],
    samples: &mut [f64],
    step_s: f64,
    random: &mut ChaCha12Rng,
) {
    for fault in faults {
        match fault {
            Hidden::GainError { factor, .. } => {
                for sample in &mut *samples {
                    *sample *= factor;
                }
            }
            Hidden::ElectricalHum { frequency_hz, amplitude_m_s2 } => {
                let phase = TAU * turn(random);
                for (index, sample) in samples.iter_mut().enumerate() {
                    let angle = TAU * frequency_hz * step_s * index as f64 + phase;
                    *sample += amplitude_m_s2 * angle.sin();
                }
            }
            _ => {}
        }
    }
    for sample in &mut *samples {
        let noise: f64 = StandardNormal.sample(random);
        *sample += chain.noise_m_s2 * noise;
    }
    for fault in faults {
        if let Hidden::Clipping { limit_m_s2 } = fault {
            for sample in &mut *samples {
                *sample = sample.clamp(-limit_m_s2, *limit_m_s2);
            }
        }
    }
    if chain.step_m_s2 > 0.0 {
        for sample in samples {
            *sample = (*sample / chain.step_m_s2).round() * chain.step_m_s2;
        }
    }
}

/// Waves along the track whose sum is never more than `most_m`.
fn wander(most_m: f64, position_m: &mut [f64], random: &mut ChaCha12Rng) {
    let ratio: f64 = WANDER_M[1] / WANDER_M[0];
    let waves: [[f64; 2]; WAVES] =
        [0; WAVES].map(|_| [TAU / (WANDER_M[0] * ratio.powf(turn(random))), TAU * turn(random)]);
    for x_m in position_m {
        let sum: f64 = waves.iter().map(|[wave, phase]| (wave * *x_m + phase).sin()).sum();
        *x_m += most_m / WAVES as f64 * sum;
    }
}

/// A random share of a turn.
pub(crate) fn turn(random: &mut ChaCha12Rng) -> f64 {
    Uniform::new(0.0, 1.0).expect("an interval").sample(random)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::NOMINAL;
    use rand_chacha::rand_core::SeedableRng;

    fn random() -> ChaCha12Rng {
        ChaCha12Rng::seed_from_u64(7)
    }

    fn driven(value: impl Fn(f64) -> f64) -> Driven {
        let time_step_s = 5e-6;
        let times = (1..=40_000).map(|step| f64::from(step) * time_step_s);
        Driven {
            time_step_s,
            acceleration_m_s2: times.clone().map(value).collect(),
            contact_force_n: Vec::new(),
            position_m: times.map(|time| 1.0 + 3.0 * time).collect(),
        }
    }

    fn scene(chain: Chain, left_out: &[Hidden]) -> Scene {
        let left_out = left_out.to_vec();
        Scene { chain, left_out, recorded_m: [1.1, 1.6], ..Scene::uniform(20, NOMINAL) }
    }

    fn measured(left_out: &[Hidden], pass: usize, value: impl Fn(f64) -> f64) -> Measured {
        measure(&scene(Chain::ideal(), left_out), pass, &driven(value), &mut random())
    }

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn an_ideal_chain_records_what_there_is_where_it_is() {
        let tone = |time: f64| (TAU * 1000.0 * time).sin();
        let record = measured(&[], 0, tone);
        assert_eq!(record.sample_rate_hz, 1e5);
        assert!((record.position_m[0] - 1.1).abs() < 4e-5);
        for (value, x_m) in record.acceleration_m_s2.iter().zip(&record.position_m).take(9000) {
            // The filter's ripple.
            assert!((value - tone((x_m - 1.0) / 3.0)).abs() < 2e-3);
        }
    }

    #[test]
    fn a_loose_sensor_resonates() {
        let mount = Hidden::SensorMountResonance { frequency_hz: 3200.0, damping_ratio: 0.03 };
        for frequency in [1000.0, 3200.0, 6000.0] {
            let tone = |time: f64| (TAU * frequency * time).sin();
            let ratio: f64 = frequency / 3200.0;
            let damping = 0.06 * ratio;
            let exact = 1.0_f64.hypot(damping) / (1.0 - ratio * ratio).hypot(damping);
            let got =
                rms(&measured(std::slice::from_ref(&mount), 0, tone).acceleration_m_s2[5000..])
                    * 2.0_f64.sqrt();
            // Acceleration is linear between steps, and the window holds no whole periods.
            assert!((got / exact - 1.0).abs() < 0.02, "{frequency} Hz: {got} {exact}");
        }
    }

    #[test]
    fn faults_of_one_pass_leave_the_others_alone() {
        let faults = [
            Hidden::GainError { factor: 1.5, pass: Some(2) },
            Hidden::PositionError { offset_m: 0.01, scale: 0.02, pass: Some(2) },
        ];
        let (right, wrong) = (measured(&faults, 1, |_| 2.0), measured(&faults, 2, |_| 2.0));
        assert!((wrong.acceleration_m_s2[500] / right.acceleration_m_s2[500] - 1.5).abs() < 1e-9);
        let way = |record: &Measured| record.position_m[9000] - record.position_m[0];
        assert!((way(&wrong) / way(&right) - 1.02).abs() < 1e-9);
        assert!((wrong.position_m[0] - right.position_m[0] - 0.01).abs() < 1e-12);
    }

    #[test]
    fn hum_and_limits_are_there() {
        let hum = Hidden::ElectricalHum { frequency_hz: 50.0, amplitude_m_s2: 0.5 };
        let record = measured(&[hum], 0, |_| 0.0);
        assert!((rms(&record.acceleration_m_s2) * 2.0_f64.sqrt() / 0.5 - 1.0).abs() < 0.1);
        let clipped = measured(&[Hidden::Clipping { limit_m_s2: 0.7 }], 0, |t| (9e3 * t).sin());
        let greatest = clipped.acceleration_m_s2.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        assert_eq!(greatest, 0.7);
    }

    #[test]
    fn noise_steps_and_wander_are_as_large_as_the_chain_says() {
        let chain = Chain::default();
        let record = measure(&scene(chain, &[]), 0, &driven(|_| 0.0), &mut random());
        let samples = &record.acceleration_m_s2;
        assert!((rms(samples) / 0.05 - 1.0).abs() < 0.03);
        assert!(samples.iter().all(|value| (value / 0.005 - (value / 0.005).round()).abs() < 1e-6));
        let ideal = measured(&[], 0, |_| 0.0);
        let offs = record.position_m.iter().zip(&ideal.position_m).map(|(a, b)| (a - b).abs());
        let most = offs.fold(0.0, f64::max);
        assert!(most > 3e-4 && most <= 3e-3, "{most}");
        assert!(record.position_m.is_sorted());
    }
}
