//! `tracktwin simulate`: passes over one track, written as a recording.

mod setting;
mod track;

use super::{OrInput, Stop};
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal};
pub(super) use setting::Setting;
use std::path::PathBuf;
use track::SimulatedTrack;
use tracktwin_parameters::Preset;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_track::model::Surface;
use tracktwin_track::time::{self, PassRecord};

/// Spans at either end of the track that are not recorded: the ends are held.
const END_SPANS: usize = 6;

/// Spans that the wheel runs before anything is recorded.
const RUN_IN_SPANS: usize = 3;

/// What `simulate` is told.
#[derive(Args)]
pub(super) struct Arguments {
    /// Folder to write the recording to.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Speed in km/h; may stand several times [default: the preset's three].
    #[arg(long = "speed", value_name = "KMH")]
    speeds_km_h: Vec<f64>,
    /// Sleeper spans of the track; recorded is what lies six or more from either end.
    #[arg(long, default_value_t = 25)]
    spans: usize,
    /// Seed of the surface and of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A parameter's value, everywhere or at some sleepers; may stand several times:
    /// `railpad_stiffness_N_m=9e7`, `ballast_stiffness_N_m@SN12=4e6`, `...@SN12-SN15=4e6`.
    #[arg(long = "set", value_name = "NAME[@SLEEPERS]=VALUE")]
    settings: Vec<Setting>,
    /// Track to start from.
    #[arg(long, value_enum, default_value_t = Track::VTrack)]
    preset: Track,
    /// Passes at each speed.
    #[arg(long, default_value_t = 1)]
    passes: u32,
    /// Share of the surface's power that differs from pass to pass, 0 to 1.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    unrepeated: f64,
    /// Standard deviation of the sensor's white noise in m/s2.
    #[arg(long, default_value_t = 0.0, value_name = "M_S2")]
    noise: f64,
    /// Stiffness of sleeper bolts in N/m (physics beyond the paper: a spring from each sleeper's
    /// end to the ground).
    #[arg(long, value_name = "N_M")]
    sleeper_bolt: Option<f64>,
    /// Rail elements a span.
    #[arg(long, default_value_t = 8)]
    rail_elements: usize,
    /// Elements of a half sleeper.
    #[arg(long, default_value_t = 8)]
    sleeper_elements: usize,
    /// Time step in s, at the same time the sample interval.
    #[arg(long, default_value_t = 1e-5, value_name = "S")]
    time_step: f64,
    /// Leave out the local flexibility of the loaded element, as the paper does.
    #[arg(long)]
    no_local_flexibility: bool,
}

/// A preset by its name on the command line.
#[derive(Clone, Copy, ValueEnum)]
pub(super) enum Track {
    /// The downscaled test rig of the paper.
    VTrack,
    /// V-Track enlarged five times.
    RealScale,
}

impl From<Track> for Preset {
    fn from(track: Track) -> Self {
        match track {
            Track::VTrack => Self::VTrack,
            Track::RealScale => Self::RealScale,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let track = SimulatedTrack::new(arguments)?;
    let recording = record(arguments, &track)?;
    recording.write(&arguments.out)?;
    std::fs::write(arguments.out.join("truth.json"), track.truth_json())?;
    super::say(&format!("recording: {}", arguments.out.display()));
    Ok(())
}

/// Runs the wheel over the track, so often at each speed.
fn record(arguments: &Arguments, track: &SimulatedTrack) -> Result<Recording, Stop> {
    let speeds_km_h = match &arguments.speeds_km_h[..] {
        [] => Preset::from(arguments.preset).speeds_km_h(),
        given => given.to_vec(),
    };
    let [from_m, to_m] = track.recorded_m();
    let mut passes = Vec::new();
    for speed_km_h in speeds_km_h {
        let drive = time::Pass {
            speed_m_s: speed_km_h / 3.6,
            start_m: from_m - RUN_IN_SPANS as f64 * track.design().sleeper.spacing_m,
            end_m: to_m,
            time_step_s: arguments.time_step,
            local_flexibility: !arguments.no_local_flexibility,
        };
        let number = 0..arguments.passes;
        let seeds: Vec<_> =
            number.map(|pass| pass_seed(arguments.seed, speed_km_h, pass)).collect();
        let surfaces: Vec<_> = seeds.iter().map(|&seed| surface(arguments, track, seed)).collect();
        let models = vec![track.model().clone(); surfaces.len()];
        let driven = time::passes(&models, &drive, &surfaces).or_input()?;
        for (record, seed) in driven.iter().zip(seeds) {
            passes.push(measured(record, from_m, speed_km_h, arguments.noise, seed)?);
        }
    }
    Ok(Recording {
        name: arguments.out.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        sample_rate_hz: sample_rate_hz(arguments.time_step),
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes,
        sleepers: track.sleepers_between(from_m, to_m),
        nominal: track.nominal(),
        spacing_m: track.design().sleeper.spacing_m,
    })
}

/// The surface that a pass sees: shared by all passes but for the unrepeated share.
fn surface(arguments: &Arguments, track: &SimulatedTrack, pass_seed: u64) -> Surface {
    let (level, length_m) = (track.level(), track.length_m());
    let shared = Surface::rough(arguments.seed, level, length_m);
    if arguments.unrepeated > 0.0 {
        shared.blend(&Surface::rough(pass_seed, level, length_m), arguments.unrepeated)
    } else {
        shared
    }
}

/// A seed for what differs from pass to pass.
fn pass_seed(seed: u64, speed_km_h: f64, pass: u32) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin simulated pass 1");
    hasher.update(&seed.to_le_bytes()).update(&speed_km_h.to_le_bytes());
    hasher.update(&pass.to_le_bytes());
    let hash = hasher.finalize();
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

/// Samples a second, to the nanohertz: 1 / 2e-5 s is 50 kHz, not 49999.99999999999 Hz.
fn sample_rate_hz(time_step_s: f64) -> f64 {
    (1e9 / time_step_s).round() / 1e9
}

/// What the sensor makes of a pass, from `from_m` on.
fn measured(
    record: &PassRecord,
    from_m: f64,
    speed_km_h: f64,
    noise_m_s2: f64,
    seed: u64,
) -> Result<Pass, Stop> {
    let step_m = record.speed_m_s * record.time_step_s;
    let position = |index: usize| record.start_m + (index + 1) as f64 * step_m;
    let indices = 0..record.acceleration_m_s2.len();
    let recorded: Vec<_> = indices.filter(|&index| position(index) >= from_m).collect();
    let noise = Normal::new(0.0, noise_m_s2)
        .map_err(|_| anyhow!("--noise: {noise_m_s2} is no standard deviation; give m/s2"))
        .or_input()?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let samples = recorded
        .iter()
        .map(|&index| record.acceleration_m_s2[index] + noise.sample(&mut random))
        .collect();
    Ok(Pass {
        file: String::new(),
        speed_km_h,
        signal: Signal::new(sample_rate_hz(record.time_step_s), samples)?,
        position_m: recorded.into_iter().map(position).collect(),
    })
}
