//! The measuring chain of a simulated recording: extensions, sample rate, noise, resolution, odometer.

use super::super::numbers::number;
use super::super::{OrInput, Stop};
use super::sampling::{resampled, sample_rate_hz};
use anyhow::anyhow;
use clap::Args;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal};
use std::f64::consts::TAU;
use tracktwin_parameters::quantity::{SAMPLE_RATE, SENSOR, WANDER};
use tracktwin_parameters::unit;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::Pass;
use tracktwin_track::extension::Measured;
use tracktwin_track::model::TrackModel;
use tracktwin_track::time::PassRecord;

/// Wavelengths of the odometer error in sleeper spacings.
const WANDER_SPACINGS: [f64; 4] = [4.8, 8.8, 18.4, 37.6];

/// Properties of the measuring chain.
#[derive(Args)]
pub(super) struct Sensor {
    /// Sample rate of the recording in Hz; a low-pass filter passes what lies below 0.4 of it [default: one sample a
    /// time step].
    #[arg(long, value_name = "HZ", value_parser = number(SAMPLE_RATE))]
    sample_rate: Option<f64>,
    /// Standard deviation of the sensor's white noise in m/s2.
    #[arg(long, default_value_t = 0.0, value_name = "M_S2", value_parser = number(SENSOR))]
    noise: f64,
    /// Resolution of the recorded accelerations in m/s2; 0 for no rounding.
    #[arg(long, default_value_t = 0.0, value_name = "M_S2", value_parser = number(SENSOR))]
    resolution: f64,
    /// Largest odometer error in m.
    #[arg(long, default_value_t = 0.0, value_name = "M", value_parser = number(WANDER))]
    odometer: f64,
}

impl Sensor {
    /// The sample rate in Hz of a simulation with this time step in s.
    ///
    /// # Errors
    /// An error with a remedy if there are more samples than time steps.
    pub(super) fn sample_rate_hz(&self, time_step_s: f64) -> Result<f64, anyhow::Error> {
        let most_hz = sample_rate_hz(time_step_s);
        match self.sample_rate {
            Some(wanted_hz) if wanted_hz > most_hz => Err(anyhow!(
                "--sample-rate {wanted_hz}: the time step {time_step_s:e} s gives {most_hz} Hz at most; use \
                 --time-step {:.1e}",
                1.0 / wanted_hz
            )),
            Some(wanted_hz) => Ok(wanted_hz),
            None => Ok(most_hz),
        }
    }

    /// The recording of a pass from `from_m` on; `seed` determines noise and odometer error.
    pub(super) fn measured(
        &self,
        model: &TrackModel,
        record: &PassRecord,
        speed_km_h: f64,
        from_m: f64,
        seed: u64,
    ) -> Result<Pass, Stop> {
        let count = record.acceleration_m_s2.len();
        let position = |index: usize| record.position_m(index);
        let first = (0..count).find(|&index| position(index) >= from_m).unwrap_or(count);
        let mut measured = Measured {
            time_step_s: record.time_step_s,
            acceleration_m_s2: record.acceleration_m_s2.clone(),
            position_m: (0..count).map(position).collect(),
            first,
        };
        model.measure(&mut measured);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sample_rate_hz = self.sample_rate_hz(record.time_step_s)?;
        let [mut samples, mut position_m] = match self.sample_rate {
            Some(_) => resampled(&measured, sample_rate_hz),
            None => [measured.acceleration_m_s2, measured.position_m]
                .map(|mut all| all.split_off(first)),
        };
        if samples.is_empty() {
            return Err(anyhow!(
                "--sample-rate {sample_rate_hz}: the pass at {speed_km_h} km/h is shorter than the recorder's \
                 filter; use a higher --sample-rate, a lower --speed or more --spans"
            ))
            .or_input();
        }
        self.add_noise(&mut samples, &mut random)?;
        self.wander(&mut position_m, model.design().sleeper.spacing_m, &mut random);
        let signal = Signal::new(sample_rate_hz, samples)?;
        let contact_loss_share = Some(record.contact_loss_share(first));
        Ok(Pass {
            file: String::new(),
            speed_km_h,
            axle: None,
            signal,
            position_m,
            contact_loss_share,
        })
    }

    fn add_noise(&self, samples: &mut [f64], random: &mut impl Rng) -> Result<(), Stop> {
        let noise = Normal::new(0.0, self.noise).map_err(|error| anyhow!("--noise: {error}"))?;
        for sample in samples {
            *sample += noise.sample(random);
            if self.resolution > 0.0 {
                *sample = (*sample / self.resolution).round() * self.resolution;
            }
        }
        Ok(())
    }

    /// Sum of waves with random phases that never exceeds the limit.
    fn wander(&self, position_m: &mut [f64], spacing_m: f64, random: &mut impl Rng) {
        let phases = WANDER_SPACINGS.map(|_| TAU * unit(random.next_u64()));
        let amplitude_m = self.odometer / WANDER_SPACINGS.len() as f64;
        for position in position_m {
            let waves = WANDER_SPACINGS.iter().zip(phases);
            let x = *position / spacing_m;
            let sum: f64 = waves.map(|(length, phase)| (TAU * x / length + phase).sin()).sum();
            *position += amplitude_m * sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_odometer_wanders_by_no_more_than_it_may_and_never_goes_back() {
        let sensor =
            Sensor { sample_rate: None, noise: 0.0, resolution: 0.0, odometer: WANDER.range[1] };
        for seed in 0..20 {
            let truth: Vec<f64> = (0..3000).map(|index| f64::from(index) * 1e-3).collect();
            let mut told = truth.clone();
            sensor.wander(&mut told, 0.125, &mut ChaCha8Rng::seed_from_u64(seed));
            assert!(told.is_sorted_by(|a, b| a < b));
            let most = told.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(most <= WANDER.range[1] && most > 0.1 * WANDER.range[1], "{most}");
        }
    }

    #[test]
    fn accelerations_are_recorded_in_steps() {
        let sensor = Sensor { sample_rate: None, noise: 0.05, resolution: 0.005, odometer: 0.0 };
        let mut samples = vec![1.0; 1000];
        sensor.add_noise(&mut samples, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let steps = samples.iter().map(|sample| sample / 0.005);
        assert!(steps.clone().all(|step| (step - step.round()).abs() < 1e-6));
        assert!(steps.clone().any(|step| (step - 200.0).abs() > 5.0));
    }
}
