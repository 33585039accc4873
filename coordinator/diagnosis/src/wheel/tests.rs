//! Wheels whose truth is known.

use super::{flat, nominal_circumference_m, out_of_round};
use crate::along::testing::{Rolled, hollow_m, shared};
use std::f64::consts::TAU;

const ALPHA: f64 = 0.0025;
const TURN_M: f64 = Rolled::CIRCUMFERENCE_M;

/// Distance along the tread from a flat that each pass meets at another phase.
fn from_flat(pass: usize, x: f64) -> f64 {
    let phase = 0.1 * pass as f64;
    (x - phase + 0.5 * TURN_M).rem_euclid(TURN_M) - 0.5 * TURN_M
}

#[test]
fn a_flat_is_found_whatever_its_phase_in_each_pass() {
    let height = |pass, x| hollow_m(1.2e-5, 3.5e-3, from_flat(pass, x));
    let recording = Rolled { height_m: &height, ..Rolled::faultless(1) }.recording();
    // The nominal circumference is one per cent off.
    let found = flat(&recording, 1.01 * TURN_M, ALPHA).unwrap();
    assert!((found.circumference_m.0 / TURN_M - 1.0).abs() < 2e-3, "{:?}", found.circumference_m);
    let length = found.shape.unwrap().length_m.0;
    assert!((length / 3.5e-3 - 1.0).abs() < 0.1, "{length}");
}

#[test]
fn two_impacts_of_the_track_a_turn_apart_are_no_flat() {
    let height = |_, x| hollow_m(2e-5, 6e-3, x - 1.0) + hollow_m(2e-5, 6e-3, x - 1.0 - TURN_M);
    let recording = Rolled { height_m: &height, ..Rolled::faultless(2) }.recording();
    assert!(flat(&recording, TURN_M, ALPHA).is_none());
}

#[test]
fn an_uneven_wheel_has_its_order_and_its_amplitude() {
    let height = |pass, x: f64| 5e-6 * (TAU * 12.0 * x / TURN_M + pass as f64).cos();
    let recording = Rolled { height_m: &height, ..Rolled::faultless(3) }.recording();
    let found = out_of_round(&recording, TURN_M, ALPHA);
    assert_eq!(found.iter().map(|order| order.number).collect::<Vec<_>>(), [12]);
    // Neighbours of a single line are known to a quarter in power.
    assert!((found[0].amplitude_m.0 / 5e-6 - 1.0).abs() < 0.4, "{found:?}");
}

#[test]
fn a_round_wheel_has_neither_flat_nor_orders() {
    for seed in 10..20 {
        let recording = Rolled::faultless(seed).recording();
        assert!(flat(&recording, TURN_M, ALPHA).is_none(), "seed {seed}");
        assert!(out_of_round(&recording, TURN_M, ALPHA).is_empty(), "seed {seed}");
    }
}

#[test]
fn the_flat_of_an_independent_recording_is_measured() {
    let Some(recording) = shared("dev-09") else { return };
    let nominal = nominal_circumference_m(&recording).unwrap();
    let found = flat(&recording, nominal, ALPHA).unwrap();
    assert!((found.circumference_m.0 / nominal - 1.0).abs() < 2e-3, "{:?}", found.circumference_m);
    let length = found.shape.unwrap().length_m.0;
    // The grid of lengths is 3.6 % wide.
    assert!((length / 3.5e-3 - 1.0).abs() < 0.04, "{length}");
}

#[test]
fn a_scratch() {
    use tracktwin_signal::recording::import::*;
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/real/aba-k1/aba-k1.csv");
    let layout = Layout {
        acceleration: vec!["acc_left".into(), "acc_right".into()],
        time: Some("t_s".into()),
        speed: Some("speed_kmh".into()),
        acceleration_unit: AccelerationUnit::Unknown,
        ..Layout::default()
    };
    for imported in import(&[file], &layout).unwrap() {
        let start = std::time::Instant::now();
        println!("{:#?} {:?}", super::comb(&imported.recording.passes[0], 0.01), start.elapsed());
        println!("{:?} {:?}", crate::chain::hum(&imported.recording, 0.01), start.elapsed());
        println!("{:?}", crate::first_look(&imported.recording));
    }
}
