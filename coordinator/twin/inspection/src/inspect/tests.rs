//! Findings of whole recordings.

use super::*;
use crate::along::testing::{Chain, LongPass, Rolled, independent};
use std::f64::consts::TAU;
use tracktwin_signal::Signal;
use tracktwin_track::extension::{CLIPPING, ELECTRICAL_HUM, WHEEL_FLAT, WHEEL_OUT_OF_ROUND};

/// Names that the passes of a recording give.
fn names(recording: &Recording) -> Vec<&'static str> {
    let inspection = inspect(recording);
    assert!(inspection.pass_defects.is_empty(), "{:?}", inspection.pass_defects);
    inspection.findings.iter().map(|finding| finding.physics).collect()
}

#[test]
fn a_recording_without_defects_of_surface_wheel_or_chain_gives_no_name() {
    // One without left-out physics, one whose sleepers hang, one with a resonance of the sensor:
    // the others are looked at in a longer run.
    for recording in ["dev-01", "dev-04", "dev-08"].into_iter().flat_map(independent) {
        let names = names(&recording);
        assert!(names.is_empty(), "{}: {names:?}", recording.name);
    }
}

#[test]
fn the_wheel_bouncing_on_the_track_is_no_wave_where_there_is_one_speed() {
    for (recording, speed_km_h) in [("dev-01", 7.0), ("dev-10", 13.0)] {
        for mut recording in independent(recording) {
            recording.passes.retain(|pass| pass.speed_km_h.total_cmp(&speed_km_h).is_eq());
            assert_eq!(inspect(&recording).findings, [], "{}", recording.name);
        }
    }
}

#[test]
fn a_dip_waves_and_a_flat_are_named_and_nothing_else() {
    for (recording, expected) in
        [("dev-02", "rail_joint"), ("dev-06", "corrugation"), ("dev-09", "wheel_flat")]
    {
        for recording in independent(recording) {
            assert_eq!(names(&recording), [expected], "{}", recording.name);
        }
    }
}

/// At 10 km/h the wheel of the rig has its order 22 at 150 Hz.
#[test]
fn hum_at_the_frequency_of_an_order_is_no_wave_of_the_wheel() {
    for mut recording in independent("dev-01") {
        for (phase, pass) in (0..).zip(&mut recording.passes) {
            let rate_hz = pass.signal.sample_rate_hz();
            let hum = |sample: usize| {
                3.0 * (TAU * 150.0 * sample as f64 / rate_hz + f64::from(phase)).sin()
            };
            let samples = pass.signal.samples().iter().enumerate();
            let samples = samples.map(|(sample, value)| value + hum(sample)).collect();
            pass.signal = Signal::new(rate_hz, samples).unwrap();
        }
        assert_eq!(names(&recording), [ELECTRICAL_HUM.physics], "{}", recording.name);
    }
}

#[test]
fn passes_that_are_mostly_clipped_are_not_laid_on_each_other() {
    let shift = |pass: usize, position_m: &mut [f64]| {
        if pass == 1 {
            for x_m in position_m {
                *x_m += 0.016;
            }
        }
    };
    let shifted = |pass: usize, _: &mut [f64], position_m: &mut [f64]| shift(pass, position_m);
    let clipped = |pass: usize, samples: &mut [f64], position_m: &mut [f64]| {
        shift(pass, position_m);
        let mean_square = samples.iter().map(|it| it * it).sum::<f64>() / samples.len() as f64;
        let limit = 0.3 * mean_square.sqrt();
        for sample in samples {
            *sample = sample.clamp(-limit, limit);
        }
    };
    let finds = |chain: &Chain<'_>, physics: &str| {
        let recording = Rolled { chain, ..Rolled::faultless(6) }.recording();
        inspect(&recording).findings.iter().any(|finding| finding.physics == physics)
    };
    assert!(finds(&shifted, POSITION_ERROR.physics));
    assert!(finds(&clipped, CLIPPING.physics) && !finds(&clipped, POSITION_ERROR.physics));
}

#[test]
fn a_pass_that_drops_out_is_left_out_and_its_ends_are_no_blows() {
    let silent = |samples: &mut [f64]| {
        let from = samples.len() / 2;
        samples[from..from + (0.02 * Rolled::RATE_HZ) as usize].fill(0.0);
    };
    let in_one = |pass: usize, samples: &mut [f64], _: &mut [f64]| {
        if pass == 1 {
            silent(samples);
        }
    };
    let found = |chain: &Chain<'_>| inspect(&Rolled { chain, ..Rolled::faultless(6) }.recording());
    let inspection = found(&in_one);
    assert_eq!(inspection.not_compared(), [1], "{:?}", inspection.pass_defects);
    // No speed is left without them.
    let inspection = found(&|_, samples: &mut [f64], _: &mut [f64]| silent(samples));
    assert!(inspection.not_compared().is_empty() && inspection.findings.is_empty());
    assert!(!inspection.pass_defects.is_empty());
}

/// Circumference in m of the wheel of long passes.
const TURN_M: f64 = 2.856;

#[test]
fn orders_of_a_wheel_at_frequencies_of_the_mains_are_no_hum_at_one_speed() {
    let orders: Vec<f64> = (5..=30).chain([41]).map(|order| f64::from(order) / TURN_M).collect();
    // Order 29 is 0.5 Hz beside 180 Hz, and 41 is 0.9 Hz beside 300 Hz.
    for speed_km_h in [64.0, 75.0] {
        let pass = LongPass {
            seed: 3,
            speeds_km_h: [speed_km_h; 2],
            amplitude: 0.2,
            waves_per_m: &orders,
        };
        for radius_m in [None, Some(TURN_M / TAU), Some(1.01 * TURN_M / TAU)] {
            let inspection = inspect(&pass.recording(radius_m));
            let names = inspection.findings.iter().map(|finding| finding.physics);
            let names: Vec<&str> = names.collect();
            // Blows of a flat are a sum of orders, too.
            let is_wheel = names == [WHEEL_OUT_OF_ROUND.physics] || names == [WHEEL_FLAT.physics];
            assert!(is_wheel, "{speed_km_h} km/h, {radius_m:?}: {names:?}");
            let doubts = inspection.doubts();
            let is_said =
                doubts.iter().any(|it| it.contains("orders of the wheel or hum of the mains"));
            assert!(
                is_said || inspection.flat.is_some(),
                "{speed_km_h} km/h, {radius_m:?}: {doubts:?}"
            );
        }
    }
}

#[test]
fn hum_at_one_speed_is_named_where_it_is_apart_from_the_orders() {
    // At 67 km/h order 8 of the stated wheel is 2.1 Hz beside 50 Hz, and order 23 within 0.1 Hz of 150 Hz.
    let waves_per_m = [50.0, 150.0].map(|hz| hz / (67.0 / 3.6));
    let pass =
        LongPass { seed: 3, speeds_km_h: [67.0; 2], amplitude: 0.2, waves_per_m: &waves_per_m };
    for (radius_m, named) in [(None, vec![50.0, 150.0]), (Some(TURN_M / TAU), vec![50.0])] {
        let inspection = inspect(&pass.recording(radius_m));
        let frequency_hz = |lines: &[Hum]| -> Vec<f64> {
            let mut all: Vec<f64> = lines.iter().map(|line| line.frequency_hz).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let hum = inspection.findings.iter().find(|it| it.physics == ELECTRICAL_HUM.physics);
        assert!(hum.is_some() && inspection.comb.is_none(), "{radius_m:?}");
        assert_eq!(frequency_hz(&inspection.hum), named, "{radius_m:?}");
        let doubtful = frequency_hz(&inspection.hum_or_orders);
        assert_eq!(doubtful.is_empty(), radius_m.is_none(), "{doubtful:?}");
    }
}

#[test]
fn a_place_is_common_if_some_pass_of_every_speed_has_a_blow_there() {
    let blows_m = [vec![0.5, 0.9], vec![0.7], vec![0.71, 1.1], vec![0.3]];
    let of = |speeds: &[Vec<usize>]| common_places(&blows_m, speeds, 0.02);
    let found = of(&[vec![0, 1], vec![2, 3]]);
    assert_eq!(found.len(), 1);
    assert!(found[0][0] < 0.7 && 0.7 < found[0][1], "{found:?}");
    assert!(of(&[vec![0], vec![1], vec![2]]).is_empty());
    // Between the blows of all speeds, not only around one of them.
    let apart_m = [vec![0.914], vec![0.974], vec![0.954]];
    let [from_m, to_m] = common_places(&apart_m, &[vec![0], vec![1], vec![2]], 0.05)[0];
    assert!((from_m - 0.924).abs() < 1e-9 && (to_m - 0.964).abs() < 1e-9);
}

#[test]
fn speeds_that_share_no_surface_are_refused() {
    let mut recording = Rolled::faultless(6).recording();
    assert_eq!(inspect(&recording).refusal(), None);
    let elsewhere = Rolled::faultless(7).recording().passes.split_off(2);
    recording.passes.splice(2.., elsewhere);
    let inspection = inspect(&recording);
    assert!(
        matches!(inspection.refusal(), Some(PassDefect::UnrelatedSpeed { .. })),
        "{:?}",
        inspection.pass_defects
    );
}

#[test]
#[ignore = "takes two minutes"]
fn of_a_hundred_faultless_recordings_few_raise_an_alarm() {
    let alarms = (0..100).filter(|&seed| {
        let mut recording = Rolled::faultless(1000 + seed).recording();
        let radius = Rolled::CIRCUMFERENCE_M / std::f64::consts::TAU;
        let wheel = serde_json::json!({"radius_m": radius});
        recording.nominal.insert("wheel".to_owned(), wheel);
        let found = inspect(&recording).findings;
        for finding in &found {
            println!("seed {seed}: {} {:e}", finding.physics, finding.p_value);
        }
        !found.is_empty()
    });
    // Two are expected at most; more than seven have a probability below 0.1 %.
    assert!(alarms.count() <= 7);
}
