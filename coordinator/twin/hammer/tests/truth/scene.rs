//! Tracks whose truth is known, struck by the reference simulator.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::Range;
use tracktwin_hammer::PointReceptance;
use tracktwin_reference_simulator::{SPACING_M, Scene, SleeperTruth, receptance};

/// Spans of a track, so many that its ends do not matter, and its struck sleepers in the middle.
const SPANS: usize = 240;
pub(crate) const STRUCK: Range<usize> = 110..131;

/// Hits that are averaged, and the noise of one over the receptance.
const HITS: usize = 5;
const NOISE: f64 = 0.05;

/// A track whose stiffness varies by `scatter` from sleeper to sleeper: the sleepers of an uneven
/// track of 40 spans, repeated.
pub(crate) fn scene(seed: u64, scatter: f64) -> Scene {
    let uneven = Scene::uneven(seed, scatter);
    let sleepers: Vec<SleeperTruth> =
        uneven.sleepers.iter().copied().cycle().take(SPANS - 1).collect();
    Scene { spans: SPANS, sleepers, ..uneven }
}

/// Place in m of a sleeper of the scene.
pub(crate) fn seat_m(sleeper: usize) -> f64 {
    (sleeper + 1) as f64 * SPACING_M
}

/// 28 frequencies an octave from 80 to 5000 Hz: not those that are fitted.
fn frequencies_hz() -> Vec<f64> {
    (0..168).map(|step| 80.0 * (f64::from(step) / 28.0).exp2()).collect()
}

/// Receptances above the struck sleepers and at midspan behind them, with noise and coherence.
pub(crate) fn strike(scene: &Scene) -> Vec<PointReceptance> {
    let halves = 2 * STRUCK.start..2 * STRUCK.end;
    let places_m: Vec<f64> = halves.map(|half| 0.5 * half as f64 * SPACING_M + SPACING_M).collect();
    let frequencies_hz = frequencies_hz();
    let exact = receptance(scene, &places_m, &frequencies_hz).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(scene.seed);
    let mut noisy = |value: &Complex64| {
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let deviation = NOISE / (HITS as f64).sqrt();
        let (re, im) = (normal(), normal());
        value * Complex64::new(1.0 + deviation * re, deviation * im)
    };
    let coherence = 1.0 / (1.0 + 2.0 * NOISE * NOISE);
    places_m
        .iter()
        .zip(&exact)
        .map(|(&position_m, exact)| PointReceptance {
            position_m,
            frequencies_hz: frequencies_hz.clone(),
            values: exact.iter().map(&mut noisy).collect(),
            coherence: Some(vec![coherence; exact.len()]),
            hits: Some(HITS),
        })
        .collect()
}
