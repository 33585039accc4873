//! Domain check of features, with a library of one resonance.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use tracktwin_parameters::{Parameter, Scale};
use tracktwin_surrogate::{Beyond, Domain, Judgement, Side, TrainingSet};

const BINS: usize = 32;
const ENTRIES: usize = 600;

/// Pseudo-random numbers from -0.5 to 0.5.
fn noise(index: usize) -> f64 {
    ((index as f64 + 1.0) * 12.9898).sin() * 43_758.545_3 % 1.0 * 0.5
}

/// A resonance whose frequency is the ballast's and whose height the level's.
fn features(stiffness: f64, level: f64, window: usize) -> Vec<f64> {
    let middle = 16.0 + 8.0 * (stiffness / 1e7).ln();
    let value = |bin: usize| {
        let away = (bin as f64 - middle) / 12.0;
        level.ln() + 2.0 / (1.0 + away * away) + noise(window * BINS + bin)
    };
    (0..BINS).map(value).collect()
}

/// Ballast from 5 to 20 MN/m, levels from 1 to 5.
fn library() -> TrainingSet {
    let place = |entry: usize, step: f64| (entry as f64 * step).fract();
    let case =
        |entry| (5e6 * 4f64.powf(place(entry, 0.618_034)), 1.0 + 4.0 * place(entry, 0.754_878));
    let cases: Vec<(f64, f64)> = (0..ENTRIES).map(case).collect();
    let log_power = cases.iter().enumerate().flat_map(|(n, &(k, a))| features(k, a, n));
    TrainingSet {
        frequencies_hz: (0..BINS).map(|bin| 100.0 * 1.1f64.powf(bin as f64)).collect(),
        speeds_km_h: vec![10.0],
        log_power: vec![log_power.collect()],
        varied: vec![Parameter::BallastStiffness, Parameter::IrregularityLevel],
        scales: vec![Scale::Linear; 2],
        parameters: cases.iter().flat_map(|&(stiffness, level)| [stiffness, level]).collect(),
        campaign: "resonance".to_owned(),
        library_digest: "1".to_owned(),
        feature_definition: serde_json::Value::Null,
    }
}

/// Result of the domain check for seven windows of a track with noise that the library does not contain.
fn judged(domain: &Domain, track: usize, window: impl Fn(usize) -> Vec<f64>) -> Judgement {
    let mut mean = vec![0.0; domain.coordinates(&window(0)).unwrap().len()];
    for number in 0..7 {
        let features = window(ENTRIES + 7 * track + number);
        let coordinates = domain.coordinates(&features).unwrap();
        mean.iter_mut().zip(coordinates).for_each(|(sum, value)| *sum += value / 7.0);
    }
    domain.judge(&mean, 7, 0.01).unwrap()
}

#[test]
fn tracks_of_the_library_s_kind_are_seldom_called_outside() {
    let domain = Domain::of(&library(), &[0]).unwrap();
    let outside = (0..100).filter(|&track| {
        let stiffness = 5e6 * 4f64.powf((track as f64 * 0.569_84).fract());
        let level = 1.0 + 4.0 * (track as f64 * 0.381_97).fract();
        judged(&domain, track, |n| features(stiffness, level, n)).is_outside()
    });
    // One of a hundred is expected; more than four have a probability of 0.3 %.
    assert!(outside.count() <= 4);
}

#[test]
fn tracks_beyond_an_end_are_called_outside_by_its_name() {
    let domain = Domain::of(&library(), &[0]).unwrap();
    for (stiffness, level, parameter, side) in [
        (3.5e6, 3.0, Parameter::BallastStiffness, Side::Low),
        (26e6, 3.0, Parameter::BallastStiffness, Side::High),
        (1e7, 0.5, Parameter::IrregularityLevel, Side::Low),
        (1e7, 8.0, Parameter::IrregularityLevel, Side::High),
    ] {
        for track in 0..5 {
            let judgement = judged(&domain, track, |n| features(stiffness, level, n));
            let named = Some(Beyond { parameter, side });
            assert_eq!(judgement.beyond, named, "{stiffness} {level}");
        }
    }
}

#[test]
fn a_shape_that_no_parameter_makes_is_outside() {
    let domain = Domain::of(&library(), &[0]).unwrap();
    let judgement = judged(&domain, 0, |n| {
        let odd = |(bin, value): (usize, f64)| value + if bin % 8 < 4 { 0.6 } else { -0.6 };
        features(1e7, 3.0, n).into_iter().enumerate().map(odd).collect()
    });
    assert!(judgement.misfit > 1.0, "{judgement:?}");
}
