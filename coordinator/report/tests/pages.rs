//! Pages from small synthetic results: complete and self-contained. They are kept in the target folder for
//! visual inspection.

use std::collections::BTreeMap;
use std::f64::consts::{LN_10, PI, TAU};
use std::path::Path;
use tracktwin_evaluation::{
    BeyondEnd, Estimate, Estimates, Evaluation, FORMAT, Flag, Known, Measured, OutsideLibrary,
    Provenance, Selected, SleeperEvaluation, Unevenness,
};
use tracktwin_parameters::{Parameter, Scale};
use tracktwin_report::{
    ReceptanceCurve, evaluation_chart, evaluation_page, models_page, receptance_chart,
};
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
use tracktwin_surrogate::{FeatureColumns, Side, TrainOptions, Trained, TrainingSet, train};

const RATE_HZ: f64 = 20_000.0;

/// A recording of twelve sleepers with a resonance at 115 Hz, and one at 600 to 900 Hz at each sleeper.
fn recording() -> Recording {
    let speed_m_s = 13.0 / 3.6;
    let samples = (1.75 / speed_m_s * RATE_HZ) as usize;
    let position_m: Vec<f64> = (0..samples).map(|i| i as f64 / RATE_HZ * speed_m_s).collect();
    let ring = |x: f64| {
        let since = x.rem_euclid(0.125) / speed_m_s;
        let pitch_hz = 600.0 + 170.0 * x;
        8.0 * (-since * 120.0).exp() * (TAU * pitch_hz * since).sin()
    };
    let hum = |x: f64| 2.0 * (TAU * 115.0 * x / speed_m_s).sin();
    let signal = position_m.iter().map(|&x| ring(x) + hum(x)).collect();
    let signal = Signal::new(RATE_HZ, signal).expect("finite");
    let sleepers =
        (1..=12).map(|n| Sleeper { id: format!("SN{n}"), x_m: f64::from(n) * 0.125 }).collect();
    Recording {
        name: "ring <1>".to_owned(),
        sample_rate_hz: RATE_HZ,
        channel: String::new(),
        passes: vec![Pass {
            file: "pass-13kmh-1".into(),
            speed_km_h: 13.0,
            signal,
            position_m,
            axle: None,
            contact_loss_share: None,
        }],
        sleepers,
        nominal: serde_json::Map::new(),
        spacing_m: 0.125,
        doubts: Vec::new(),
    }
}

fn estimates(place: f64, spread: f64) -> Estimates {
    let estimate = |&parameter: &Parameter| {
        let mean = parameter.nominal() * (1.0 + 0.1 * (3.0 * place + spread).sin());
        (parameter, Estimate { mean, sd: 0.06 * mean })
    };
    Parameter::ALL.iter().map(estimate).collect()
}

/// The nominal range of every parameter. All except the damping of the railpad are determined well.
fn known() -> BTreeMap<Parameter, Known> {
    let of = |&parameter: &Parameter| {
        let mase_test = if parameter == Parameter::RailpadDamping { 0.24 } else { 0.1 };
        (parameter, Known { range: parameter.range(), mase_test, mase_constant: 0.25 })
    };
    Parameter::ALL.iter().map(of).collect()
}

fn evaluation(recording: &Recording, extractor: &Extractor) -> Evaluation {
    let sleeper = |index: usize| {
        let Sleeper { id, x_m } = recording.sleepers[index].clone();
        let window = recording.window(0, index).expect("every sleeper is covered");
        let features = extractor.extract(&recording.passes[0].signal, window).expect("features");
        let near = |shift: i32| {
            let value = |(bin, v): (usize, &f64)| v + 0.2 * f64::from(shift) * (bin as f64).sin();
            features.log_power.iter().enumerate().map(value).collect()
        };
        let matches = (-5..5).map(near).collect();
        let log_power = features.log_power.clone();
        SleeperEvaluation {
            id,
            x_m,
            estimates: estimates(x_m, 0.0),
            sd_without_unevenness: estimates(x_m, 0.0)
                .iter()
                .map(|(&of, it)| (of, it.sd))
                .collect(),
            selector: Selected {
                estimates: estimates(x_m, 0.7),
                entries: (0..10).collect(),
                mape: vec![0.05; 10],
            },
            flags: if index == 0 { vec![Flag::ShortMargin] } else { Vec::new() },
            measured: vec![Measured { speed_km_h: 13.0, passes: 1, log_power, matches }],
        }
    };
    Evaluation {
        format: FORMAT,
        recording: recording.name.clone(),
        method: "gp",
        provenance: Provenance {
            code_version: "0.1.0",
            campaign: "synthetic".to_owned(),
            library_digest: "0123abcd".to_owned(),
            library_entries: 300,
            feature: "GF",
            feature_definition: serde_json::json!({"margin_s": 0.06}),
            speeds_km_h: vec![13.0],
            combination: "one model of all speeds together",
            parameters: known(),
        },
        sleepers: (0..recording.sleepers.len()).map(sleeper).collect(),
        unevaluated: Vec::new(),
        outside_library: OutsideLibrary::default(),
        unevenness: Unevenness { scatter: 0.05, least: 0.05, learned_from: None },
        notes: vec!["left out: pass 2".to_owned()],
        frequencies_hz: extractor.definition().frequencies_hz(),
    }
}

/// Models of two parameters at two speeds, trained on pseudo-random numbers.
fn models() -> Trained {
    let random = |index: usize| ((index as f64 + 1.0) * 12.9898).sin() * 43_758.545_3 % 1.0;
    let (entries, bins) = (300, 6);
    let parameters: Vec<f64> = (0..entries)
        .flat_map(|entry| [1e8 * (2.0 + random(entry)), 3.0 + random(7 * entry + 3)])
        .collect();
    let table = |speed: usize| {
        (0..entries * bins)
            .map(|cell| {
                let (entry, bin) = (cell / bins, cell % bins);
                let [pad, level] = [1e-8 * parameters[2 * entry], parameters[2 * entry + 1]];
                pad * bin as f64 * 0.3
                    + level
                    + (0.3 + 0.2 * speed as f64) * random(cell + 999 * speed)
            })
            .collect()
    };
    let set = TrainingSet {
        frequencies_hz: vec![100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0],
        speeds_km_h: vec![10.0, 13.0],
        log_power: vec![table(0), table(1)],
        varied: vec![Parameter::RailpadStiffness, Parameter::IrregularityLevel],
        scales: vec![Scale::Linear; 2],
        parameters,
        campaign: "synthetic".to_owned(),
        library_digest: "0123abcd".to_owned(),
        feature_definition: serde_json::json!({}),
    };
    let columns = vec![FeatureColumns::new("GF", 0..6), FeatureColumns::new("LF1", 0..3)];
    train(&set, &TrainOptions::new(columns), &|_| ()).expect("enough entries")
}

/// Writes the page for visual inspection, and checks that it needs no network.
fn keep(name: &str, text: &str) {
    std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), text).expect("writable");
    // The letters of an embedded picture are no words.
    let words = text.split("base64,").enumerate().map(|(part, rest)| match rest.find('"') {
        Some(end) if part > 0 => &rest[end..],
        _ => rest,
    });
    let foreign = words.collect::<String>().replace("http://www.w3.org/2000/svg", "");
    assert!(!foreign.contains("http://") && !foreign.contains("https://"), "{name}");
    assert!(!foreign.contains("<script") && !foreign.contains("NaN"), "{name}");
}

#[test]
fn the_page_of_an_evaluation_shows_every_sleeper_and_every_picture() {
    let recording = recording();
    let extractor = Extractor::new(&FeatureDefinition::default()).expect("default features");
    let mut evaluation = evaluation(&recording, &extractor);
    let page =
        evaluation_page(&evaluation, None, &recording, &extractor, "tracktwin evaluate ride");
    keep("report.html", &page);
    for sleeper in &evaluation.sleepers {
        assert!(page.contains(&format!("<td>{}</td>", sleeper.id)), "{}", sleeper.id);
    }
    // Six parameters, signal and two maps, four spectra.
    assert_eq!(page.matches("class=\"chart\"").count(), 6 + 3 + 4);
    assert_eq!(page.matches("data:image/png;base64,").count(), 2);
    // The six again, in a frame of their own.
    let picture = evaluation_chart(&evaluation);
    keep("track.svg", &picture);
    assert_eq!(picture.matches("class=\"chart\"").count(), 6 + 1);
    assert!(page.contains("ring &lt;1&gt;") && !page.contains("ring <1>"));
    assert!(page.contains("1 sleeper is flagged"), "the summary counts flags");
    // Heading and label of one chart.
    assert_eq!(page.matches("(not resolved)").count(), 2);
    assert_eq!(page.matches("Railpad damping (not resolved)").count(), 2);
    // The best match is |sin| off, 2/pi of ln of a power on average.
    let decibel = 2.0 / PI * 10.0 / LN_10;
    let cells = page.matches(&format!("<td>{decibel:.2}</td>")).count();
    assert_eq!(cells, evaluation.sleepers.len());
    assert!(
        page.contains("left out: pass 2") && page.contains("<pre>tracktwin evaluate ride</pre>")
    );
    evaluation.sleepers.iter_mut().for_each(|sleeper| sleeper.flags = vec![Flag::MissingSpeed]);
    let page = evaluation_page(&evaluation, None, &recording, &extractor, "");
    assert!(!page.contains("km/h: ;") && page.contains("all are flagged"));
}

#[test]
fn maps_are_of_the_fastest_pass_that_covers_the_middle() {
    let mut recording = recording();
    let extractor = Extractor::new(&FeatureDefinition::default()).expect("default features");
    let evaluation = evaluation(&recording, &extractor);
    let whole = recording.passes[0].clone();
    // The pass ends before the track, then begins behind it.
    for beside_m in [-5.0, 5.0] {
        let moved = whole.position_m.iter().map(|x_m| x_m + beside_m).collect();
        recording.passes = vec![Pass { position_m: moved, ..whole.clone() }];
        let page = evaluation_page(&evaluation, None, &recording, &extractor, "");
        assert_eq!(page.matches("class=\"chart\"").count(), 6 + 4);
        assert!(!page.contains("Measured data"));
    }
    recording.passes.push(Pass { speed_km_h: 7.0, ..whole });
    let page = evaluation_page(&evaluation, None, &recording, &extractor, "");
    assert_eq!(page.matches("class=\"chart\"").count(), 6 + 3 + 4);
    assert!(page.contains("Axle-box acceleration, 7 km/h"));
}

#[test]
fn estimates_outside_the_library_are_drawn_and_said_as_not_valid() {
    let recording = recording();
    let extractor = Extractor::new(&FeatureDefinition::default()).expect("the usual features");
    let mut evaluation = evaluation(&recording, &extractor);
    let all = evaluation.sleepers.len();
    let plain = evaluation_page(&evaluation, None, &recording, &extractor, "");
    assert!(!plain.contains("class=\"banner\"") && !plain.contains("dot hollow"));
    let end = BeyondEnd {
        parameter: Parameter::BallastStiffness,
        side: Side::Low,
        value: 4e6,
        sleepers: all,
    };
    evaluation.outside_library = OutsideLibrary {
        share: 1.0,
        not_tested: 0.0,
        widen: vec![Parameter::BallastStiffness],
        ends: vec![end],
        unexplained: 0,
    };
    evaluation.notes.extend(evaluation.outside_library.sentences());
    let flag = |sleeper: &mut SleeperEvaluation| sleeper.flags.push(Flag::OutsideLibrary);
    evaluation.sleepers.iter_mut().for_each(flag);
    let page = evaluation_page(&evaluation, None, &recording, &extractor, "");
    keep("evaluation-outside.html", &page);
    assert!(page.contains("class=\"banner\"") && page.contains("not valid"));
    // Said once, though the notes hold it too.
    assert_eq!(page.matches("widen `ballast_stiffness_N_m`").count(), 1);
    // Processes and selector, six parameters; no line or band is left.
    assert_eq!(page.matches("class=\"dot hollow\"").count(), 2 * 6 * all);
    assert_eq!(page.matches("class=\"band a\"").count(), 0);
    assert_eq!(page.matches("<tr class=\"invalid\">").count(), all);
    let ranges = page.matches("ballast stiffness 1").count();
    assert_eq!(ranges, 0, "the summary tells no range that is not valid");
}

#[test]
fn the_page_of_the_models_has_a_bar_for_every_model_and_a_dot_for_every_tested_case() {
    let models = models();
    let pairs: Vec<_> = (0..500).map(|i| f64::from(i) * 5e5 + 1e7).map(|x| (x, x * 1.1)).collect();
    let page = models_page(&models, &[(Parameter::RailpadStiffness, pairs)]);
    keep("models.html", &page);
    // Two feature sets at two speeds and one at both together, two parameters each.
    assert_eq!(page.matches("<rect class=\"bar").count(), 2 * (2 * 2 + 1));
    assert!(page.contains("10 + 13"));
    assert_eq!(page.matches("<circle").count(), 500);
}

#[test]
fn receptances_are_a_picture_of_their_own() {
    let frequencies: Vec<f64> =
        (0..400).map(|i| 50.0 * 160f64.powf(f64::from(i) / 399.0)).collect();
    let curve = |name: &str, resonance_hz: f64| {
        let value = |&f: &f64| {
            let ratio = f / resonance_hz;
            1e-8 / num_complex::Complex64::new(1.0 - ratio * ratio, 0.1 * ratio)
        };
        ReceptanceCurve { name: name.to_owned(), values: frequencies.iter().map(value).collect() }
    };
    let svg = receptance_chart(&frequencies, &[curve("sleeper", 300.0), curve("midspan", 900.0)]);
    keep("receptance.svg", &svg);
}
