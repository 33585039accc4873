//! Times the rows of a stream, from lines of CSV to lines of JSON, and the memory that it takes.
//!
//! `cargo run --release -p tracktwin-evaluation --example on_board -- 10000`: models of a made-up
//! library of so many entries, half of which train. Linux only. Bind it to one core with `taskset`.

use std::fmt::Write as _;
use std::time::Instant;
use tracktwin_evaluation::{BySpeeds, Outcome, Stream, Twin};
use tracktwin_parameters::{Parameter, Scale};
use tracktwin_signal::recording::{Recording, Sleeper};
use tracktwin_signal::samples::{Framing, SampleReader};
use tracktwin_signal::{Extractor, FeatureDefinition};
use tracktwin_surrogate::{FeatureColumns, InputScaling, TrainOptions, TrainingSet, train};

/// Sleepers of a section.
const SLEEPERS: u32 = 60;

/// A train: its name, samples per second in Hz, speed in km/h and sleeper spacing in m.
const TRAINS: [(&str, f64, f64, f64); 2] =
    [("V-Track", 1e5, 13.0, 0.125), ("line", 25_600.0, 80.0, 0.6)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let entries = std::env::args().nth(1).unwrap_or_else(|| "10000".to_owned()).parse()?;
    for (name, rate_hz, speed_km_h, spacing_m) in TRAINS {
        let library = library(entries, speed_km_h);
        let all = FeatureColumns::new("GF", 0..library.frequencies_hz.len());
        // The scaling that training usually chooses.
        let scalings = vec![InputScaling::Whitened { components: 16, shrinkage: 0.1 }];
        let options = TrainOptions { scalings, ..TrainOptions::new(vec![all]) };
        let models = train(&library, &options, &|_| ())?;
        let extractor = Extractor::new(&FeatureDefinition::default())?;
        let by_speeds = BySpeeds::default();
        let twin = Twin {
            extractor: &extractor,
            models: &models,
            library: &library,
            by_speeds: &by_speeds,
        };
        let section = section(rate_hz, spacing_m);
        let begun = Instant::now();
        let mut stream = Stream::new(&section, twin)?;
        let ready_s = begun.elapsed().as_secs_f64();
        let (held, ready_kb) = (stream.samples_max(), memory_kb("VmRSS"));

        let text = csv(rate_hz, speed_km_h, spacing_m);
        let text_kb = text.len() / 1024;
        let mut reader = SampleReader::new(text.as_bytes(), Framing::Csv);
        let (mut rows, mut bytes, mut longest_s) = (0_u32, 0, 0.0_f64);
        let (begun, cpu) = (Instant::now(), cpu_s());
        while let Some(sample) = reader.next_sample()? {
            let begun = Instant::now();
            for row in stream.push(&sample)? {
                rows += u32::from(matches!(row.outcome, Outcome::Evaluated(_)));
                bytes += row.to_json().len();
                longest_s = longest_s.max(begun.elapsed().as_secs_f64());
            }
        }
        let each = |seconds: f64| 1e3 * seconds / f64::from(rows);
        println!(
            "{name}: {:.1} ms of CPU and {:.1} ms by the clock per sleeper, at most {:.1} ms; a bay takes \
             {:.1} ms; {} bytes a row; ready in {ready_s:.1} s; at most {held} samples held; {} MB with \
             models and library, {} MB more at the end",
            each(cpu_s() - cpu),
            each(begun.elapsed().as_secs_f64()),
            1e3 * longest_s,
            3.6e3 * spacing_m / speed_km_h,
            bytes / rows as usize,
            ready_kb / 1024,
            memory_kb("VmRSS").saturating_sub(ready_kb + text_kb) / 1024,
        );
    }
    Ok(())
}

/// Numbers between -1 and 1 (Knuth's MMIX).
fn noise() -> impl FnMut() -> f64 {
    let mut state = 1_u64;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Ln-powers smooth in six parameters, and a scatter that is alike in neighbouring bins.
fn library(entries: usize, speed_km_h: f64) -> TrainingSet {
    let definition = FeatureDefinition::default();
    let frequencies_hz = definition.frequencies_hz();
    let bins = frequencies_hz.len();
    let mut white = noise();
    let (mut log_power, mut parameters) = (Vec::new(), Vec::new());
    for _ in 0..entries {
        let values: Vec<f64> = Parameter::ALL.iter().map(|_| white()).collect();
        let mut scatter = 0.0;
        for bin in 0..bins {
            let place = bin as f64 / bins as f64;
            scatter = 0.9 * scatter + 0.44 * white();
            let waves = values.iter().zip(1..);
            let smooth: f64 = waves.map(|(p, k)| p * (f64::from(k) * 3.0 * place + p).sin()).sum();
            log_power.push(smooth + scatter);
        }
        parameters.extend(values.iter().map(|value| 2.0 + value));
    }
    TrainingSet {
        frequencies_hz,
        speeds_km_h: vec![speed_km_h],
        log_power: vec![log_power],
        varied: Parameter::ALL.to_vec(),
        scales: vec![Scale::Linear; Parameter::COUNT],
        parameters,
        campaign: "made up".to_owned(),
        library_digest: "made up".to_owned(),
        feature_definition: serde_json::to_value(definition).unwrap_or_default(),
    }
}

fn section(rate_hz: f64, spacing_m: f64) -> Recording {
    let sleeper =
        |index: u32| Sleeper { id: format!("S{index}"), x_m: spacing_m * (f64::from(index) + 0.5) };
    Recording {
        name: "section".to_owned(),
        sample_rate_hz: rate_hz,
        channel: String::new(),
        passes: Vec::new(),
        sleepers: (0..SLEEPERS).map(sleeper).collect(),
        nominal: serde_json::Map::new(),
        spacing_m,
        doubts: Vec::new(),
    }
}

/// Noise over the section and three sleepers more, as a recorder sends it.
fn csv(rate_hz: f64, speed_km_h: f64, spacing_m: f64) -> String {
    let mut white = noise();
    let step_m = speed_km_h / 3.6 / rate_hz;
    let count = (f64::from(SLEEPERS + 3) * spacing_m / step_m) as usize;
    let mut text = "time_s,position_m,acceleration_m_s2\n".to_owned();
    for index in 0..count {
        let (time_s, position_m) = (index as f64 / rate_hz, index as f64 * step_m);
        let _ = writeln!(text, "{time_s:.6},{position_m:.6},{:.4}", 10.0 * white());
    }
    text
}

/// CPU seconds of all threads of this process so far.
fn cpu_s() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds = tasks.filter_map(|task| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() * 1e-9
}

/// A line of this process's `status`, in kB.
fn memory_kb(name: &str) -> usize {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with(name)).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).unwrap_or_default()
}
