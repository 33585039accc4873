//! Comparison of simulated levels with those of a simulator that shares no code with this project.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fmt::Write as _;
use test_needs::reference;
use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{PowerSpectrum, Signal};
use tracktwin_track::model::{Mesh, Roughness, Support, Surface, TrackModel};
use tracktwin_track::time::{Pass, passes};

/// Number of spans for the run-in, before the window of the reference.
const RUN_IN_SPANS: f64 = 5.0;
/// Time step on V-Track and on the line. On the line it gives the reference's bins of 6.25 Hz. Near the
/// resonance of wheel and track, one-third-octave levels depend on the bins.
const TIME_STEP_S: f64 = 1e-5;
const LINE_TIME_STEP_S: f64 = 1.0 / 102_400.0;
/// Length of a segment in the reference's Welch analysis, in samples.
const SEGMENT: usize = 16_384;
/// Lowest compared frequency. Below it, the analysis window smears the wheel-on-track resonance (README of
/// the reference).
const LOWEST_HZ: f64 = 124.0;
/// Range of the bands compared on the line, in Hz.
const LINE_HZ: [f64; 2] = [39.0, 4100.0];
/// Range of the wavelengths of the line's surface, in m.
const LINE_WAVELENGTHS_M: [f64; 2] = [2e-3, 3.0];
/// Allowed difference of two correct programs in dB, in addition to two standard errors of both.
const TOLERANCE_DB: f64 = 0.5;

/// Mean level over surfaces, with its standard error, both in dB.
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

/// A data set of the reference, with the settings of its simulation.
struct Reference {
    name: String,
    set: ParameterSet,
    design: TrackDesign,
    spans: usize,
    time_step_s: f64,
    /// Shortest and longest wavelength of the surface, in m.
    wavelengths_m: [f64; 2],
    /// Range of the compared bands, in Hz.
    compared_hz: [f64; 2],
    window_m: [f64; 2],
    centres_hz: Vec<f64>,
    speeds: Vec<(f64, Vec<Level>)>,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn file(name: &str) -> Value {
    let path = reference().join(format!("levels/{name}.json"));
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

impl Reference {
    /// A data set on V-Track.
    fn v_track(name: &str) -> Self {
        let file = file(&format!("ensemble-{name}"));
        Self::read(name, &file, TrackDesign::v_track(), 40, [0.25e-3, 1.0], [LOWEST_HZ, f64::MAX])
    }

    /// A data set on a line with 60E1 rails, as described in the reference.
    fn line(name: &str) -> Self {
        let file = file(&format!("line-{name}"));
        let nominal = file["nominal"].as_object().unwrap().clone();
        let spacing_m = nominal["sleeper"]["spacing_m"].as_f64().unwrap();
        let stating = Recording {
            name: name.to_owned(),
            sample_rate_hz: 25.6e3,
            channel: String::new(),
            passes: Vec::new(),
            sleepers: Vec::new(),
            nominal,
            spacing_m,
            doubts: Vec::new(),
        };
        let mut design = stating.stated_track().track.design;
        design.contact_patch_filter = false;
        let spans = usize::try_from(file["spans"].as_u64().unwrap()).unwrap();
        let set = Self::read(name, &file, design, spans, LINE_WAVELENGTHS_M, LINE_HZ);
        Self { time_step_s: LINE_TIME_STEP_S, ..set }
    }

    fn read(
        name: &str,
        file: &Value,
        design: TrackDesign,
        spans: usize,
        wavelengths_m: [f64; 2],
        compared_hz: [f64; 2],
    ) -> Self {
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
            design,
            spans,
            time_step_s: TIME_STEP_S,
            wavelengths_m,
            compared_hz,
            window_m: [window[0], window[1]],
            centres_hz: numbers(&file["centre_Hz"]),
            speeds: file["speeds"].as_object().unwrap().iter().map(speed).collect(),
        }
    }

    /// Simulated levels at a speed, in the order of the band centres.
    fn simulate(&self, speed_km_h: f64, surfaces: u32) -> Vec<Level> {
        let supports = vec![Support::from(&self.set); self.spans - 1];
        let mesh = Mesh::uniform(self.spans, 8, 8);
        let model = TrackModel::build(&self.design, &mesh, &supports, &[]).unwrap();
        let start_m = self.window_m[0] - RUN_IN_SPANS * self.design.sleeper.spacing_m;
        let pass = Pass {
            speed_m_s: speed_km_h / 3.6,
            start_m,
            end_m: self.window_m[1],
            time_step_s: self.time_step_s,
            local_flexibility: true,
        };
        let level = self.set[Parameter::IrregularityLevel];
        let roughness = Roughness::between(level, self.wavelengths_m);
        let rough: Vec<Surface> =
            (0..surfaces).map(|seed| model.surface(&roughness, u64::from(seed))).collect();
        let models = vec![model; rough.len()];
        let records = passes(&models, &pass, &rough).unwrap();
        let spectra: Vec<PowerSpectrum> = records
            .iter()
            .map(|record| {
                let before = (self.window_m[0] - start_m) / (pass.speed_m_s * pass.time_step_s);
                let kept = record.acceleration_m_s2[before.round() as usize..].to_vec();
                let signal = Signal::new(1.0 / pass.time_step_s, kept).unwrap();
                PowerSpectrum::welch(&signal, SEGMENT).unwrap()
            })
            .collect();
        let levels = |&centre: &f64| {
            let of = |spectrum: &PowerSpectrum| spectrum.third_octave_level(centre).unwrap();
            Level::of(&spectra.iter().map(of).collect::<Vec<_>>())
        };
        self.centres_hz.iter().map(levels).collect()
    }

    fn is_compared(&self, centre_hz: f64) -> bool {
        let [lowest_hz, highest_hz] = self.compared_hz;
        (lowest_hz..highest_hz).contains(&centre_hz)
    }

    /// Table of all levels, and one line for each difference that is too large.
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
                if self.is_compared(*centre) && difference.abs() > allowed {
                    misses.push(format!("set {}, {speed} km/h: {row}", self.name));
                }
            }
        }
        (table, misses)
    }
}

fn agrees(reference: &Reference, surfaces: u32) {
    let (table, misses) = reference.compare(surfaces);
    println!("{table}");
    assert!(misses.is_empty(), "too far from the reference:\n{}", misses.join("\n"));
}

#[test]
fn levels_of_set_a_agree_with_the_reference() {
    agrees(&Reference::v_track("A"), 8);
}

#[test]
fn levels_of_set_b_agree_with_the_reference() {
    agrees(&Reference::v_track("B"), 8);
}

#[test]
fn levels_of_a_line_with_one_wheel_agree_with_the_reference() {
    agrees(&Reference::line("A"), 8);
}

#[test]
#[ignore = "two of 63 levels miss the tolerance at 500 Hz; see docs/accuracy.md"]
fn levels_of_a_line_with_a_bogie_agree_with_the_reference() {
    agrees(&Reference::line("B"), 10);
}

#[test]
#[ignore = "takes minutes; makes the tables of docs/measurements/accuracy.md"]
fn levels_over_thirty_surfaces_agree_with_the_reference() {
    for name in ["A", "B"] {
        agrees(&Reference::v_track(name), 30);
    }
}
