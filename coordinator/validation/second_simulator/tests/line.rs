//! Lines are recorded as what they are, and hidden effects change their recordings where they should.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::{Chain, Hidden, Scene};
use tracktwin_second_simulator::{record, simulate};
use tracktwin_signal::recording::{Pass, Recording};

/// Spans of a short line, and where its recording begins and ends in spans.
const SPANS: usize = 26;
const RECORDED: [f64; 2] = [12.0, 19.0];
/// Place of every local effect in spans: sleeper 15.
const AT: f64 = 16.0;

/// One pass at the highest speed over a part of a typical line.
fn scene(preset: Preset, left_out: Vec<Hidden>) -> Scene {
    let mut scene = Scene::typical_line(preset, 7);
    scene.spans = SPANS;
    scene.sleepers.truncate(SPANS - 1);
    scene.passes.truncate(1);
    scene.recorded_m = RECORDED.map(|span| span * scene.spacing_m());
    scene.left_out = left_out;
    scene
}

fn pass(left_out: Vec<Hidden>) -> Pass {
    let scene = Scene { chain: Chain::ideal(), ..scene(Preset::Concrete60E1, left_out) };
    simulate(&scene).unwrap().passes.remove(0)
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

#[test]
fn every_line_is_recorded_as_what_it_is() {
    let lines = Preset::ALL.iter().filter(|it| !matches!(it, Preset::VTrack | Preset::RealScale));
    for &preset in lines {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("line");
        record(&scene(preset, Vec::new()), &path).unwrap();
        let read = Recording::open(&path).unwrap();
        assert_eq!(read.doubts, Vec::<String>::new(), "{preset:?}");
        read.check_track(&preset.design()).unwrap();
        let stated = read.stated_track().track.design.wheel;
        assert_eq!(stated.further_wheels_m, preset.design().wheel.further_wheels_m, "{preset:?}");
        assert_eq!((read.sample_rate_hz, read.sleepers.len()), (25_600.0, 8), "{preset:?}");
        assert_eq!(read.sleepers[0].id, "SN11");
        let samples = read.passes[0].signal.samples();
        let square = samples.iter().map(|a| a * a).sum::<f64>() / samples.len() as f64;
        assert!((1.0..100.0).contains(&square.sqrt()), "{preset:?}: {}", square.sqrt());
    }
}

#[test]
fn the_same_line_is_the_same_recording_to_the_bit() {
    let [one, other] = [0; 2].map(|_| simulate(&scene(Preset::Concrete60E1, Vec::new())).unwrap());
    assert_eq!(one.passes[0].signal, other.passes[0].signal);
    assert_eq!(one.passes[0].position_m, other.passes[0].position_m);
}

#[test]
fn local_effects_are_heard_where_they_are() {
    let at_m = AT * 0.6;
    let x_m = [at_m; 2];
    let sleepers = vec![15];
    let local = [
        Hidden::RailJoint {
            x_m,
            dip_m: 5e-4,
            length_m: 0.1,
            bending_factor: 0.4,
            bending_length_m: 0.2,
        },
        Hidden::Squat { x_m, depth_m: 2e-4, length_m: 0.04 },
        Hidden::Corrugation { x_m: [9.3, 9.9], wavelength_m: 0.04, amplitude_m: 2e-5 },
        Hidden::MissingRailpad { sleepers: sleepers.clone(), stiffness_n_per_m: 2e7 },
        Hidden::HangingSleeper { sleepers: sleepers.clone(), gap_m: 1e-3 },
        Hidden::SubgradeLayer {
            sleepers: Some(sleepers.clone()),
            mass_kg: 500.0,
            stiffness_n_per_m: 8e7,
            damping_n_s_per_m: 3e4,
        },
        // From some 300 Hz on the rail carries waves to every place of this recording.
        Hidden::RailAbsorber { x_m, mass_kg: 20.0, frequency_hz: 200.0, damping_ratio: 0.05 },
        Hidden::CrackedSleeper { sleepers, bending_factor: 0.02 },
    ];
    let base = pass(Vec::new());
    for hidden in local {
        let name = hidden.physics();
        let change = difference(&pass(vec![hidden]), &base);
        let share =
            |x_m: f64| rms(&base, &change, x_m, 0.6) / rms(&base, base.signal.samples(), x_m, 0.6);
        let [near, far] = [share(at_m), share(7.8)];
        assert!(near > 0.02, "{name}: {near} near, {far} far");
        assert!(far < 0.4 * near, "{name}: {near} near, {far} far");
    }
}

#[test]
fn a_flat_strikes_once_a_turn_of_a_line_s_wheel() {
    let mut scene = scene(Preset::Concrete60E1, vec![Hidden::WheelFlat { length_m: 0.04 }]);
    scene.chain = Chain::ideal();
    scene.irregularity_level = 1e-3;
    let pass = simulate(&scene).unwrap().passes.remove(0);
    let samples = pass.signal.samples();
    let jumps: Vec<f64> = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let largest = jumps.iter().copied().fold(0.0, f64::max);
    let strikes = jumps.iter().zip(&pass.position_m).filter(|(jump, _)| **jump > 0.5 * largest);
    let places: Vec<f64> = strikes.map(|(_, x_m)| *x_m).collect();
    let turn_m = std::f64::consts::TAU * 0.46;
    // 4.2 m are recorded: one turn or two.
    let apart: Vec<f64> =
        places.windows(2).map(|it| it[1] - it[0]).filter(|it| *it > 0.3).collect();
    assert!(!places.is_empty(), "{places:?}");
    assert!(apart.iter().all(|way_m| (way_m / turn_m - 1.0).abs() < 0.03), "{apart:?}");
}
