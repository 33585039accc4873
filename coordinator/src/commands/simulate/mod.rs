//! `tracktwin simulate`: passes over one track, written as a recording.

mod setting;

use super::{OrInput, Stop};
use clap::{Args, ValueEnum};
use serde_json::json;
use setting::Setting;
use std::path::PathBuf;
use tracktwin_parameters::{Parameter, ParameterSet, Preset, TrackDesign};
use tracktwin_signal::recording::{NewPass, NewRecording, Sleeper};
use tracktwin_track::extension::{Extension, SleeperBolt};
use tracktwin_track::time::{self, Pass};
use tracktwin_track::{Mesh, Roughness, Support, Surface, TrackModel};

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
