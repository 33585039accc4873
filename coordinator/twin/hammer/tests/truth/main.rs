//! Hammer tests whose truth is known: the reference simulator strikes, the fit estimates.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod scene;

use num_complex::Complex64;
use scene::{STRUCK, scene, seat_m, strike};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use tracktwin_fourier::{real_forward, real_inverse};
use tracktwin_hammer::{
    HammerRecord, Interval, Loaded, Nodes, PointReceptance, Selection, Sleeper, SleeperFlag,
    beside, fit, read, select,
};
use tracktwin_parameters::{Parameter, Preset, Track};
use tracktwin_reference_simulator::{Hidden, Scene, receptance};

fn evaluate(scene: &Scene) -> HammerRecord {
    evaluated(&Preset::VTrack.track(), &strike(scene))
}

fn evaluated(track: &Track, points: &[PointReceptance]) -> HammerRecord {
    evaluated_to(track, points, None)
}

/// The same up to a frequency in Hz.
fn evaluated_to(track: &Track, points: &[PointReceptance], to_hz: Option<f64>) -> HammerRecord {
    let mut selection = Selection::usual(&track.design);
    selection.range_hz[1] = to_hz.unwrap_or(selection.range_hz[1]);
    let points = select(points, &selection).points;
    let fitted = fit(track, 0.0, &points).unwrap();
    let name = |number: i64, _| format!("SN{number}");
    HammerRecord::new(&fitted, &track.name, selection.range_hz, points.len(), name)
}

/// Logarithms of estimates over truths at the struck sleepers.
fn errors(record: &HammerRecord, parameter: Parameter, truth: impl Fn(usize) -> f64) -> Vec<f64> {
    let of = |sleeper: usize| {
        let is_here = |it: &&Sleeper| (it.x_m - seat_m(sleeper)).abs() < 0.01;
        let found = record.sleepers.iter().find(is_here).unwrap();
        (found.estimates[&parameter].estimate / truth(sleeper)).ln()
    };
    STRUCK.map(of).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

#[test]
fn a_hammer_test_tells_the_stiffness_under_every_sleeper() {
    let mut scene = scene(3, 0.15);
    // A missing railpad and soft ballast.
    scene.sleepers[STRUCK.start + 7].railpad_stiffness_n_m *= 0.3;
    scene.sleepers[STRUCK.start + 13].ballast_stiffness_n_m *= 0.4;
    let record = evaluate(&scene);
    let railpad =
        errors(&record, Parameter::RailpadStiffness, |it| scene.sleepers[it].railpad_stiffness_n_m);
    let ballast =
        errors(&record, Parameter::BallastStiffness, |it| scene.sleepers[it].ballast_stiffness_n_m);
    assert!(median(&railpad) < 0.10, "{railpad:?}");
    assert!(median(&ballast) < 0.10, "{ballast:?}");
    assert!(railpad[7].abs() < 0.3 && ballast[13].abs() < 0.3, "{} {}", railpad[7], ballast[13]);
    assert!(record.sleepers.iter().all(Sleeper::is_valid), "{:?}", record.notes);
}

#[test]
fn what_the_model_does_not_hold_leaves_distant_sleepers_explained() {
    let mut scene = scene(4, 0.05);
    // A sleeper whose ballast stands on a soft mass.
    scene.left_out.push(Hidden::SubgradeLayer {
        sleepers: Some(vec![STRUCK.start + 10]),
        mass_kg: 20.0,
        stiffness_n_per_m: 2e6,
        damping_n_s_per_m: 50.0,
    });
    let record = evaluate(&scene);
    let flagged: Vec<f64> = record
        .sleepers
        .iter()
        .filter(|sleeper| sleeper.flags.contains(&SleeperFlag::Unexplained))
        .map(|sleeper| sleeper.x_m)
        .collect();
    let is_near = |x_m: &f64, reach_m: f64| (x_m - seat_m(STRUCK.start + 10)).abs() < reach_m;
    assert!(flagged.iter().any(|x_m| is_near(x_m, 0.01)), "{flagged:?}");
    assert!(flagged.iter().all(|x_m| is_near(x_m, 0.3)), "{flagged:?}");
}

#[test]
fn a_wrong_calibration_is_estimated_and_flagged_if_it_is_far() {
    const PLACES: usize = 12;
    let scene = scene(9, 0.1);
    let struck = strike(&scene);
    for (gain, is_far) in [(1.0, false), (1.1, false), (1.2, true)] {
        let mut points = struck[..PLACES].to_vec();
        points.iter_mut().flat_map(|point| &mut point.values).for_each(|value| *value *= gain);
        let record = evaluated(&Preset::VTrack.track(), &points);
        assert!((record.gain.estimate / gain - 1.0).abs() < 0.01, "{gain}: {:?}", record.gain);
        assert_eq!(record.gain.is_far, is_far, "{gain}: {:?}", record.gain);
        assert!(record.sleepers.iter().all(|it| it.is_valid() != is_far), "{gain}");
        assert_eq!(record.notes[0].contains("check the calibration"), is_far, "{:?}", record.notes);
        // Of six intervals of 90 %, one may miss.
        let inside = railpads_inside(&scene, &record, PLACES / 2);
        assert!(inside + 1 >= PLACES / 2, "{gain}: {inside} {:?}", record.sleepers);
    }
}

/// Number of the first struck sleepers whose true railpad stiffness lies inside its 90 % interval.
fn railpads_inside(scene: &Scene, record: &HammerRecord, sleepers: usize) -> usize {
    let is_inside = |&sleeper: &usize| {
        let is_here = |it: &&Sleeper| (it.x_m - seat_m(sleeper)).abs() < 0.01;
        let found = record.sleepers.iter().find(is_here).unwrap();
        let Interval { lower, upper, .. } = found.estimates[&Parameter::RailpadStiffness];
        (lower..=upper).contains(&scene.sleepers[sleeper].railpad_stiffness_n_m)
    };
    STRUCK.take(sleepers).filter(is_inside).count()
}

#[test]
fn a_narrow_range_widens_the_intervals_of_the_railpads() {
    const PLACES: usize = 12;
    let scene = scene(9, 0.1);
    let points = &strike(&scene)[..PLACES];
    // Below 1000 Hz, waves run along the rail almost without damping, and railpads matter little.
    let of = |to_hz: f64| {
        let record = evaluated_to(&Preset::VTrack.track(), points, Some(to_hz));
        let inside = railpads_inside(&scene, &record, PLACES / 2);
        assert!(inside + 1 >= PLACES / 2, "{to_hz}: {inside} {:?}", record.sleepers);
        let widths = record.sleepers.iter().map(|sleeper| {
            let Interval { lower, upper, .. } = sleeper.estimates[&Parameter::RailpadStiffness];
            (upper / lower).ln()
        });
        median(&widths.collect::<Vec<_>>())
    };
    let (narrow, wide) = (of(1000.0), of(4000.0));
    assert!(narrow > 2.0 * wide, "{narrow} {wide}");
}

#[test]
fn a_wrong_track_explains_no_sleeper() {
    let mut track = Preset::VTrack.track();
    // Nine times the mass of the rail that is struck.
    track.design.rail = Preset::Concrete60E1.track().design.rail;
    let record = evaluated(&track, &strike(&scene(7, 0.05))[..8]);
    let struck = record.sleepers.iter().filter(|sleeper| sleeper.misfit.is_some()).count();
    let is_unexplained = |it: &&Sleeper| it.flags.contains(&SleeperFlag::Unexplained);
    let unexplained = record.sleepers.iter().filter(is_unexplained).count();
    assert!(2 * unexplained > struck, "{:?}", record.sleepers);
    assert!(record.model_error_db > 1.8, "{}", record.model_error_db);
}

#[test]
fn railpads_that_stiffen_with_load_are_softer_under_the_hammer() {
    let mut scene = scene(5, 0.05);
    scene.left_out.push(Hidden::LoadDependentRailpad {
        exponent: 0.5,
        reference_load_n: 2250.0,
        toe_load_n: 750.0,
    });
    let record = evaluate(&scene);
    // What an evaluation under the wheel says if it is right to 5 %.
    let sleepers: Vec<String> = STRUCK
        .map(|it| {
            let stiffness = |value: f64| format!(r#"{{"mean": {value}, "sd": {}}}"#, 0.05 * value);
            let truth = &scene.sleepers[it];
            format!(
                r#"{{"id": "A{it}", "x_m": {}, "railpad_stiffness_N_m": {}, "ballast_stiffness_N_m": {}, "misfit": 1.0, "flags": []}}"#,
                seat_m(it),
                stiffness(truth.railpad_stiffness_n_m),
                stiffness(truth.ballast_stiffness_n_m)
            )
        })
        .collect();
    let text = format!(
        r#"{{"format": "tracktwin-evaluation/1", "recording": "ride", "sleepers": [{}]}}"#,
        sleepers.join(",")
    );
    let loaded = Loaded::parse(&text).unwrap();
    let [railpad, ballast] = &beside(&record, &loaded, 0.125)[..] else { panic!("two compared") };
    // (3000 N / 750 N)^0.5.
    assert!((railpad.ratio[0] / 2.0).ln().abs() < 0.15, "{railpad:?}");
    assert!(railpad.differs() && railpad.sentence().contains("stiffen with load"));
    assert!((ballast.ratio[0]).ln().abs() < 0.1, "{ballast:?}");
}

#[test]
fn signals_of_hits_give_the_receptance() {
    const SAMPLES: usize = 4096;
    let step_s = 1.0 / 16_384.0;
    let scene = scene(6, 0.1);
    let x_m = seat_m(STRUCK.start + 10);
    let lines: Vec<f64> =
        (1..SAMPLES / 2).map(|it| it as f64 / (SAMPLES as f64 * step_s)).collect();
    let exact = receptance(&scene, &[x_m], &lines).unwrap().remove(0);
    let (forward, inverse) = (real_forward(SAMPLES), real_inverse(SAMPLES));
    // A pulse of a steel tip, 0.3 ms long.
    let pulse = |time_s: f64| if time_s < 3e-4 { (PI / 3e-4 * time_s).sin().powi(2) } else { 0.0 };
    let force: Vec<f64> = (0..SAMPLES).map(|it| 500.0 * pulse(it as f64 * step_s)).collect();
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut force.clone(), &mut spectrum).unwrap();
    let mut response = vec![Complex64::ZERO; spectrum.len()];
    for (line, (hz, value)) in lines.iter().zip(&exact).enumerate() {
        response[line + 1] = -(TAU * hz).powi(2) * value * spectrum[line + 1];
    }
    let mut acceleration = inverse.make_output_vec();
    inverse.process(&mut response, &mut acceleration).unwrap();
    let mut text = "position_m,hit,time_s,force_N,acceleration_m_s2\n".to_owned();
    let mut random = 1_u32;
    for hit in 1..=4 {
        for sample in 0..SAMPLES {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = 0.02 * (f64::from(random >> 8) / f64::from(1 << 24) - 0.5);
            let scale = 0.5 + 0.2 * f64::from(hit);
            let time_s = sample as f64 * step_s;
            let response = scale * acceleration[sample] / SAMPLES as f64 + noise;
            writeln!(text, "{x_m},{hit},{time_s:.9},{:.6},{response:.6}", scale * force[sample])
                .unwrap();
        }
    }
    let points = read(&text, &Nodes::new()).unwrap();
    assert_eq!(points[0].hits, Some(4));
    let selection = Selection { range_hz: [100.0, 3000.0], coherence: 0.9 };
    let selected = select(&points, &selection).points.remove(0);
    assert!(selected.values.len() > 80, "{}", selected.values.len());
    for (hz, value) in selected.frequencies_hz.iter().zip(&selected.values) {
        let line = (hz * SAMPLES as f64 * step_s).round() as usize - 1;
        let error = (value / exact[line] - 1.0).norm();
        assert!(error < 0.1, "{hz} Hz: {error}");
    }
}
