//! Measured wavelet power in bands, over every sleeper in every pass.

use crate::bands::{Bands, gain};
use crate::prepared_recording::covers;
use num_complex::Complex64;
use rayon::prelude::*;
use std::ops::Range;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::Recording;

/// Number of power values per period of a band's centre frequency; the power of a band changes no faster
/// than its bandwidth permits.
const INSTANTS_PER_PERIOD: f64 = 5.0;

/// Number of decibels per neper of power.
pub(crate) const DECIBEL: f64 = 4.342_944_819_032_518;

/// Largest relative difference between the speeds of two passes that count as one speed.
const SPEED_TOLERANCE: f64 = 0.02;

/// Share of the spectrum up to half the sample rate from which the sensor noise is estimated.
const NOISE_BAND: Range<f64> = 0.6..0.9;

/// Lowest frequency times the sleeper spacing, in Hz m, at which the sensor noise is estimated: 5.1 kHz on
/// V-Track. Below it, the spectrum of the acceleration may be as flat as that of noise.
const NOISE_FROM: f64 = 5100.0 * 0.125;

/// Smallest ratio by which the spectral density of the acceleration falls over an octave above this
/// frequency: the square of the frequency.
const OCTAVE_FALL: f64 = 4.0;

/// The log powers of a recording, by speed, sleeper and band.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectra {
    /// Speeds, ascending.
    pub speeds: Vec<SpeedSpectra>,
}

/// The log powers at one speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedSpectra {
    /// Nominal speed in km/h.
    pub speed_km_h: f64,
    /// Indices of the passes in the recording.
    pub passes: Vec<usize>,
    /// Natural logarithm of the mean power in m2/s4, `[pass][sleeper][band]`; `None` if the pass does not
    /// cover the sleeper's window with a margin.
    pub log_power: Vec<Vec<Option<Vec<f64>>>>,
    /// One-sided power spectral density of the sensor noise in m2/s3, estimated at the highest frequencies;
    /// 0 if the sample rate is so low that they contain the acceleration of the axle box.
    pub noise_density: f64,
}

impl Spectra {
    /// Computes the powers of all passes over all sleepers, except the passes with these indices.
    pub fn new(recording: &Recording, bands: &Bands, except: &[usize]) -> Self {
        let noise_density =
            |&pass: &usize| noise_density(&recording.passes[pass].signal, recording.spacing_m);
        let of_speed = |passes: Vec<usize>| SpeedSpectra {
            speed_km_h: recording.passes[passes[0]].speed_km_h,
            log_power: passes.par_iter().map(|&it| pass_powers(recording, it, bands)).collect(),
            noise_density: passes.iter().map(noise_density).fold(f64::INFINITY, f64::min),
            passes,
        };
        let speeds = passes_by_speed(recording, except).into_par_iter().map(of_speed);
        let mut speeds: Vec<SpeedSpectra> = speeds.collect();
        speeds.sort_by(|a, b| a.speed_km_h.total_cmp(&b.speed_km_h));
        Self { speeds }
    }
}

/// Indices of the passes at each speed, without those with the indices `except`.
pub(crate) fn passes_by_speed(recording: &Recording, except: &[usize]) -> Vec<Vec<usize>> {
    let mut speeds: Vec<Vec<usize>> = Vec::new();
    let speed = |pass: usize| recording.passes[pass].speed_km_h;
    for pass in (0..recording.passes.len()).filter(|pass| !except.contains(pass)) {
        match speeds.iter_mut().find(|known| are_one_speed(speed(pass), speed(known[0]))) {
            Some(known) => known.push(pass),
            None => speeds.push(vec![pass]),
        }
    }
    speeds
}

/// Whether two speeds in km/h count as one speed.
pub fn are_one_speed(one_km_h: f64, other_km_h: f64) -> bool {
    (one_km_h / other_km_h - 1.0).abs() <= SPEED_TOLERANCE
}

impl SpeedSpectra {
    /// Mean over the passes of the log powers of a sleeper, one value per band; `None` if no pass covers
    /// it.
    pub fn mean(&self, sleeper: usize) -> Option<Vec<f64>> {
        let covered: Vec<_> = self.covering(sleeper).collect();
        let first = covered.first()?;
        let mean = |band: usize| {
            covered.iter().map(|power| power[band]).sum::<f64>() / covered.len() as f64
        };
        Some((0..first.len()).map(mean).collect())
    }

    /// Log powers of the passes that cover a sleeper.
    pub(crate) fn covering(&self, sleeper: usize) -> impl Iterator<Item = &Vec<f64>> {
        self.log_power.iter().filter_map(move |pass| pass[sleeper].as_ref())
    }

    /// Variance of one pass's log power about the mean of the passes, one value per band, over all
    /// sleepers; `None` if no sleeper is covered by two passes.
    pub fn pass_variance(&self) -> Option<Vec<f64>> {
        let sleepers = self.log_power[0].len();
        let bands = self.log_power.iter().flatten().flatten().next()?.len();
        let (mut sum, mut degrees) = (vec![0.0; bands], 0.0);
        for sleeper in 0..sleepers {
            let Some(mean) = self.mean(sleeper) else { continue };
            let passes = self.covering(sleeper);
            let mut count = 0.0;
            for power in passes {
                count += 1.0;
                for (sum, (value, mean)) in sum.iter_mut().zip(power.iter().zip(&mean)) {
                    *sum += (value - mean).powi(2);
                }
            }
            degrees += count - 1.0;
        }
        (degrees > 0.0).then(|| sum.into_iter().map(|sum| sum / degrees).collect())
    }
}

fn pass_powers(recording: &Recording, pass: usize, bands: &Bands) -> Vec<Option<Vec<f64>>> {
    let windows: Vec<_> = (0..recording.sleepers.len())
        .map(|sleeper| recording.window(pass, sleeper).filter(|_| covers(recording, pass, sleeper)))
        .collect();
    log_powers(&recording.passes[pass].signal, &windows, bands)
}

/// Natural logarithm of the mean wavelet power in each window and band; `None` for a missing window.
pub(crate) fn log_powers(
    signal: &Signal,
    windows: &[Option<Range<usize>>],
    bands: &Bands,
) -> Vec<Option<Vec<f64>>> {
    let transform = Transform::new(signal);
    let mut all: Vec<_> = windows
        .iter()
        .map(|window| window.as_ref().map(|_| Vec::with_capacity(bands.count())))
        .collect();
    for &centre_hz in bands.centres_hz() {
        let power = transform.power(centre_hz);
        for (window, powers) in windows.iter().zip(&mut all) {
            if let (Some(window), Some(powers)) = (window, powers) {
                powers.push(power.mean(window).ln());
            }
        }
    }
    all
}

/// Spectrum of a signal, from which band powers are computed.
struct Transform {
    sample_rate_hz: f64,
    /// Number of samples, including the zeros after them.
    samples: usize,
    spectrum: Vec<Complex64>,
}

/// Power of the analytic signal in a band, at equidistant instants.
struct Power {
    values: Vec<f64>,
    /// Number of signal samples between two instants.
    step: f64,
}

impl Transform {
    fn new(signal: &Signal) -> Self {
        let mean = signal.samples().iter().sum::<f64>() / signal.len() as f64;
        // A power of two can be shortened by powers of two for every band.
        let samples = signal.len().next_power_of_two();
        let mut padded: Vec<f64> = signal.samples().iter().map(|value| value - mean).collect();
        padded.resize(samples, 0.0);
        let forward = tracktwin_fourier::real_forward(samples);
        let mut spectrum = forward.make_output_vec();
        forward.process(&mut padded, &mut spectrum).expect("lengths are the plan's own");
        Self { sample_rate_hz: signal.sample_rate_hz(), samples, spectrum }
    }

    /// Mean square of the spectrum over a share of the frequencies up to half the sample rate, without
    /// single lines.
    fn mean_square(&self, share: Range<f64>) -> f64 {
        let count = self.spectrum.len() as f64;
        let lines = (share.start * count) as usize..(share.end * count) as usize;
        let mut squares: Vec<f64> = self.spectrum[lines].iter().map(Complex64::norm_sqr).collect();
        let middle = squares.len() / 2;
        // The median of an exponential distribution is ln 2 of its mean.
        *squares.select_nth_unstable_by(middle, f64::total_cmp).1 / std::f64::consts::LN_2
    }

    fn power(&self, centre_hz: f64) -> Power {
        let line_hz = self.sample_rate_hz / self.samples as f64;
        let wanted = INSTANTS_PER_PERIOD * centre_hz / line_hz;
        let instants = (wanted.ceil() as usize).next_power_of_two().min(self.samples);
        let last = ((2.0 * centre_hz / line_hz) as usize).min(self.spectrum.len() - 1);
        let mut values = vec![Complex64::ZERO; instants];
        for line in 1..=last {
            // Twice: the analytic signal has the power of both signs of frequency.
            let weight = 2.0 * gain(centre_hz, line as f64 * line_hz) / self.samples as f64;
            values[line % instants] += weight * self.spectrum[line];
        }
        tracktwin_fourier::inverse(instants).process(&mut values);
        Power {
            values: values.iter().map(Complex64::norm_sqr).collect(),
            step: self.samples as f64 / instants as f64,
        }
    }
}

impl Power {
    /// Mean over a window of samples, from at least one instant.
    fn mean(&self, window: &Range<usize>) -> f64 {
        let first = (window.start as f64 / self.step).ceil() as usize;
        let end = ((window.end as f64 / self.step).ceil() as usize).max(first + 1);
        let inside = &self.values[first.min(self.values.len() - 1)..end.min(self.values.len())];
        inside.iter().sum::<f64>() / inside.len() as f64
    }
}

/// Power spectral density of the sensor noise in m2/s3, on a track with this sleeper spacing in m.
///
/// The noise is white. What is left of the acceleration in the band of the noise is at most a quarter of
/// what it is an octave below.
fn noise_density(signal: &Signal, spacing_m: f64) -> f64 {
    let Range { start, end } = NOISE_BAND;
    if start * 0.5 * signal.sample_rate_hz() * spacing_m < NOISE_FROM {
        return 0.0;
    }
    let transform = Transform::new(signal);
    let density = 2.0 / (transform.sample_rate_hz * signal.len() as f64);
    let [below, high] =
        [0.5 * start..0.5 * end, start..end].map(|share| density * transform.mean_square(share));
    ((high - below / OCTAVE_FALL) / (1.0 - OCTAVE_FALL.recip())).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    #[test]
    fn a_tone_has_the_square_of_its_amplitude_in_its_own_band() {
        let bands = Bands::new(200.0, 3200.0);
        let tone = |n: u32| 3.0 * (std::f64::consts::TAU * 800.0 * f64::from(n) / 5e4).sin();
        let signal = Signal::new(5e4, (0..30_000).map(tone).collect()).unwrap();
        let powers = log_powers(&signal, &[Some(10_000..15_000), None], &bands);
        let band = bands.centres_hz().iter().position(|hz| (hz - 800.0).abs() < 1e-6).unwrap();
        // The ends of the signal are far away, the window holds eighty periods.
        assert!((powers[0].as_ref().unwrap()[band].exp() - 9.0).abs() < 1e-3);
        assert_eq!(powers[1], None);
    }

    #[test]
    fn white_noise_has_the_power_that_the_weights_say_and_its_density_is_found() {
        let bands = Bands::new(200.0, 3200.0);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let uniform = (0..400_000).map(|_| random.next_u64() as f64 / u64::MAX as f64 - 0.5);
        let signal = Signal::new(5e4, uniform.collect()).unwrap();
        // Variance 1/12 over 25 kHz.
        let density = 1.0 / 12.0 / 25e3;
        let powers = log_powers(&signal, &[Some(1000..399_000)], &bands)[0].clone().unwrap();
        for (band, power) in powers.iter().enumerate() {
            let weight: f64 = bands.weights(band).iter().map(|&(_, weight)| weight).sum();
            // Eight seconds of the narrowest band, 60 Hz wide, are known to 5 %.
            assert!((power.exp() / (weight * density) - 1.0).abs() < 0.2, "{band}");
        }
        assert!((noise_density(&signal, 0.125) / density - 1.0).abs() < 0.03);
    }

    /// What an axle box accelerates in is no noise, however low the sample rate.
    #[test]
    fn the_acceleration_of_the_axle_box_is_no_noise() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut uniform = || random.next_u64() as f64 / u64::MAX as f64 - 0.5;
        // Two poles at 800 Hz: flat below, falling with the fourth power of the frequency above.
        let rate_hz = 5e4;
        let pole = (-std::f64::consts::TAU * 800.0 / rate_hz).exp();
        let (mut first, mut second) = (0.0, 0.0);
        let samples: Vec<f64> = (0..200_000)
            .map(|_| {
                first = pole * first + (1.0 - pole) * uniform();
                second = pole * second + (1.0 - pole) * first;
                second
            })
            .collect();
        let density = 1.0 / 12.0 / 25e3;
        let at = |every: usize| {
            let samples = samples.iter().step_by(every).copied().collect();
            let signal = Signal::new(rate_hz / every as f64, samples).unwrap();
            noise_density(&signal, 0.125) / density
        };
        // 50, 5 and 1 kHz.
        for every in [1, 10, 50] {
            assert!(at(every) < 1e-4, "{every}: {}", at(every));
        }
    }
}
