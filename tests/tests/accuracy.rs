//! Simulated levels against those of a simulator that shares no code with this project.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fmt::Write as _;
use test_needs::reference;
use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};
use tracktwin_signal::{PowerSpectrum, Signal};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::{Pass, passes};

/// The track of the reference.
const SPANS: usize = 40;
/// Five spans before the reference's window for the run-in.
const START_M: f64 = 0.5;
const TIME_STEP_S: f64 = 1e-5;
/// Segment of the reference's Welch analysis at 100 kHz.
const SEGMENT: usize = 16_384;
/// Below it the analysis window smears the wheel-on-track resonance (the reference's README).
const LOWEST_HZ: f64 = 124.0;
/// What two good programs may differ by, in dB; two standard errors of both come on top.
const TOLERANCE_DB: f64 = 0.5;

/// Mean level over surfaces with its standard error, in dB.
#[derive(Clone, Copy, Debug)]
struct Level {
    mean: f64,
    standard_error: f64,
}

impl Level {
    fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance =
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self { mean, standard_error: (variance / count).sqrt() }
    }
}

/// A set of the reference and what it asks for.
struct Reference {
    name: String,
    set: ParameterSet,
    window_m: [f64; 2],
    centres_hz: Vec<f64>,
    speeds: Vec<(f64, Vec<Level>)>,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

impl Reference {
    fn read(name: &str) -> Self {
        let path = reference().join(format!("levels/ensemble-{name}.json"));
        let file: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let mut set = ParameterSet::nominal();
        for (parameter, value) in file["parameters"].as_object().unwrap() {
            let parameter = Parameter::from_name(parameter).unwrap();
            set[parameter] = value.as_f64().unwrap();
        }
        let speed = |(speed, levels): (&String, &Value)| {
            let means = numbers(&levels["level_dB"]);
            let errors = numbers(&levels["standard_error_dB"]);
            let levels = means
                .into_iter()
                .zip(errors)
                .map(|(mean, standard_error)| Level { mean, standard_error })
                .collect();
            (speed.parse().unwrap(), levels)
        };
        let window = numbers(&file["window_m"]);
        Self {
            name: name.to_owned(),
            set,
            window_m: [window[0], window[1]],
            centres_hz: numbers(&file["centre_Hz"]),
            speeds: file["speeds"].as_object().unwrap().iter().map(speed).collect(),
        }
    }

    /// The simulated levels at a speed, in the order of the centres.
    fn simulate(&self, speed_km_h: f64, surfaces: u32) -> Vec<Level> {
        let supports = vec![Support::from(&self.set); SPANS - 1];
        let mesh = Mesh::uniform(SPANS, 8, 8);
        let design = TrackDesign::v_track();
        let model = TrackModel::build(&design, &mesh, &supports, &[]).unwrap();
        let pass = Pass {
            speed_m_s: speed_km_h / 3.6,
            start_m: START_M,
            end_m: self.window_m[1],
            time_step_s: TIME_STEP_S,
            local_flexibility: true,
        };
        let level = self.set[Parameter::IrregularityLevel];
        let rough: Vec<Surface> = (0..surfaces)
            .map(|seed| Surface::rough(u64::from(seed), level, model.layout().length_m()))
            .collect();
        let models = vec![model; rough.len()];
        let records = passes(&models, &pass, &rough).unwrap();
        let spectra: Vec<PowerSpectrum> = records
            .iter()
            .map(|record| {
                let before = (self.window_m[0] - START_M) / (pass.speed_m_s * TIME_STEP_S);
                let kept = record.acceleration_m_s2[before.round() as usize..].to_vec();
                let signal = Signal::new(1.0 / TIME_STEP_S, kept).unwrap();
                PowerSpectrum::welch(&signal, SEGMENT).unwrap()
            })
            .collect();
        let levels = |&centre: &f64| {
            let of = |spectrum: &PowerSpectrum| spectrum.third_octave_level(centre).unwrap();
            Level::of(&spectra.iter().map(of).collect::<Vec<_>>())
        };
        self.centres_hz.iter().map(levels).collect()
    }

    /// The table of all levels, and a line for each that is too far off.
    fn compare(&self, surfaces: u32) -> (String, Vec<String>) {
        let (mut table, mut misses) = (String::new(), Vec::new());
        for (speed, reference) in &self.speeds {
            let simulated = self.simulate(*speed, surfaces);
            writeln!(table, "\nSet {}, {speed} km/h, {surfaces} surfaces\n", self.name).unwrap();
            table += "| centre in Hz | reference in dB | simulated in dB | difference in dB | \
                      allowed in dB |\n|---|---|---|---|---|\n";
            for ((centre, theirs), ours) in self.centres_hz.iter().zip(reference).zip(&simulated) {
                let error = theirs.standard_error.hypot(ours.standard_error);
                let (difference, allowed) = (ours.mean - theirs.mean, TOLERANCE_DB + 2.0 * error);
                let row = format!(
                    "| {centre:.0} | {:.2} ± {:.2} | {:.2} ± {:.2} | {difference:+.2} | {allowed:.2} |",
                    theirs.mean, theirs.standard_error, ours.mean, ours.standard_error
                );
                writeln!(table, "{row}").unwrap();
                if *centre > LOWEST_HZ && difference.abs() > allowed {
                    misses.push(format!("set {}, {speed} km/h: {row}", self.name));
                }
            }
        }
        (table, misses)
    }
}

fn agrees(name: &str, surfaces: u32) {
    let (table, misses) = Reference::read(name).compare(surfaces);
    println!("{table}");
    assert!(misses.is_empty(), "too far from the reference:\n{}", misses.join("\n"));
}

#[test]
fn levels_of_set_a_agree_with_the_reference() {
    agrees("A", 8);
}

#[test]
fn levels_of_set_b_agree_with_the_reference() {
    agrees("B", 8);
}

#[test]
#[ignore = "takes minutes; makes the tables of docs/measurements/accuracy.md"]
fn levels_over_thirty_surfaces_agree_with_the_reference() {
    for name in ["A", "B"] {
        agrees(name, 30);
    }
}
