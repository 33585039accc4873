//! Simulated passes with contact loss computed by the solver, also after faults of the measuring chain.

use super::*;
use crate::along::testing::noise;
use crate::finding::Place;
use crate::inspect::inspect;
use serde_json::json;
use std::f64::consts::TAU;
use std::sync::LazyLock;
use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper, nominal};
use tracktwin_track::extension::ExtensionInstance;
use tracktwin_track::model::{Mesh, Roughness, Support, TrackModel};
use tracktwin_track::time;

const ALPHA: f64 = 0.0022;
const SPANS: usize = 21;
const SPACING_M: f64 = 0.125;
const JOINT_M: f64 = 1.25;
const TIME_STEP_S: f64 = 2e-5;
const SPEEDS_KM_H: [f64; 3] = [7.0, 10.0, 13.0];
/// Load over unsprung mass of V-Track.
const FLIGHT_M_S2: f64 = 4500.0 / 44.0;

/// Passes over a joint of a dip, at three speeds.
fn simulated(dip_m: f64, level: f64) -> Recording {
    let design = TrackDesign::v_track();
    let joint = ExtensionInstance {
        physics: "rail_joint".to_owned(),
        x_m: Some([JOINT_M; 2]),
        ..ExtensionInstance::default()
    };
    let joint = joint.with("dip_m", dip_m).build(&design, SPANS).unwrap();
    let extensions = if dip_m > 0.0 { vec![joint] } else { Vec::new() };
    let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
    let model =
        TrackModel::build(&design, &Mesh::uniform(SPANS, 4, 4), &supports, &extensions).unwrap();
    let surface = model.surface(&Roughness::new(level), 5);
    let pass = |speed_km_h: f64| {
        let pass = time::Pass {
            speed_m_s: speed_km_h / 3.6,
            start_m: 5.0 * SPACING_M,
            end_m: 16.0 * SPACING_M,
            time_step_s: TIME_STEP_S,
            local_flexibility: true,
        };
        let records =
            time::passes(std::slice::from_ref(&model), &pass, std::slice::from_ref(&surface));
        let record = records.unwrap().remove(0);
        let position_m =
            (0..record.acceleration_m_s2.len()).map(|i| record.position_m(i)).collect();
        let contact_loss_share = Some(record.contact_loss_share(0));
        let signal = Signal::new(1.0 / TIME_STEP_S, record.acceleration_m_s2).unwrap();
        Pass { file: String::new(), speed_km_h, axle: None, signal, position_m, contact_loss_share }
    };
    let sleeper = |i: usize| Sleeper { id: format!("SN{i}"), x_m: (i + 1) as f64 * SPACING_M };
    Recording {
        name: "joint".to_owned(),
        sample_rate_hz: 1.0 / TIME_STEP_S,
        channel: String::new(),
        passes: SPEEDS_KM_H.map(pass).to_vec(),
        sleepers: (5..15).map(sleeper).collect(),
        nominal: nominal(&design),
        spacing_m: SPACING_M,
        doubts: Vec::new(),
    }
}

static DEEP: LazyLock<Recording> = LazyLock::new(|| simulated(1e-3, 3.0));
static SHALLOW: LazyLock<Recording> = LazyLock::new(|| simulated(7e-4, 3.0));
static ROUGH: LazyLock<Recording> = LazyLock::new(|| simulated(0.0, 100.0));

/// The recording by a chain: its samples through `chain`, with the noise before or after.
fn through(recording: &Recording, chain: impl Fn(f64, f64) -> f64) -> Recording {
    let mut recording = recording.clone();
    for (number, pass) in recording.passes.iter_mut().enumerate() {
        let noise = noise(9 + number as u64, pass.signal.len());
        let samples = pass.signal.samples().iter().zip(noise);
        let samples = samples.map(|(sample, noise)| chain(*sample, 0.05 * noise)).collect();
        pass.signal = Signal::new(pass.signal.sample_rate_hz(), samples).unwrap();
    }
    recording
}

/// With noise, a limit before or after it, or none.
fn limited(recording: &Recording, limit: f64, noise_after: bool) -> Recording {
    through(recording, |sample, noise| {
        if noise_after {
            sample.clamp(-limit, limit) + noise
        } else {
            (sample + noise).clamp(-limit, limit)
        }
    })
}

fn without_vehicle(mut recording: Recording) -> Recording {
    recording.nominal.remove("wheel");
    recording
}

/// Asserts that the detected contact loss equals that of the solver in all passes of a recording.
fn assert_found(recording: &Recording) {
    let found = loss_of_contact(recording).expect("the wheel is in the air");
    assert!((found.level_m_s2 / FLIGHT_M_S2 - 1.0).abs() < 0.01, "{found:?}");
    for (index, pass) in recording.passes.iter().enumerate() {
        let truth = pass.contact_loss_share.unwrap();
        let share = found.passes.iter().find(|it| it.pass == index + 1).map_or(0.0, |it| it.share);
        // Within 3 % of the level a wheel counts as in the air that touches with 3 % of its load.
        assert!((share - truth).abs() < 0.25 * truth + 4e-3, "pass {index}: {share}, not {truth}");
    }
    assert!(clipping(recording, ALPHA).is_empty(), "{:?}", clipping(recording, ALPHA));
    let pass_defects = pass_defects(recording, &offsets(recording));
    assert!(pass_defects.is_empty(), "{pass_defects:?}");
}

#[test]
fn a_wheel_in_the_air_is_found_at_every_speed_and_is_no_clipped_recorder() {
    for recording in [&*DEEP, &*SHALLOW, &*ROUGH] {
        assert!(recording.passes.iter().any(|pass| pass.contact_loss_share > Some(0.005)));
        assert_found(recording);
        assert_found(&limited(recording, f64::INFINITY, false));
    }
    let found = loss_of_contact(&DEEP).unwrap();
    assert_eq!(found.speeds_km_h, SPEEDS_KM_H);
    let [from_m, to_m] = found.reach_m();
    assert!(JOINT_M <= from_m && to_m < JOINT_M + 3.0 * SPACING_M, "{found:?}");
    assert!(found.sleepers.contains(&"SN9".to_owned()), "{:?}", found.sleepers);
    assert!(!found.sleepers.contains(&"SN6".to_owned()), "{:?}", found.sleepers);
    assert!((3e-3..10e-3).contains(&found.longest_s()), "{}", found.longest_s());
}

#[test]
fn a_landing_is_no_finding_of_its_own() {
    let places: Vec<Place> = inspect(&DEEP).findings.into_iter().map(|it| it.place).collect();
    let [Place::Stretch { from_m, to_m }] = places[..] else { panic!("{places:?}") };
    assert!(from_m < JOINT_M + 0.01 && to_m > JOINT_M - 0.01, "{places:?}");
}

#[test]
fn without_load_and_mass_or_a_unit_shape_tells_it() {
    for recording in [&*DEEP, &*SHALLOW, &*ROUGH] {
        assert_found(&without_vehicle(recording.clone()));
        assert_found(&without_vehicle(limited(recording, f64::INFINITY, false)));
    }
    let mut unknown = through(&DEEP, |sample, noise| 0.3 * (sample + noise));
    unknown.nominal.insert("gain_known".to_owned(), json!(false));
    let found = loss_of_contact(&unknown).unwrap();
    assert!((found.level_m_s2 / (0.3 * FLIGHT_M_S2) - 1.0).abs() < 0.01, "{found:?}");
    assert_eq!(found.expected_m_s2, None);
    assert!(clipping(&unknown, ALPHA).is_empty());
}

#[test]
fn a_gain_that_is_off_is_said_beside_the_level() {
    let louder = through(&DEEP, |sample, noise| 1.2 * (sample + noise));
    let found = loss_of_contact(&louder).unwrap();
    let said = found.sentence(3);
    assert!(said.contains("load, mass or gain deviate by +20 %"), "{said}");
    assert!(clipping(&louder, ALPHA).is_empty());
}

#[test]
fn a_sensor_upside_down_is_said() {
    let turned = through(&DEEP, |sample, noise| -sample + noise);
    let found = loss_of_contact(&turned).unwrap();
    assert!((found.level_m_s2 / -FLIGHT_M_S2 - 1.0).abs() < 0.01, "{found:?}");
    assert!(found.sentence(3).contains("sign of the sensor is reversed"), "{}", found.sentence(3));
    assert!(clipping(&turned, ALPHA).is_empty());
}

#[test]
fn a_limit_below_the_flight_is_a_limit_and_nothing_is_said_of_contact() {
    for limit in [20.0, 60.0, 95.0] {
        let recording = limited(&DEEP, limit, false);
        assert_eq!(loss_of_contact(&recording), None, "{limit}");
        let found = clipping(&recording, ALPHA);
        assert!(!found.is_empty(), "{limit}");
        assert!(found.iter().all(|it| (it.level_m_s2.abs() / limit - 1.0).abs() < 0.01));
    }
    // One side only, as an amplifier with an offset has it.
    let one_side = through(&DEEP, |sample, noise| (sample + noise).min(60.0));
    assert_eq!(loss_of_contact(&one_side), None);
    assert!(!clipping(&one_side, ALPHA).is_empty());
}

#[test]
fn a_limit_and_a_wheel_in_the_air_are_both_found() {
    for limit in [100.0, 102.0, 103.0, 110.0, 150.0] {
        for noise_after in [false, true] {
            let recording = limited(&DEEP, limit, noise_after);
            let lost = loss_of_contact(&recording).expect("the wheel is in the air");
            assert_eq!(lost.speeds_km_h, SPEEDS_KM_H, "{limit} {noise_after}");
            let cut = clipping(&recording, ALPHA);
            assert!(!cut.is_empty(), "{limit} {noise_after}");
            let is_limit = |it: &Clipping| (it.level_m_s2 / -limit - 1.0).abs() < 0.01;
            assert!(cut.iter().all(is_limit), "{limit} {noise_after}: {cut:?}");
        }
    }
}

#[test]
fn a_wheel_that_stays_on_the_rail_is_not_in_the_air() {
    for level in [1.0, 3.0, 20.0] {
        let recording = simulated(0.0, level);
        assert!(recording.passes.iter().all(|pass| pass.contact_loss_share == Some(0.0)));
        for recording in [recording.clone(), without_vehicle(recording)] {
            assert_eq!(loss_of_contact(&recording), None, "{level}");
        }
    }
}

#[test]
fn a_strong_tone_with_few_flat_crests_is_not_in_the_air() {
    let mut recording = without_vehicle(DEEP.clone());
    recording.passes.truncate(1);
    let pass = &mut recording.passes[0];
    // 20 s at 5 kHz: a tone whose strength varies, and noise.
    let (rate_hz, count) = (5000.0, 100_000);
    let sample = |(index, noise): (usize, f64)| {
        let time_s = index as f64 / rate_hz;
        let strength = 1.0 + 0.02 * (TAU * 0.11 * time_s).sin();
        30.0 * strength * (TAU * 83.3 * time_s).sin() + noise
    };
    let samples = noise(3, count).into_iter().enumerate().map(sample);
    pass.signal = Signal::new(rate_hz, samples.collect()).unwrap();
    pass.position_m = (0..count).map(|index| 18.7 / rate_hz * index as f64).collect();
    recording.sample_rate_hz = rate_hz;
    assert_eq!(loss_of_contact(&recording), None);
}

#[test]
fn a_wheel_that_is_hardly_on_the_rail_leaves_nothing_to_use() {
    let mut recording = DEEP.clone();
    let pass = &mut recording.passes[1];
    // Four fifths of the time in the air; what it falls, it is thrown up again.
    let sample = |index| if index % 120 < 96 { FLIGHT_M_S2 } else { -4.0 * FLIGHT_M_S2 };
    let samples = (0..pass.signal.len()).map(sample).collect();
    pass.signal = Signal::new(1.0 / TIME_STEP_S, samples).unwrap();
    let pass_defects = pass_defects(&recording, &[]);
    assert!(matches!(pass_defects[..], [PassDefect::Airborne { pass: 1, .. }]), "{pass_defects:?}");
}
