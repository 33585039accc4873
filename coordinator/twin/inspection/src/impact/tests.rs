//! Impacts and corrugation of surfaces whose truth is known.

use super::{Form, Impact, corrugation, impacts};
use crate::along::testing::{LongPass, Rolled, hollow_m, independent};
use std::f64::consts::TAU;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::Recording;

/// The share of false alarms that a single test has in the sweep.
const ALPHA: f64 = 0.0025;

fn rolled(seed: u64, height: &dyn Fn(usize, f64) -> f64) -> Vec<Impact> {
    let surface = Rolled { height_m: height, ..Rolled::faultless(seed) };
    impacts(&surface.recording(), ALPHA, &[])
}

#[test]
fn a_hollow_is_found_at_its_place_with_its_length_and_depth() {
    let found = rolled(1, &|_, x| hollow_m(2e-5, 6e-3, x - 1.7));
    assert_eq!(found.len(), 1, "{found:?}");
    let shape = found[0].shape.clone().unwrap();
    // The steepest moment is at an edge, half a length off, give or take a sample or two.
    assert!((found[0].x_m.0 - 1.7).abs() < 3.2e-3, "{:?}", found[0].x_m);
    assert_eq!(shape.form, Form::Hollow);
    assert!((shape.length_m.0 / 6e-3 - 1.0).abs() < 0.1, "{shape:?}");
    // The level is the one that depths are stated for: what is left is the spectra's scatter.
    assert!((shape.depth_m.0 / 2e-5 - 1.0).abs() < 0.15, "{shape:?}");
}

#[test]
fn a_long_hollow_that_a_slow_wheel_rolls_through_quietly_is_found() {
    let found = rolled(6, &|_, x| hollow_m(3e-5, 1e-2, x - 1.7));
    let shape = found[0].shape.clone().unwrap();
    assert_eq!((found.len(), shape.form), (1, Form::Hollow), "{found:?}");
    assert!((shape.length_m.0 / 1e-2 - 1.0).abs() < 0.15, "{shape:?}");
}

/// The same passes, rolled at twice the speed.
fn at_twice_the_speed(mut recording: Recording) -> Recording {
    let rate_hz = 2.0 * recording.sample_rate_hz;
    recording.sample_rate_hz = rate_hz;
    for pass in &mut recording.passes {
        pass.speed_km_h *= 2.0;
        pass.signal = Signal::new(rate_hz, pass.signal.samples().to_vec()).unwrap();
    }
    recording
}

#[test]
fn a_hollow_too_long_for_the_band_of_short_ones_is_found() {
    let height = |_, x| hollow_m(2e-5, 1.5e-2, x - 1.7);
    let surface = Rolled { height_m: &height, ..Rolled::faultless(6) };
    let found = impacts(&at_twice_the_speed(surface.recording()), ALPHA, &[]);
    let shape = found[0].shape.clone().unwrap();
    assert_eq!((found.len(), shape.form), (1, Form::Hollow), "{found:?}");
    assert!((shape.length_m.0 / 1.5e-2 - 1.0).abs() < 0.15, "{shape:?}");
}

#[test]
fn a_kink_is_found_with_its_change_of_slope() {
    let (depth, length) = (8e-5, 0.015);
    let found = rolled(2, &|_, x| depth * (-(x - 1.3).abs() / length).exp());
    let shape = found[0].shape.clone().unwrap();
    assert_eq!((found.len(), shape.form), (1, Form::Dip), "{found:?}");
    assert!((found[0].x_m.0 - 1.3).abs() < 3e-3);
    // Long flanks make little sound: only their slope is known.
    assert!((shape.slope_rad / (2.0 * depth / length) - 1.0).abs() < 0.15, "{shape:?}");
}

#[test]
fn an_impact_in_some_passes_only_is_not_the_tracks() {
    assert!(
        rolled(3, &|pass, x| {
            // In the passes at one of two speeds.
            if pass < 2 { hollow_m(2e-5, 6e-3, x - 1.7) } else { 0.0 }
        })
        .is_empty()
    );
}

#[test]
fn two_impacts_are_two_and_a_place_that_is_excepted_is_none() {
    let two = |_, x| hollow_m(2e-5, 6e-3, x - 0.9) + hollow_m(2e-5, 6e-3, x - 2.1);
    let surface = Rolled { height_m: &two, ..Rolled::faultless(4) };
    let recording = surface.recording();
    let all = impacts(&recording, ALPHA, &[]);
    assert_eq!(all.len(), 2, "{all:?}");
    assert_eq!(impacts(&recording, ALPHA, &[[0.85, 0.95]]).len(), 1);
}

#[test]
fn waves_in_a_stretch_are_found_with_length_amplitude_and_ends() {
    let (wavelength, amplitude) = (7e-3, 6e-7);
    let waves = |_, x: f64| {
        if (1.0..2.0).contains(&x) { amplitude * (TAU * x / wavelength).cos() } else { 0.0 }
    };
    let surface = Rolled { height_m: &waves, ..Rolled::faultless(5) };
    let found = corrugation(&surface.recording(), ALPHA, None).unwrap();
    assert!((found.wavelength_m.0 / wavelength - 1.0).abs() < 2e-3, "{found:?}");
    // A line 20 dB above chance is known to a tenth, its neighbours to a fifth.
    assert!((found.amplitude_m.0 / amplitude - 1.0).abs() < 0.3, "{found:?}");
    // Half a sleeper spacing.
    assert!((found.stretch_m[0] - 1.0).abs() < 0.07, "{found:?}");
    assert!((found.stretch_m[1] - 2.0).abs() < 0.07, "{found:?}");
}

#[test]
fn a_surface_without_defects_has_neither() {
    for seed in 10..20 {
        let recording = Rolled::faultless(seed).recording();
        assert!(impacts(&recording, ALPHA, &[]).is_empty(), "seed {seed}");
        assert!(corrugation(&recording, ALPHA, None).is_none(), "seed {seed}");
    }
}

#[test]
fn noise_in_a_long_pass_has_no_impact_at_a_low_sample_rate() {
    // A cell is as wide as half a sleeper spacing: few lie around each.
    let pass = |seed| LongPass { seed, speeds_km_h: [67.0; 2], amplitude: 0.0, waves_per_m: &[] };
    let has_impact = |seed: &u64| !impacts(&pass(*seed).recording(None), ALPHA, &[]).is_empty();
    let alarms: Vec<u64> = (0..40).filter(has_impact).collect();
    // 0.2 are expected at most; 2 or more have a probability of 2 %.
    assert!(alarms.len() <= 1, "seeds {alarms:?}");
}

#[test]
fn the_dip_of_an_independent_recording_is_placed_within_three_millimetres() {
    for recording in independent("dev-02") {
        let found = impacts(&recording, ALPHA, &[]);
        assert_eq!(found.len(), 1);
        // The odometer wanders by that much.
        assert!((found[0].x_m.0 - 2.4375).abs() < 3e-3, "{:?}", found[0].x_m);
        assert_eq!(found[0].shape.as_ref().unwrap().form, Form::Dip);
    }
}

#[test]
fn the_waves_of_an_independent_recording_are_measured() {
    for recording in independent("dev-06") {
        let found = corrugation(&recording, ALPHA, None).unwrap();
        assert!((found.wavelength_m.0 / 8.5e-3 - 1.0).abs() < 5e-3, "{found:?}");
        assert!((found.amplitude_m.0 - 8e-7).abs() < 2.0 * found.amplitude_m.1, "{found:?}");
    }
}
