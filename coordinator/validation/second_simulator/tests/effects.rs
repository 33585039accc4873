//! Every hidden effect changes the recording, and where it should.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use tracktwin_reference_simulator::{Hidden, Scene, SleeperTruth, TruthError};
use tracktwin_second_simulator::{record, simulate};
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_signal::{PowerSpectrum, Signal};

/// Place of every local effect in m: sleeper 9.
const AT_M: f64 = 1.25;

fn scene(left_out: Vec<Hidden>) -> Scene {
    let sleeper = SleeperTruth {
        railpad_stiffness_n_m: 1.5e8,
        ballast_stiffness_n_m: 1.2e7,
        sleeper_ei_n_m2: 5000.0,
    };
    Scene { recorded_m: [0.5, 1.75], left_out, ..Scene::uniform(18, sleeper) }
}

fn pass(left_out: Vec<Hidden>) -> Pass {
    simulate(&scene(left_out)).unwrap().passes.remove(0)
}

/// Root mean square of the values whose positions are within `reach_m` of `x_m`.
fn rms(pass: &Pass, values: &[f64], x_m: f64, reach_m: f64) -> f64 {
    let near = pass.position_m.iter().zip(values).filter(|(x, _)| (*x - x_m).abs() < reach_m);
    let squares: Vec<f64> = near.map(|(_, value)| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn difference(a: &Pass, b: &Pass) -> Vec<f64> {
    assert_eq!(a.position_m, b.position_m);
    a.signal.samples().iter().zip(b.signal.samples()).map(|(a, b)| a - b).collect()
}

/// Level in dB in a one-third octave.
fn level(signal: &Signal, centre_hz: f64) -> f64 {
    PowerSpectrum::welch(signal, 8192).unwrap().third_octave_level(centre_hz).unwrap()
}

#[test]
fn local_effects_are_heard_where_they_are() {
    let x_m = [AT_M, AT_M];
    let sleepers = vec![9];
    let local = [
        Hidden::RailJoint {
            x_m,
            dip_m: 8e-5,
            length_m: 0.02,
            bending_factor: 0.2,
            bending_length_m: 0.025,
        },
        Hidden::Squat { x_m, depth_m: 5e-5, length_m: 0.03 },
        Hidden::Corrugation { x_m: [1.15, 1.35], wavelength_m: 4e-3, amplitude_m: 3e-6 },
        Hidden::FasteningClamp {
            sleepers: sleepers.clone(),
            vertical_n_per_m: 1.5e8,
            rotational_n_m_per_rad: 3e5,
        },
        Hidden::MissingRailpad { sleepers: sleepers.clone(), stiffness_n_per_m: 1e7 },
        Hidden::SleeperBolt { sleepers: sleepers.clone(), stiffness_n_per_m: 3e7 },
        Hidden::HangingSleeper { sleepers: sleepers.clone(), gap_m: 1e-4 },
        Hidden::SubgradeLayer {
            sleepers: Some(sleepers.clone()),
            mass_kg: 3.0,
            stiffness_n_per_m: 2e7,
            damping_n_s_per_m: 1e3,
        },
        Hidden::RailAbsorber { x_m, mass_kg: 0.5, frequency_hz: 900.0, damping_ratio: 0.05 },
        Hidden::CrackedSleeper { sleepers, bending_factor: 0.1 },
        Hidden::LinkedSleepers { sleepers: [9, 10], stiffness_n_per_m: 1e8 },
    ];
    let base = pass(Vec::new());
    for hidden in local {
        let name = hidden.physics();
        let changed = pass(vec![hidden]);
        let change = difference(&changed, &base);
        let near = rms(&base, &change, AT_M, 0.12) / rms(&base, base.signal.samples(), AT_M, 0.12);
        let far = rms(&base, &change, 0.6, 0.1) / rms(&base, base.signal.samples(), 0.6, 0.1);
        assert!(near > 0.02, "{name}: {near} near, {far} far");
        assert!(far < 0.4 * near, "{name}: {near} near, {far} far");
    }
}

#[test]
fn effects_without_a_place_are_heard_everywhere() {
    let everywhere = [
        Hidden::SubgradeLayer {
            sleepers: None,
            mass_kg: 3.0,
            stiffness_n_per_m: 2e7,
            damping_n_s_per_m: 1e3,
        },
        Hidden::FlexibleAxleBox { mass_kg: 4.0, stiffness_n_per_m: 4e8, damping_n_s_per_m: 2e3 },
        Hidden::FrequencyDependentRailpad { stiffness_ratio: 1.0, relaxation_time_s: 1e-4 },
        Hidden::LoadDependentRailpad { exponent: 0.5, reference_load_n: 1000.0, toe_load_n: 200.0 },
        Hidden::RailCrossSection {
            frequency_hz: 1800.0,
            stiffness_n_per_m: 4e8,
            loss_factor: 0.05,
        },
        Hidden::WheelMode { frequency_hz: 1200.0, mass_kg: 10.0, damping_ratio: 0.01 },
        Hidden::WheelOutOfRound { order: 12, amplitude_m: 2e-5 },
        Hidden::SensorMountResonance { frequency_hz: 2500.0, damping_ratio: 0.05 },
    ];
    let base = pass(Vec::new());
    for hidden in everywhere {
        let name = hidden.physics();
        let changed = pass(vec![hidden]);
        for x_m in [0.7, 1.5] {
            let change = rms(&base, &difference(&changed, &base), x_m, 0.15);
            let share = change / rms(&base, base.signal.samples(), x_m, 0.15);
            assert!(share > 0.02, "{name}: {share} at {x_m} m");
        }
    }
}

#[test]
fn waves_and_resonances_have_their_frequencies() {
    let base = pass(Vec::new());
    let raised = |hidden: Hidden, centre_hz: f64| {
        let changed = pass(vec![hidden]);
        level(&changed.signal, centre_hz) - level(&base.signal, centre_hz)
    };
    // 3.61 m/s over waves of 4.5 mm.
    let waves = Hidden::Corrugation { x_m: [0.6, 1.6], wavelength_m: 4.5e-3, amplitude_m: 3e-6 };
    assert!(raised(waves, 800.0) > 10.0);
    let mount = Hidden::SensorMountResonance { frequency_hz: 2500.0, damping_ratio: 0.03 };
    assert!(raised(mount, 2500.0) > 10.0);
    let hum = Hidden::ElectricalHum { frequency_hz: 150.0, amplitude_m_s2: 10.0 };
    assert!(raised(hum, 150.0) > 3.0);
}

#[test]
fn a_flat_strikes_once_a_turn() {
    let mut scene = scene(vec![Hidden::WheelFlat { length_m: 8e-3 }]);
    scene.irregularity_level = 1e-3;
    let pass = simulate(&scene).unwrap().passes.remove(0);
    // Differences of samples: the track still rings slowly when the flat comes again.
    let samples = pass.signal.samples();
    let jumps: Vec<f64> = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let largest = jumps.iter().copied().fold(0.0, f64::max);
    let strikes: Vec<f64> = jumps
        .iter()
        .zip(&pass.position_m)
        .filter(|(jump, _)| **jump > 0.5 * largest)
        .map(|(_, x)| *x)
        .collect();
    let turn_m = std::f64::consts::TAU * 0.065;
    let apart: Vec<f64> =
        strikes.windows(2).map(|pair| pair[1] - pair[0]).filter(|way| *way > 0.1).collect();
    assert!(apart.len() >= 2, "{strikes:?}");
    assert!(apart.iter().all(|way| (way / turn_m - 1.0).abs() < 0.03), "{apart:?}");
}

#[test]
fn faults_of_the_chain_are_as_stated() {
    let base = pass(Vec::new());
    let values = base.signal.samples();
    let gained = pass(vec![Hidden::GainError { factor: 1.3, pass: Some(0) }]);
    for (gained, value) in gained.signal.samples().iter().zip(values) {
        assert!((gained - 1.3 * value).abs() < 1e-9);
    }
    assert_eq!(pass(vec![Hidden::GainError { factor: 1.3, pass: Some(1) }]).signal, base.signal);

    let limit = 0.5 * values.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let clipped = pass(vec![Hidden::Clipping { limit_m_s2: limit }]);
    for (clipped, value) in clipped.signal.samples().iter().zip(values) {
        assert_eq!(*clipped, value.clamp(-limit, limit));
    }

    let fault = Hidden::PositionError { offset_m: 0.02, scale: 0.01, pass: None };
    let shifted = pass(vec![fault]).position_m;
    let first = base.position_m[0];
    for (shifted, x) in shifted.iter().zip(&base.position_m) {
        assert!((shifted - x - 0.02 - 0.01 * (x - first)).abs() < 1e-12);
    }
}

#[test]
fn a_scene_is_recorded_as_a_careful_measurement_and_repeats_to_the_bit() {
    let mut scene = scene(Vec::new());
    scene.chain = tracktwin_reference_simulator::Chain::default();
    scene.passes = vec![scene.passes[0]; 2];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("truth");
    record(&scene, &path).unwrap();
    let read = Recording::open(&path).unwrap();
    assert_eq!(read.doubts, Vec::<String>::new());
    assert_eq!(read.sleepers[0].id, "SN3");
    assert_eq!(read.sleepers.len(), 11);
    let again = simulate(&scene).unwrap();
    for (read, again) in read.passes.iter().zip(&again.passes) {
        assert_eq!(read.position_m, again.position_m);
        let single = |value: &f64| f64::from(*value as f32);
        let expected: Vec<f64> = again.signal.samples().iter().map(single).collect();
        assert_eq!(read.signal.samples(), expected);
    }
    assert_ne!(again.passes[0].signal, again.passes[1].signal);
    for (x, place) in again.passes[0].position_m.iter().zip(1_u32..) {
        let even = again.passes[0].position_m[0] + f64::from(place) * 13.0 / 3.6 * 1e-5;
        assert!((x - even).abs() < 0.02);
    }
}

#[test]
fn what_it_cannot_carry_is_refused_by_name() {
    let link = Hidden::LinkedSleepers { sleepers: [3, 4], stiffness_n_per_m: 1e9 };
    let error = simulate(&scene(vec![link])).unwrap_err();
    assert!(matches!(error, TruthError::TooLarge { .. }));
    assert!(error.to_string().contains("linked_sleepers"), "{error}");
    let pads =
        Hidden::LoadDependentRailpad { exponent: 1.5, reference_load_n: 1000.0, toe_load_n: 200.0 };
    assert!(simulate(&scene(vec![pads])).unwrap_err().to_string().contains("load_dependent"));
}
