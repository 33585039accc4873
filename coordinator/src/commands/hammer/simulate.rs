//! `tracktwin hammer simulate`: a table of simulated receptances, to test the evaluation.

use crate::commands::files::{Force, check, is_stream, write_file};
use crate::commands::numbers::{count, number};
use crate::commands::simulate::{Setting, check_sleepers};
use crate::commands::track::TrackChoice;
use crate::commands::{OrInput, Stop, println_stdout};
use anyhow::anyhow;
use clap::Args;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_hammer::{HammerTest, SLEEPERS_MAX, Selection, table, truth};
use tracktwin_parameters::{Parameter, ParameterSet, Quantity, Track};
use tracktwin_track::model::Support;

const SLEEPERS: Quantity =
    Quantity::count("number of struck sleepers", [1, SLEEPERS_MAX as u64], [5, 50]);
const HITS: Quantity = Quantity::count("number of hits", [2, 1000], [3, 10]);
const UNEVENNESS: Quantity = Quantity::new("unevenness", "%", [0.0, 60.0], [5.0, 30.0]);
const NOISE: Quantity = Quantity::new("noise of a hit", "%", [0.0, 100.0], [1.0, 20.0]);

/// Frequencies per octave, and share by which the table exceeds the fitted frequency range.
const PER_OCTAVE: f64 = 24.0;
const BEYOND: f64 = 1.5;

/// Arguments of `hammer simulate`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin hammer simulate --sleepers 12 --set railpad_stiffness_N_m@SN5=4e7 --out hammer.csv

The rail is struck above every sleeper and at midspan behind it. Sleeper SN0 stands at 0 m. The true
values are written beside the table, as hammer-truth.csv.

The receptances are those of the track model that `hammer evaluate` fits: the example shows how the
evaluation works, not how accurate it is.")]
pub(in crate::commands) struct Arguments {
    /// Number of sleepers above and behind which the rail is struck.
    #[arg(long, default_value_t = 12, value_parser = count::<usize>(SLEEPERS))]
    sleepers: usize,
    /// Value of a parameter at all sleepers or some, e.g. `railpad_stiffness_N_m@SN5=4e7`; may be
    /// repeated.
    #[arg(long = "set", value_name = "NAME[@SLEEPERS]=VALUE")]
    settings: Vec<Setting>,
    /// Unevenness of railpad and ballast stiffness from sleeper to sleeper in %.
    #[arg(long, default_value_t = 0.0, value_name = "PERCENT", value_parser = number(UNEVENNESS))]
    unevenness: f64,
    /// Hits that are averaged at a place.
    #[arg(long, default_value_t = 5, value_parser = count::<usize>(HITS))]
    hits: usize,
    /// Noise of one hit in % of the receptance.
    #[arg(long, default_value_t = 5.0, value_name = "PERCENT", value_parser = number(NOISE))]
    noise: f64,
    /// Seed of unevenness and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Output file (CSV); the true values are written beside it.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    track: TrackChoice,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { out, force, .. } = arguments;
    let names = if is_stream(out) { None } else { Some(names(out)?) };
    if let Some((folder, names)) = &names {
        check(folder, Kind::Curves, *force, &[names[0].as_str(), names[1].as_str()])?;
    }
    check_sleepers(&arguments.settings, arguments.sleepers).or_input()?;
    let track = arguments.track.track()?;
    let test = hammer_test(arguments, &track);
    let points = test.receptances(&track.design).or_input()?;
    let Some((folder, [table_name, truth_name])) = names else {
        return Ok(write_file(out, Kind::Curves, *force, table(&points).as_bytes())?);
    };
    let mut output = Output::in_folder(&folder, Kind::Curves, force.force)?;
    output.add(&truth_name, truth(&test, &track.design).as_bytes())?;
    output.add(&table_name, table(&points).as_bytes())?;
    output.commit()?;
    let truth = truth_name.within(&folder);
    println_stdout(&format!(
        "{} receptances: {}; true values: {}",
        points.len(),
        out.display(),
        truth.display()
    ));
    Ok(())
}

/// Output folder, and names of the files with the table and with the true values.
fn names(out: &Path) -> Result<(PathBuf, [FileName; 2]), Stop> {
    let (folder, table) = FileName::of_path(out)?;
    let stem = out.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let stem = stem.ok_or_else(|| anyhow!("--out {}: this is not a file", out.display()));
    let truth = FileName::new(&format!("{}-truth.csv", stem.or_input()?))?;
    Ok((folder, [table, truth]))
}

fn hammer_test(arguments: &Arguments, track: &Track) -> HammerTest {
    let mut random = ChaCha8Rng::seed_from_u64(arguments.seed);
    let mut factor = || -> f64 {
        let normal: f64 = StandardNormal.sample(&mut random);
        (0.01 * arguments.unevenness * normal).exp()
    };
    // Unevenness is that of the stated track; what is stated of single sleepers is their value.
    let (single, everywhere): (Vec<_>, Vec<_>) =
        arguments.settings.iter().partition(|setting| setting.sleepers.is_some());
    let apply = |settings: &[&Setting], set: ParameterSet, number: usize| {
        settings.iter().fold(set, |set, setting| setting.apply(set, number))
    };
    let others = apply(&everywhere, track.nominal, 0);
    let support = |number: usize| {
        let mut set = others;
        for of in [Parameter::RailpadStiffness, Parameter::BallastStiffness] {
            set[of] *= factor();
        }
        Support::from(&apply(&single, set, number))
    };
    let supports = (0..arguments.sleepers).map(support).collect();
    let [low, high] = Selection::usual(&track.design).range_hz;
    let (low, high) = (low / BEYOND, high * BEYOND);
    let steps = ((high / low).log2() * PER_OCTAVE).floor() as usize;
    HammerTest {
        supports,
        others: Support::from(&others),
        frequencies_hz: (0..=steps).map(|step| low * (step as f64 / PER_OCTAVE).exp2()).collect(),
        hits: arguments.hits,
        noise: 0.01 * arguments.noise,
        seed: arguments.seed,
    }
}
