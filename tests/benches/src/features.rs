//! Signals and feature vectors from fixed seeds.

use faer::Mat;
use tracktwin_parameters::{Parameter, Scale};
use tracktwin_signal::{FeatureDefinition, Signal};
use tracktwin_surrogate::TrainingSet;

/// A pseudo-random generator of numbers between -1 and 1 (Knuth's MMIX).
fn noise() -> impl FnMut() -> f64 {
    let mut state = 1_u64;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A signal like an axle-box acceleration, at 100 kHz: resonances at 115 and 900 Hz, and white noise.
///
/// # Panics
/// Never, because the samples are finite.
pub fn axle_box(samples: usize) -> Signal {
    let mut white = noise();
    let mut past = [[0.0; 2]; 2];
    let feedback = [(115.0, 0.02), (900.0, 0.1)].map(|(hz, damping)| {
        let angle = std::f64::consts::TAU * hz / 1e5;
        let radius = f64::exp(-damping * angle);
        [2.0 * radius * f64::cos(angle), -radius * radius]
    });
    let sample = || {
        let input = white();
        let mut sum = 0.3 * input;
        for ([a, b], past) in feedback.iter().zip(&mut past) {
            *past = [0.02 * input + a * past[0] + b * past[1], past[0]];
            sum += past[0];
        }
        sum
    };
    Signal::new(1e5, std::iter::repeat_with(sample).take(samples).collect()).expect("finite")
}

/// Rows of ln powers similar to those of a library: smooth functions of six parameters, plus random
/// deviations of the surface that are correlated between neighbouring bins.
pub fn feature_vectors(rows: usize, columns: usize) -> Mat<f64> {
    entries(rows, columns).0
}

/// Such rows, and their parameters (rows x 6, between -1 and 1).
fn entries(rows: usize, columns: usize) -> (Mat<f64>, Mat<f64>) {
    let mut white = noise();
    let (mut out, mut all) = (Mat::zeros(rows, columns), Mat::zeros(rows, Parameter::ALL.len()));
    for i in 0..rows {
        let parameters: [f64; 6] = std::array::from_fn(|_| white());
        let mut scatter = 0.0;
        for j in 0..columns {
            let place = j as f64 / columns as f64;
            scatter = 0.9 * scatter + 0.44 * white();
            let waves = parameters.iter().zip(1..);
            let smooth: f64 = waves.map(|(p, k)| p * (f64::from(k) * 3.0 * place + p).sin()).sum();
            out[(i, j)] = smooth + scatter;
        }
        all.row_mut(i).iter_mut().zip(parameters).for_each(|(to, p)| *to = p);
    }
    (out, all)
}

/// A training set of such rows at these speeds.
///
/// # Panics
/// Never, because the definition can be converted to JSON.
pub fn library(rows: usize, speeds_km_h: &[f64]) -> TrainingSet {
    let definition = FeatureDefinition::default();
    let frequencies_hz = definition.frequencies_hz();
    let bins = frequencies_hz.len();
    let (features, parameters) = entries(rows, bins * speeds_km_h.len());
    let table = |speed: usize| {
        let columns = features.subcols(speed * bins, bins);
        (0..rows).flat_map(|i| columns.row(i).iter().copied()).collect()
    };
    TrainingSet {
        frequencies_hz,
        speeds_km_h: speeds_km_h.to_vec(),
        log_power: (0..speeds_km_h.len()).map(table).collect(),
        varied: Parameter::ALL.to_vec(),
        scales: vec![Scale::Linear; Parameter::COUNT],
        parameters: (0..rows).flat_map(|i| parameters.row(i).iter().copied()).collect(),
        campaign: "bench".to_owned(),
        library_digest: "bench".to_owned(),
        feature_definition: serde_json::to_value(definition).expect("settings become JSON"),
    }
}
