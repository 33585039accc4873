use super::hypotheses::mean;
use super::*;
use crate::estimate::Estimate;
use serde_json::{Value, json};

fn ids() -> Vec<String> {
    (1..=54).map(|number| format!("SN{number}")).collect()
}

/// A diagnosis of these sleepers that accepted these hypotheses; a level of a sleeper is its index.
fn section(sleepers: Range<usize>, hypotheses: &[Value]) -> DiagnosedSection {
    let estimate = json!({"mean": 1.0, "sd": 0.1});
    let both = json!({"before": estimate, "after": estimate});
    let track = sleepers.clone().map(|sleeper| {
        json!({"id": ids()[sleeper], "x_m": 0.6 * sleeper as f64, "railpad_stiffness_N_m": both,
            "ballast_stiffness_N_m": both, "irregularity_level": both})
    });
    let levels: Vec<_> = sleepers.clone().map(|sleeper| vec![sleeper as f64]).collect();
    let scores = json!({"in_sample": {"score": -1.0}, "held_out": {"score": -2.0}});
    let of = |stated: &Value| {
        let mut all = json!({"family_probability": 0.9, "probability": 0.9, "accepted": true,
            "look_alikes": [], "would_separate": "", "detectability": 3.0, "log_evidence": 50.0,
            "parameters": {}});
        all.as_object_mut().unwrap().extend(stated.as_object().unwrap().clone());
        all
    };
    let verdict = if hypotheses.is_empty() { "consistent" } else { "left_out_physics" };
    let diagnosis = serde_json::from_value(json!({
        "format": FORMAT, "recording": "line", "verdict": verdict, "sentence": "",
        "nothing_left_out": 0.8 - 0.01 * sleepers.start as f64, "mismatches": [],
        "hypotheses": hypotheses.iter().map(of).collect::<Vec<_>>(),
        "fit": {"score": "", "before": scores, "after": scores,
            "held_out_gain_nats": {"80": 5.0}},
        "bias_removed": {}, "track": track.collect::<Vec<_>>(),
        "levels": {"frequency_Hz": [100.0], "speeds_km_h": [80.0], "measured_dB": [levels],
            "before_dB": [levels], "after_dB": [levels], "scatter_dB": [[1.0]]},
        "notes": ["one pass", format!("{} sleepers from {}", sleepers.len(), sleepers.start)],
    }));
    DiagnosedSection { number: 1, sleepers, diagnosis: diagnosis.unwrap() }
}

fn whole(first: &[Value], second: &[Value]) -> Diagnosis {
    let x_m: Vec<f64> = (0..54).map(|sleeper| 0.6 * f64::from(sleeper)).collect();
    let sections = [section(0..30, first), section(24..54, second)];
    joined(&ids(), &x_m, &sections, None).unwrap()
}

/// A hypothesis at sleepers with these indices.
fn at(physics: &str, sleepers: &[usize]) -> Value {
    let x_m = [sleepers[0], sleepers[sleepers.len() - 1]].map(|it| 0.6 * it as f64);
    let sleepers: Vec<String> = sleepers.iter().map(|&sleeper| ids()[sleeper].clone()).collect();
    json!({"physics": physics, "location": {"x_m": x_m, "sleepers": sleepers}})
}

/// Physics of every hypothesis, and its first and last sleeper.
fn places(diagnosis: &Diagnosis) -> Vec<(&str, [&str; 2])> {
    let mut all = Vec::new();
    for hypothesis in &diagnosis.hypotheses {
        let sleepers = hypothesis.location.as_ref().map_or(&[][..], |it| &it.sleepers);
        let ends = [sleepers.first(), sleepers.last()].map(|id| id.map_or("", String::as_str));
        all.push((hypothesis.physics.as_str(), ends));
    }
    all
}

#[test]
fn a_short_recording_is_one_section() {
    assert_eq!(diagnosed_sections(48), std::slice::from_ref(&(0..48)));
    assert_eq!(diagnosed_sections(54), [0..30, 24..54]);
    assert_eq!(joined(&ids(), &[], &[], None), None);
}

#[test]
fn every_sleeper_is_there_once_with_the_section_it_lies_inside() {
    let diagnosis = whole(&[], &[]);
    let track: Vec<String> = diagnosis.track.iter().map(|it| it.id.clone()).collect();
    assert_eq!(track, ids());
    let measured: Vec<f64> = diagnosis.levels.measured_db[0].iter().map(|it| it[0]).collect();
    assert_eq!(measured, (0..54).map(f64::from).collect::<Vec<_>>());
    assert_eq!(diagnosis.verdict, Verdict::Consistent);
    // The lowest of the sections.
    assert_eq!(diagnosis.nothing_left_out, Some(0.56));
    assert_eq!(
        diagnosis.notes,
        ["one pass", "SN1 to SN30: 30 sleepers from 0", "SN25 to SN54: 30 sleepers from 24"]
    );
    assert_eq!(diagnosis.fit.held_out_gain_nats["80"], 10.0);
    assert_eq!(diagnosis.fit.after.held_out, Some(Score { score: -2.0 }));
    assert_eq!(diagnosis.sections[1].sleepers, ["SN25", "SN54"]);
}

#[test]
fn of_two_names_for_one_place_the_section_that_has_it_farther_inside_decides() {
    let diagnosis = whole(&[at("squat", &[27, 28])], &[at("rail_joint", &[28])]);
    assert_eq!(places(&diagnosis), [("rail_joint", ["SN29", "SN29"])]);
    // Where the other section is silent, nothing is lost.
    let diagnosis = whole(&[at("squat", &[27, 28])], &[at("rail_joint", &[40])]);
    assert_eq!(places(&diagnosis), [("squat", ["SN28", "SN29"]), ("rail_joint", ["SN41", "SN41"])]);
}

#[test]
fn what_a_section_hears_beyond_its_sleepers_is_the_next_section_s() {
    let mut beyond = at("rail_joint", &[32]);
    beyond["location"]["sleepers"] = json!(["SN30"]);
    let diagnosis = whole(std::slice::from_ref(&beyond), &[at("rail_joint", &[32])]);
    assert_eq!(places(&diagnosis), [("rail_joint", ["SN33", "SN33"])]);
    // Beyond the last sleeper of all, no other section has it.
    let mut last = at("squat", &[53]);
    last["location"]["x_m"] = json!([33.0, 33.0]);
    assert_eq!(places(&whole(&[], &[last])), [("squat", ["SN54", "SN54"])]);
}

#[test]
fn withheld_passes_of_sections_are_joined_by_their_speeds() {
    let confirmed = |sleepers: Range<usize>, of: &[(&str, f64)]| {
        let mut it = section(sleepers, &[]);
        let speeds: Vec<_> = of
            .iter()
            .map(|(_, speed)| json!({"speed_km_h": speed, "before_dB": *speed, "after_dB": 1.0}))
            .collect();
        let passes: Vec<_> = of.iter().map(|(file, _)| file).collect();
        it.diagnosis.confirmation = serde_json::from_value(json!({"passes": passes,
            "speeds": speeds, "sleepers": 30, "gain_nats": 5.0, "is_confirmed": true}))
        .unwrap();
        it
    };
    let sections = [
        confirmed(0..30, &[("slow", 40.0), ("usual", 60.0)]),
        confirmed(24..54, &[("usual", 60.0), ("fast", 80.0)]),
    ];
    let x_m: Vec<f64> = (0..54).map(|sleeper| 0.6 * f64::from(sleeper)).collect();
    let whole = joined(&ids(), &x_m, &sections, None).unwrap().confirmation.unwrap();
    assert_eq!(whole.passes, ["slow", "usual", "fast"]);
    let speeds: Vec<f64> = whole.speeds.iter().map(|it| it.speed_km_h).collect();
    assert_eq!(speeds, [40.0, 60.0, 80.0]);
    assert!(whole.speeds.iter().all(|it| (it.before_db - it.speed_km_h).abs() < 1e-9));
}

#[test]
fn what_continues_in_the_next_section_is_one_finding() {
    let bolts = |sd: f64| {
        let mut bolts = at("sleeper_bolt", &(24..54).collect::<Vec<_>>());
        bolts["parameters"] = json!({"stiffness_N_per_m": {"mean": 3e7, "sd": sd}});
        bolts
    };
    let mut first = bolts(1e6);
    first["location"] = at("sleeper_bolt", &(0..30).collect::<Vec<_>>())["location"].clone();
    let diagnosis = whole(&[first], &[bolts(1e6)]);
    assert_eq!(places(&diagnosis), [("sleeper_bolt", ["SN1", "SN54"])]);
    let found = &diagnosis.hypotheses[0];
    assert_eq!(found.log_evidence, 100.0);
    let stiffness = found.parameters["stiffness_N_per_m"];
    assert!((stiffness.mean / 3e7 - 1.0).abs() < 1e-12 && stiffness.sd < 1e6);
    // Every third clamp: the pattern goes on across the border.
    let clamps = |range: Range<usize>| at("fastening_clamp", &range.step_by(3).collect::<Vec<_>>());
    let diagnosis = whole(&[clamps(0..30)], &[clamps(24..54)]);
    assert_eq!(places(&diagnosis), [("fastening_clamp", ["SN1", "SN52"])]);
    assert_eq!(diagnosis.hypotheses[0].location.as_ref().unwrap().sleepers.len(), 18);
    // A flat of the wheel has no place.
    let flat = json!({"physics": "wheel_flat"});
    assert_eq!(
        places(&whole(std::slice::from_ref(&flat), std::slice::from_ref(&flat))),
        [("wheel_flat", ["", ""])]
    );
    // Two joints stay two.
    let joint = |sleeper| at("rail_joint", &[sleeper]);
    assert_eq!(places(&whole(&[joint(4)], &[joint(40)])).len(), 2);
    // The more probable one comes first.
    assert_eq!(places(&whole(&[joint(20), joint(4)], &[])).len(), 2);
}

#[test]
fn a_mean_of_two_estimates_doubts_what_they_disagree_on() {
    let estimate = |mean: f64, sd: f64| Estimate { mean, sd };
    let agreed = mean(estimate(1.0, 0.1), estimate(1.0, 0.1));
    assert!((agreed.sd - 0.1 / 2f64.sqrt()).abs() < 1e-12);
    let torn = mean(estimate(1.0, 0.1), estimate(3.0, 0.1));
    assert!((torn.mean - 2.0).abs() < 1e-12 && (torn.sd - 1.0).abs() < 1e-9);
    let sure = mean(estimate(1.0, 0.0), estimate(3.0, 0.1));
    assert!((sure.mean - 1.0).abs() < 1e-9);
}
