//! `tracktwin simulate`: simulates passes over one track and writes them as a recording.

mod cost;
mod extensions;
mod sampling;
mod sensor;
mod setting;
mod time_step;
mod track;

use super::files::{Force, check};
use super::numbers::{count, number};
use super::progress::Progress;
use super::track::TrackChoice;
use super::{OrInput, Stop, print_json, println_stderr, println_stdout};
use anyhow::anyhow;
use clap::Args;
pub(super) use extensions::Extensions;
use sensor::Sensor;
use serde_json::{Value, json};
pub(super) use setting::{Setting, check_sleepers, check_whole_track};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use track::SimulatedTrack;
use tracktwin_drawing::percent;
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_parameters::quantity::{ELEMENTS, PASSES, SPANS, SPEED, TIME_STEP};
use tracktwin_parameters::unit;
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_track::extension::Class;
use tracktwin_track::model::Surface;
use tracktwin_track::time;

/// Spans at either end of the track that are not recorded, because the ends are fixed.
const END_SPANS: usize = 6;

/// Spans that the wheel travels before the recording starts.
const RUN_IN_SPANS: usize = 3;

/// File with the simulated parameters and extensions.
const TRUTH: &str = "truth.json";

/// Arguments of `simulate`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin simulate --passes 2 --noise 0.05 --set ballast_stiffness_N_m@SN12=4e6 --out ride

Parameters of --set: railpad_stiffness_N_m, railpad_damping_N_s_m, ballast_stiffness_N_m,
ballast_damping_N_s_m, sleeper_EI_N_m2, irregularity_level.

Next: `tracktwin evaluate ride --out result` or `tracktwin diagnose ride --out result`")]
pub(super) struct Arguments {
    /// Output folder of the recording; the simulated parameters are written to `truth.json` in it.
    #[arg(long, value_name = "DIR", required_unless_present = "extend")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Speed in km/h; may be repeated [default: those of the track, 7, 10 and 13 on V-Track].
    #[arg(long = "speed", value_name = "KMH", value_parser = number(SPEED))]
    speeds_km_h: Vec<f64>,
    /// Number of sleeper spans of the track; the six spans at either end are not recorded.
    #[arg(long, default_value_t = 25, value_parser = count::<usize>(SPANS))]
    spans: usize,
    /// Seed of surface and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Value of a parameter at all sleepers or at some of them, e.g. `railpad_stiffness_N_m=9e7`,
    /// `ballast_stiffness_N_m@SN12=4e6`, `...@SN12-SN15=4e6`; may be repeated.
    #[arg(long = "set", value_name = "NAME[@SLEEPERS]=VALUE")]
    settings: Vec<Setting>,
    #[command(flatten)]
    track: TrackChoice,
    /// Number of passes at each speed.
    #[arg(long, default_value_t = 1, value_parser = count::<u32>(PASSES))]
    passes: u32,
    /// Share of the surface's power that differs from pass to pass, 0 to 1.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE", value_parser = share)]
    unrepeated: f64,
    #[command(flatten)]
    sensor: Sensor,
    #[command(flatten)]
    extensions: Extensions,
    /// Number of rail elements per span.
    #[arg(long, default_value_t = 8, value_parser = count::<usize>(ELEMENTS))]
    rail_elements: usize,
    /// Number of elements of a half sleeper.
    #[arg(long, default_value_t = 8, value_parser = count::<usize>(ELEMENTS))]
    sleeper_elements: usize,
    /// Time step in s; also the sample interval, unless `--sample-rate` is given.
    #[arg(long, default_value_t = 1e-5, value_name = "S", value_parser = number(TIME_STEP))]
    time_step: f64,
    /// Neglect the local flexibility of the loaded element, as the paper does.
    #[arg(long)]
    no_local_flexibility: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    if arguments.extensions.asks_for_list() {
        print_list(arguments)?;
        return Ok(());
    }
    let Some(out) = &arguments.out else {
        return Err(anyhow!("--out: the folder of the recording is missing")).or_input();
    };
    check_speeds(arguments).or_input()?;
    check(out, Kind::SimulatedRecording, arguments.force, &["recording.json", TRUTH])?;
    let track = SimulatedTrack::new(arguments)?;
    let drives = drives(arguments, &track);
    cost::check(arguments, &track, &drives).or_input()?;
    let sample_rate_hz = arguments.sensor.sample_rate_hz(arguments.time_step).or_input()?;
    if let Some(line) = time_step::doubt(arguments.time_step, sample_rate_hz) {
        println_stderr(&line);
    }
    let recording = Recording {
        name: out.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        sample_rate_hz,
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: record(arguments, &track, &drives)?,
        sleepers: track.sleepers_recorded(),
        nominal: track.nominal(),
        spacing_m: track.design().sleeper.spacing_m,
        doubts: Vec::new(),
    };
    let mut output = Output::begin(out, Kind::SimulatedRecording, arguments.force.force)?;
    output.add(&FileName::new(TRUTH)?, track.truth_json(&drives).as_bytes())?;
    recording.add_to(&mut output)?;
    output.commit()?;
    if arguments.json {
        print_json(&summary(out, &recording.passes));
    } else {
        println_stdout(&contact_sentence(&recording.passes));
        println_stdout(&format!("recording: {}", out.display()));
    }
    Ok(())
}

/// Prints all kinds of extensions with the values of the chosen track.
fn print_list(arguments: &Arguments) -> Result<(), Stop> {
    let length_ratio = arguments.track.track()?.design.length_ratio();
    if arguments.json {
        print_json(&extensions::list_json(length_ratio));
    } else {
        println_stdout(&extensions::list(length_ratio));
    }
    Ok(())
}

/// The path of the recording and the contact loss of its passes.
fn summary(out: &Path, passes: &[Pass]) -> Value {
    let pass = |pass: &Pass| {
        json!({
            "speed_km_h": pass.speed_km_h, "contact_loss_share": pass.contact_loss_share,
        })
    };
    let passes: Value = passes.iter().map(pass).collect();
    json!({ "recording": out.display().to_string(), "passes": passes })
}

/// Sentence on loss of contact, from the pass with the largest share.
fn contact_sentence(passes: &[Pass]) -> String {
    let lost = passes.iter().filter(|pass| pass.contact_loss_share > Some(0.0));
    let share = |pass: &&Pass| pass.contact_loss_share.unwrap_or(0.0);
    let count = lost.clone().count();
    match lost.max_by(|a, b| share(a).total_cmp(&share(b))) {
        None => "the wheel keeps contact with the rail in every pass".to_owned(),
        Some(worst) => format!(
            "the wheel loses contact with the rail in {count} of {} passes, for up to {} of the time (at {} km/h)",
            passes.len(),
            percent(share(&worst)),
            worst.speed_km_h
        ),
    }
}

/// Checks that no speed is given twice: its passes would have the same seeds and be copies of each other.
fn check_speeds(arguments: &Arguments) -> Result<(), anyhow::Error> {
    let given = &arguments.speeds_km_h;
    let count = |speed: &f64| given.iter().filter(|other| *other == speed).count() as u32;
    match given.iter().find(|speed| count(speed) > 1) {
        None => Ok(()),
        Some(speed) => Err(anyhow!(
            "--speed {speed}: given {} times; give it once, with --passes {} for as many passes at each speed",
            count(speed),
            count(speed) * arguments.passes
        )),
    }
}

/// One pass to simulate.
struct Drive {
    speed_km_h: f64,
    /// Seed of all random numbers that differ between passes.
    seed: u64,
    /// Distance that the wheel has rolled, modulo its circumference, before the origin of the
    /// track.
    wheel_turned_m: f64,
}

/// The passes at each speed.
///
/// If the shape of the wheel matters, every pass except the first starts at a random angle.
fn drives(arguments: &Arguments, track: &SimulatedTrack) -> Vec<Drive> {
    let speeds_km_h = match &arguments.speeds_km_h[..] {
        [] => track.speeds_km_h(),
        given => given.to_vec(),
    };
    let turns = track.kinds().any(|kind| kind.classes.contains(&Class::WheelAngle));
    let circumference_m = TAU * track.design().wheel.radius_m;
    let drive = |speed_km_h: f64, pass: u32, first: bool| {
        let seed = pass_seed(arguments.seed, speed_km_h, pass);
        let wheel_turned_m = if turns && !first { unit(seed) * circumference_m } else { 0.0 };
        Drive { speed_km_h, seed, wheel_turned_m }
    };
    let mut drives = Vec::new();
    for speed_km_h in speeds_km_h {
        for pass in 0..arguments.passes {
            drives.push(drive(speed_km_h, pass, drives.is_empty()));
        }
    }
    drives
}

/// Simulates all passes of a speed together.
fn record(
    arguments: &Arguments,
    track: &SimulatedTrack,
    drives: &[Drive],
) -> Result<Vec<Pass>, Stop> {
    let [from_m, to_m] = track.recorded_m();
    let mut passes = Vec::new();
    let mut progress = Progress::begin("passes", 0, drives.len() as u64);
    for together in drives.chunk_by(|a, b| a.speed_km_h == b.speed_km_h) {
        let speed_km_h = together[0].speed_km_h;
        let pass = time::Pass {
            speed_m_s: speed_km_h / 3.6,
            start_m: from_m - RUN_IN_SPANS as f64 * track.design().sleeper.spacing_m,
            end_m: to_m,
            time_step_s: arguments.time_step,
            local_flexibility: !arguments.no_local_flexibility,
        };
        let turned = |drive: &Drive| track.model().clone().with_wheel_turned(drive.wheel_turned_m);
        let models: Vec<_> = together.iter().map(turned).collect();
        let surfaces: Vec<_> =
            together.iter().map(|drive| surface(arguments, track, drive.seed)).collect();
        let driven = time::passes(&models, &pass, &surfaces).or_input()?;
        for ((model, record), drive) in models.iter().zip(&driven).zip(together) {
            let sensor = &arguments.sensor;
            passes.push(sensor.measured(model, record, speed_km_h, from_m, drive.seed)?);
        }
        progress.at(passes.len() as u64, "");
    }
    progress.end();
    Ok(passes)
}

/// The surface of a pass: shared by all passes, except for the unrepeated share.
fn surface(arguments: &Arguments, track: &SimulatedTrack, pass_seed: u64) -> Surface {
    let roughness = track.roughness();
    let shared = track.model().surface(&roughness, arguments.seed);
    if arguments.unrepeated > 0.0 {
        shared.blend(&track.model().surface(&roughness, pass_seed), arguments.unrepeated)
    } else {
        shared
    }
}

/// Seed of the random numbers of a pass.
fn pass_seed(seed: u64, speed_km_h: f64, pass: u32) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin simulated pass 1");
    hasher.update(&seed.to_le_bytes()).update(&speed_km_h.to_le_bytes());
    hasher.update(&pass.to_le_bytes());
    let hash = hasher.finalize();
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| "write a number from 0 to 1".to_owned())?;
    if (0.0..=1.0).contains(&share) {
        Ok(share)
    } else {
        Err("it must lie between 0 and 1".to_owned())
    }
}
