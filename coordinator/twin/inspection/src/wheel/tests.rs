//! Wheels whose truth is known.

use super::{CIRCUMFERENCES_M, Comb, Order, flat, nominal_circumference_m, out_of_round};
use crate::along::testing::{LongPass, Rolled, hollow_m, independent};
use std::f64::consts::TAU;
use test_needs::shared_data;
use tracktwin_signal::recording::Pass;
use tracktwin_signal::recording::import::{AccelerationUnit, Layout, import};

const ALPHA: f64 = 0.0025;
const TURN_M: f64 = Rolled::CIRCUMFERENCE_M;

fn numbers(orders: &[Order]) -> Vec<usize> {
    orders.iter().map(|order| order.number).collect()
}

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
    assert_eq!(numbers(&found), [12]);
    // Neighbours of a single line are known to a quarter in power.
    assert!((found[0].amplitude_m.0 / 5e-6 - 1.0).abs() < 0.4, "{found:?}");
}

#[test]
fn a_high_order_is_found_though_the_sleepers_pass_in_its_waves() {
    // 11.02 waves to a span.
    let height = |pass, x: f64| 1e-6 * (TAU * 36.0 * x / TURN_M + pass as f64).cos();
    let recording = Rolled { height_m: &height, ..Rolled::faultless(4) }.recording();
    let waves = 36.0 * recording.spacing_m / TURN_M;
    assert!((waves - waves.round()).abs() < 0.05, "{waves}");
    let found = out_of_round(&recording, TURN_M, ALPHA);
    assert_eq!(numbers(&found), [36]);
    assert!(found[0].turns);
}

#[test]
fn a_wheel_that_begins_every_pass_with_the_same_side_down_is_heard_as_well() {
    let height = |_, x: f64| 3e-6 * (TAU * 30.0 * x / TURN_M).cos();
    let recording = Rolled { height_m: &height, ..Rolled::faultless(5) }.recording();
    let found = out_of_round(&recording, TURN_M, ALPHA);
    assert_eq!(numbers(&found), [30]);
    // Corrugation of the whole rail is heard in the same way.
    assert!(!found[0].turns && (found[0].share_of_lengths() - 0.3).abs() < 1e-12);
}

#[test]
fn waves_far_below_the_surface_are_found_in_what_two_passes_differ_by() {
    let height = |pass, x: f64| 5e-8 * (TAU * 30.0 * x / TURN_M + 2.0 * pass as f64).cos();
    let recording = Rolled { height_m: &height, ..Rolled::faultless(5) }.recording();
    let found = out_of_round(&recording, TURN_M, ALPHA);
    assert_eq!(numbers(&found), [30]);
    // A hundredfold, all that is beside the line in the difference is its own side lobes.
    let height = |pass, x: f64| 5e-6 * (TAU * 30.0 * x / TURN_M + 2.0 * pass as f64).cos();
    let loud = Rolled { height_m: &height, ..Rolled::faultless(5) }.recording();
    let found = out_of_round(&loud, TURN_M, ALPHA);
    assert_eq!(numbers(&found), [30]);
    let mut single = recording;
    single.passes = single.passes.into_iter().step_by(2).collect();
    assert!(out_of_round(&single, TURN_M, ALPHA).is_empty());
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
    for recording in independent("dev-09") {
        let nominal = nominal_circumference_m(&recording).unwrap();
        let found = flat(&recording, nominal, ALPHA).unwrap();
        assert!(
            (found.circumference_m.0 / nominal - 1.0).abs() < 2e-3,
            "{:?}",
            found.circumference_m
        );
        let (length, deviation) = found.shape.unwrap().length_m;
        // The slope of the surface's spectrum is estimated.
        assert!((length / 3.5e-3 - 1.0).abs() < 0.15, "{length}");
        assert!((0.1..0.2).contains(&(deviation / length)), "{deviation}");
    }
}

/// A minute of a wheel at a speed that grows from 66 to 68 km/h.
fn long_pass(seed: u64, amplitude: f64, waves_per_m: &[f64]) -> Pass {
    LongPass { seed, speeds_km_h: [66.0, 68.0], amplitude, waves_per_m }.pass()
}

fn comb(pass: &Pass) -> Option<Comb> {
    super::comb(pass, 0.6, CIRCUMFERENCES_M, ALPHA)
}

#[test]
fn the_circumference_of_an_unknown_wheel_is_found_and_predicts_what_was_held_out() {
    let orders: Vec<f64> = (7..=20).map(|order| f64::from(order) / 2.9).collect();
    let found = comb(&long_pass(8, 0.1, &orders)).unwrap();
    // A speed in whole km/h is off by up to 0.75 %.
    assert!((found.circumference_m.0 / 2.9 - 1.0).abs() < 0.01, "{:?}", found.circumference_m);
    let held_out = found.held_out;
    assert!(held_out.explained > 2.0 * held_out.by_chance, "{held_out:?}");
    assert!(held_out.gain_nats > 0.0 && held_out.better > held_out.blocks * 3 / 4, "{held_out:?}");
}

#[test]
fn noise_has_no_comb() {
    for seed in 0..20 {
        assert_eq!(comb(&long_pass(seed, 0.0, &[])), None, "seed {seed}");
    }
}

#[test]
fn sleepers_have_no_comb_of_a_wheel() {
    let harmonics: Vec<f64> = (1..=5).map(|harmonic| f64::from(harmonic) / 0.6).collect();
    for amplitude in [0.1, 0.2, 0.5] {
        let pass = long_pass(8, amplitude, &harmonics);
        assert_eq!(comb(&pass), None, "{amplitude}");
        // Lines of sleepers at another distance than stated are not left out, but predict no withheld block.
        for stated_m in [0.5, 0.55, 0.65, 0.7] {
            let found = super::comb(&pass, stated_m, CIRCUMFERENCES_M, ALPHA);
            assert_eq!(found, None, "{amplitude} {stated_m}");
        }
    }
}

#[test]
fn a_wheel_that_turns_once_in_five_sleepers_has_a_comb() {
    let orders: Vec<f64> = (7..=20).map(|order| f64::from(order) / 3.0).collect();
    let found = comb(&long_pass(8, 0.1, &orders)).unwrap();
    assert!((found.circumference_m.0 / 3.0 - 1.0).abs() < 0.01, "{:?}", found.circumference_m);
}

#[test]
fn the_wheel_of_a_real_recording_is_found_on_both_sides() {
    let Some(shared) = shared_data() else { return };
    let file = shared.join("real/aba-k1/aba-k1.csv");
    let layout = Layout {
        acceleration: vec!["acc_left".to_owned(), "acc_right".to_owned()],
        time: Some("t_s".to_owned()),
        speed: Some("speed_kmh".to_owned()),
        acceleration_unit: Some(AccelerationUnit::Unknown),
        ..Layout::default()
    };
    for imported in import(&[file], &layout).unwrap() {
        let found = comb(&imported.recording.passes[0]).unwrap();
        // 6.545 Hz by hand, at 67 to 69 km/h.
        assert!((found.fundamental_hz / 6.545 - 1.0).abs() < 5e-3, "{}", found.fundamental_hz);
        assert!((found.circumference_m.0 / 2.86 - 1.0).abs() < 0.02, "{:?}", found.circumference_m);
        let held_out = found.held_out;
        assert!(held_out.explained > 2.0 * held_out.by_chance, "{held_out:?}");
        assert!(held_out.gain_nats > 0.0, "{held_out:?}");
    }
}
