//! The literal transform against a reference in 80-bit arithmetic that shares no code with it.
//!
//! `make_reference.py` beside the reference states every convention.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::{f64::consts::TAU, ops::Range};
use tracktwin_signal::{Conventions, Cwt, Morlet, Normalisation, Padding, squeeze};

const RATE_HZ: f64 = 100_000.0;
const SAMPLES: usize = 3485;
const VOICES: u32 = 48;

/// The reference has been repeated in double precision: 1e-13. Rounding may put a coefficient into
/// the neighbouring bin, which would show as 1e-3 or more; none does.
const TOLERANCE: f64 = 1e-8;

fn reference() -> Value {
    let file = test_needs::reference().join("transform/reference_50_4000.json");
    serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
}

/// Two tones and a chirp from 400 to 3000 Hz (S1 of the reference).
fn tones_and_chirp() -> Vec<f64> {
    let sweep = (3000.0 - 400.0) / (SAMPLES as f64 / RATE_HZ);
    (0..SAMPLES)
        .map(|n| n as f64 / RATE_HZ)
        .map(|t| {
            (TAU * 150.0 * t).sin()
                + 0.8 * (TAU * 1100.0 * t + 0.3).cos()
                + 0.6 * (TAU * (400.0 * t + 0.5 * sweep * t * t)).sin()
        })
        .collect()
}

/// Five impulses with decaying resonances at 600 and 2600 Hz (S2 of the reference).
fn impulses() -> Vec<f64> {
    let mut samples = vec![0.0; SAMPLES];
    for (start, amplitude) in (200..SAMPLES).step_by(700).zip([1.0, -1.0, 1.0, -1.0, 1.0]) {
        samples[start] += 50.0 * amplitude;
        for (n, sample) in samples[start..].iter_mut().enumerate() {
            let t = n as f64 / RATE_HZ;
            *sample += 5.0
                * amplitude
                * ((-800.0 * t).exp() * (TAU * 600.0 * t).sin()
                    + 0.5 * (-2500.0 * t).exp() * (TAU * 2600.0 * t).sin());
        }
    }
    samples
}

fn compare(reference: &Value, key: &str, bins: Range<usize>, values: &[f64]) {
    let expected = reference[key].as_array().unwrap_or_else(|| panic!("{key} is missing"));
    assert_eq!(expected.len(), bins.len());
    for (expected, value) in expected.iter().zip(&values[bins]) {
        let expected = expected.as_f64().unwrap();
        assert!((value - expected).abs() <= TOLERANCE * expected, "{key}: {value}, not {expected}");
    }
}

#[test]
fn the_literal_transform_equals_the_reference() {
    let reference = reference();
    let wavelet = Morlet::new(6.0);
    let scales_s: Vec<_> =
        (0..=528).map(|j| 2.0 / RATE_HZ * (f64::from(j) / f64::from(VOICES)).exp2()).collect();
    let first = usize::try_from(reference["band_first_index"].as_u64().unwrap()).unwrap();
    let bins = first..first + reference["freqs_hz"].as_array().unwrap().len();
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<_>>();
    let signals = [
        ("S1", tones_and_chirp()),
        ("S2", impulses()),
        ("S3", sum(&tones_and_chirp(), &impulses())),
    ];
    for (name, samples) in signals {
        for (padded, padding) in
            [("zero", Padding::Zeros(4096)), ("reflect8192", Padding::Reflected(8192))]
        {
            let cwt = Cwt::new(&samples, RATE_HZ, padding, wavelet, &scales_s);
            for (window, columns) in [("full", 0..SAMPLES), ("mid", 871..2614)] {
                let key = format!("{name}_{padded}_cwt_L2pow_{window}");
                compare(&reference, &key, bins.clone(), &cwt.coefficients.mean_power(columns));
            }
            for (kind, normalisation) in
                [("noDw", Normalisation::Sum), ("A4", Normalisation::Printed)]
            {
                let conventions = Conventions { normalisation, threshold: 1e-8 };
                let squeezed = squeeze(&cwt, wavelet, VOICES, conventions);
                for (window, columns) in [("full", 0..SAMPLES), ("mid", 871..2614)] {
                    let key = format!("{name}_{padded}_lwps_{kind}_{window}");
                    compare(&reference, &key, bins.clone(), &squeezed.mean_power(columns));
                }
            }
        }
    }
}
