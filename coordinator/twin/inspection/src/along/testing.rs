//! Signals with known content, for tests.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_track::model::Surface;

/// Independent values of mean zero and variance one (Box and Muller).
pub(crate) fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let mut normal = || (-2.0 * (1.0 - unit()).ln()).sqrt() * (TAU * unit()).cos();
    (0..count).map(|_| normal()).collect()
}

/// Recordings of an independent data set: its single passes and the whole, as far as they are available.
pub(crate) fn independent(name: &str) -> impl Iterator<Item = Recording> {
    test_needs::recordings(name).into_iter().map(|folder| Recording::open(folder).unwrap())
}

/// Fault of the measuring chain in a pass: arguments are its index, samples and positions.
pub(crate) type Chain<'a> = dyn Fn(usize, &mut [f64], &mut [f64]) + 'a;

/// Passes of a wheel that follows the surface: the acceleration is the second time derivative of the
/// height. All passes share a surface of level 3 of eq. B.6; the sensor adds white noise of 0.05 m/s2.
pub(crate) struct Rolled<'a> {
    /// Seed of the surface and of the noise.
    pub seed: u64,
    /// Height in m that is added to the surface, as a function of pass and position in m.
    pub height_m: &'a dyn Fn(usize, f64) -> f64,
    /// Fault of the measuring chain.
    pub chain: &'a Chain<'a>,
}

impl Rolled<'_> {
    pub(crate) const RATE_HZ: f64 = 4e4;
    pub(crate) const CIRCUMFERENCE_M: f64 = 0.408;

    /// A surface, a wheel and a chain without defects.
    pub(crate) const fn faultless(seed: u64) -> Self {
        Self { seed, height_m: &|_, _| 0.0, chain: &|_, _, _| () }
    }

    /// Two passes at each of 13 and 8 km/h over 3 m.
    pub(crate) fn recording(&self) -> Recording {
        let surface = Surface::rough(self.seed, 3.0, 4.0);
        let pass = |(index, speed_km_h): (usize, f64)| {
            let step = speed_km_h / 3.6 / Self::RATE_HZ;
            let count = (3.0 / step) as usize;
            let height = |i: f64| surface.height(i * step) + (self.height_m)(index, i * step);
            let heights: Vec<f64> = (0..count + 2).map(|i| height(i as f64)).collect();
            let noise = noise(self.seed + 1000 * (1 + index as u64), count);
            let curved = |w: &[f64]| (w[0] - 2.0 * w[1] + w[2]) * Self::RATE_HZ * Self::RATE_HZ;
            let moved = heights.windows(3).map(curved);
            let mut samples: Vec<f64> = moved.zip(noise).map(|(a, n)| a + 0.05 * n).collect();
            let mut position_m: Vec<f64> = (0..count).map(|i| i as f64 * step).collect();
            (self.chain)(index, &mut samples, &mut position_m);
            let signal = Signal::new(Self::RATE_HZ, samples).unwrap();
            Pass {
                file: String::new(),
                speed_km_h,
                axle: None,
                signal,
                position_m,
                contact_loss_share: None,
            }
        };
        let sleeper = |i: usize| Sleeper { id: format!("SN{i}"), x_m: i as f64 * 0.125 };
        Recording {
            name: "rolled".to_owned(),
            sample_rate_hz: Self::RATE_HZ,
            channel: String::new(),
            passes: [13.0, 13.0, 8.0, 8.0].into_iter().enumerate().map(pass).collect(),
            sleepers: (1..24).map(sleeper).collect(),
            // No track is under this wheel, from which the size of the surface would follow.
            nominal: std::iter::once(("gain_known".to_owned(), false.into())).collect(),
            spacing_m: 0.125,
            doubts: Vec::new(),
        }
    }
}

/// A minute of noise of variance one and tones of this amplitude at every number of waves per metre, recorded at 2 kHz
/// with a speed in whole kilometres per hour.
pub(crate) struct LongPass<'a> {
    pub seed: u64,
    /// First and last speed in km/h.
    pub speeds_km_h: [f64; 2],
    pub amplitude: f64,
    pub waves_per_m: &'a [f64],
}

impl LongPass<'_> {
    const RATE_HZ: f64 = 2000.0;
    const COUNT: usize = 120_000;

    pub(crate) fn pass(&self) -> Pass {
        let [first, last] = self.speeds_km_h;
        let (mut way, mut position) = (0.0, 0.0);
        let (mut samples, mut position_m) = (Vec::new(), Vec::new());
        for (index, noise) in noise(self.seed, Self::COUNT).iter().enumerate() {
            let km_per_h = first + (last - first) * index as f64 / Self::COUNT as f64;
            way += km_per_h / 3.6 / Self::RATE_HZ;
            position += km_per_h.round() / 3.6 / Self::RATE_HZ;
            let tone = |waves: &f64| (TAU * (waves * way + 0.13 * waves * waves)).sin();
            let tones = self.waves_per_m.iter().map(tone);
            samples.push(noise + self.amplitude * tones.sum::<f64>());
            position_m.push(position);
        }
        Pass {
            file: String::new(),
            speed_km_h: 0.5 * (first + last),
            signal: Signal::new(Self::RATE_HZ, samples).unwrap(),
            position_m,
            axle: None,
            contact_loss_share: None,
        }
    }

    /// The pass alone, over sleepers that are 0.6 m apart, with a wheel of this radius in m.
    pub(crate) fn recording(&self, radius_m: Option<f64>) -> Recording {
        let wheel = radius_m.map(|it| ("wheel".to_owned(), serde_json::json!({"radius_m": it})));
        Recording {
            name: "long".to_owned(),
            sample_rate_hz: Self::RATE_HZ,
            channel: String::new(),
            passes: vec![self.pass()],
            sleepers: Vec::new(),
            nominal: wheel.into_iter().collect(),
            spacing_m: 0.6,
            doubts: Vec::new(),
        }
    }
}

/// A hollow `d/2 (1 + cos(2 pi x/l))` around a place.
pub(crate) fn hollow_m(depth: f64, length: f64, x: f64) -> f64 {
    if x.abs() < 0.5 * length { 0.5 * depth * (1.0 + (TAU * x / length).cos()) } else { 0.0 }
}
