//! A small library of noise whose power is the level and whose tilt is the railpad's, for tests.

use tracktwin_parameters::{Parameter, Scale};
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
use tracktwin_surrogate::{FeatureColumns, TrainOptions, Trained, TrainingSet, train};

pub(crate) const SPEEDS_KM_H: [f64; 2] = [10.0, 13.0];
const RATE_HZ: f64 = 10_000.0;
const ENTRIES: u32 = 300;

pub(crate) fn extractor() -> Extractor {
    Extractor::new(&definition()).unwrap()
}

fn definition() -> FeatureDefinition {
    FeatureDefinition {
        voices_per_octave: 4,
        reference_rate_hz: RATE_HZ,
        lowest_hz: 200.0,
        highest_hz: 1000.0,
        instant_rate_hz: 4000.0,
        margin_s: 0.01,
        ..FeatureDefinition::default()
    }
}

/// Noise of unit mean square times `sqrt(level)`, its neighbours correlated by `tilt`.
fn noise(seed: u32, samples: usize, level: f64, tilt: f64) -> Signal {
    let mut state = u64::from(seed) * 0x9e37_79b9 + 12345;
    let mut previous = 0.0;
    let values = (0..samples).map(|_| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let uniform = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        previous = tilt * previous + (1.0 - tilt * tilt).sqrt() * uniform * 12.0_f64.sqrt();
        previous * level.sqrt()
    });
    Signal::new(RATE_HZ, values.collect()).unwrap()
}

fn window_samples(speed_km_h: f64) -> usize {
    (0.125 / (speed_km_h / 3.6) * RATE_HZ) as usize
}

/// A recording of seven sleepers, SN0 at the very beginning; a pass a speed.
pub(crate) fn recording(level: f64, speeds_km_h: &[f64]) -> Recording {
    long_recording(level, speeds_km_h, 7)
}

/// A recording as made by [`recording`], with any number of sleepers.
pub(crate) fn long_recording(level: f64, speeds_km_h: &[f64], sleepers: u32) -> Recording {
    let pass = |(number, &speed_km_h): (usize, &f64)| {
        let samples = window_samples(speed_km_h) * (sleepers as usize - 1);
        let seed = 5000 + number as u32;
        let step_m = speed_km_h / 3.6 / RATE_HZ;
        Pass {
            file: format!("pass-{number}"),
            speed_km_h,
            axle: None,
            signal: noise(seed, samples, level, 0.5),
            position_m: (0..samples).map(|index| index as f64 * step_m).collect(),
            contact_loss_share: None,
        }
    };
    let sleeper = |index: u32| Sleeper { id: format!("SN{index}"), x_m: f64::from(index) * 0.125 };
    Recording {
        name: "noise".to_owned(),
        sample_rate_hz: RATE_HZ,
        channel: String::new(),
        passes: speeds_km_h.iter().enumerate().map(pass).collect(),
        sleepers: (0..sleepers).map(sleeper).collect(),
        nominal: serde_json::Map::new(),
        spacing_m: 0.125,
        doubts: Vec::new(),
    }
}

/// Entries of known level and tilt at both speeds.
pub(crate) fn library() -> TrainingSet {
    let extractor = extractor();
    let share = |entry: u32, step: f64| (f64::from(entry) * step).fract();
    let level = |entry| 1.0 + 4.0 * share(entry, 0.618_034);
    let tilt = |entry| 0.8 * share(entry, 0.754_878);
    let table = |(index, &speed): (usize, &f64)| {
        let window = window_samples(speed);
        (0..ENTRIES)
            .flat_map(|entry| {
                let seed = 2 * entry + index as u32;
                let signal = noise(seed, 3 * window, level(entry), tilt(entry));
                extractor.extract(&signal, window..2 * window).unwrap().log_power
            })
            .collect()
    };
    TrainingSet {
        frequencies_hz: definition().frequencies_hz(),
        speeds_km_h: SPEEDS_KM_H.to_vec(),
        log_power: SPEEDS_KM_H.iter().enumerate().map(table).collect(),
        varied: vec![Parameter::RailpadStiffness, Parameter::IrregularityLevel],
        scales: vec![Scale::Linear; 2],
        parameters: (0..ENTRIES).flat_map(|entry| [1e8 * tilt(entry), level(entry)]).collect(),
        campaign: "noise".to_owned(),
        library_digest: "1234".to_owned(),
        feature_definition: serde_json::to_value(definition()).unwrap(),
    }
}

pub(crate) fn models(library: &TrainingSet) -> Trained {
    let all = FeatureColumns::new("GF", 0..library.frequencies_hz.len());
    train(library, &TrainOptions::new(vec![all]), &|_| ()).unwrap()
}
