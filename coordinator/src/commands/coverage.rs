//! `tracktwin coverage`: coverage of the intervals and error rates of the domain check.

use super::evaluate::{Method, stop};
use super::library_url::open_or_create;
use super::progress::Progress;
use super::simulate::{Setting, check_whole_track};
use super::{OrInput, Stop, print_json, println_stdout};
use crate::pipeline::compute::compute;
use crate::pipeline::coverage::{Counts, Coverage, CoverageRow, Kind, inversion_rows};
use crate::pipeline::evaluate::Evaluator;
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use parking_lot::Mutex;
use std::path::PathBuf;
use tracktwin_library::Library;
use tracktwin_parameters::Parameter;
use tracktwin_surrogate::{Side, Trained};
use tracktwin_trial::Making;

/// Largest accepted share of tracks inside the ranges with a sleeper flagged as outside the
/// library.
const FALSE_MOST: f64 = 0.02;
/// Smallest accepted share of tracks 30 % beyond an end that are flagged as outside the library.
const FOUND_LEAST: f64 = 0.95;

/// Arguments of `coverage`.
#[derive(Args)]
#[command(
    after_help = "With --models: simulates tracks with all parameters inside the library's ranges \
        (even tracks, and tracks with an unevenness of railpad and ballast stiffness of 5, 15 and \
        30 %) and tracks with one parameter 30 % beyond an end, evaluates them, and prints two \
        tables: the share flagged as outside the library, and the coverage of the 90 % intervals; \
        in brackets the coverage without the unevenness in the standard deviations.\n\nWith \
            --method inversion: another simulator (--making) records tracks with an unevenness of 5, \
            15 and 30 %, two passes at each of three speeds; the table shows error and coverage \
            of railpad and ballast stiffness.\n\nExit codes: 0 done, 1 more than 2 % of the even \
            tracks inside are \
            flagged as outside the library, 2 wrong input, 3 failure."
)]
pub(super) struct Arguments {
    /// Method whose estimates are compared with the truth.
    #[arg(long, value_enum, default_value_t = Method::Gp)]
    method: Method,
    /// Folder of trained models, written by `train` or `run`; required with `--method gp`.
    #[arg(long, value_name = "DIR", requires = "library")]
    models: Option<PathBuf>,
    /// Library of the models; with `--method inversion` it stores null simulations and is created
    /// if missing.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Number of tracks beyond each end of a range; twice this number lies inside. For `inversion`,
    /// the number of tracks per unevenness.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    tracks: u32,
    /// Number of sleepers of a track (`gp` only).
    #[arg(long, value_name = "N", default_value_t = 14, value_parser = clap::value_parser!(u32).range(1..=200))]
    sleepers: u32,
    /// Seed of parameters and surfaces.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Simulator of the recordings (`inversion` only): `plain` is the reference simulator, `second` another
    /// one with other elements, contact and nuisances.
    #[arg(long, value_enum, default_value_t = Recorder::Plain)]
    making: Recorder,
    /// Add a track with this value and all others in the middle of their ranges (`gp` only), e.g.
    /// `ballast_stiffness_N_m=6e7`; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Simulator of the recordings.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Recorder {
    Plain,
    Second,
}

impl From<Recorder> for Making {
    fn from(recorder: Recorder) -> Self {
        match recorder {
            Recorder::Plain => Self::Plain,
            Recorder::Second => Self::Second,
        }
    }
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let settings = settings(&arguments.settings)?;
    if arguments.method == Method::Inversion {
        if !settings.is_empty() {
            let reason = anyhow!("--set: adds a track to those of --method gp only; leave it out");
            return Err(reason).or_input();
        }
        return by_inversion(&arguments).await;
    }
    let (models, library) = models_and_library(&arguments)?;
    let models = Trained::load(models).or_input()?;
    let library = Library::open_to_read(library).await?;
    let evaluator = Evaluator::new(models, &library).await.map_err(stop)?;
    library.close().await;
    let Arguments { tracks, sleepers, seed, json, .. } = arguments;
    let counts = Counts { tracks: tracks as usize, sleepers: sleepers as usize, seed };
    let rows = compute(|| rows(&evaluator, settings, counts))?;
    if json {
        print_json(&rows);
    } else {
        println_stdout(&tables(&rows));
    }
    let even =
        rows.iter().find(|row| matches!(row.kind, Kind::Inside { scatter } if scatter <= 0.0));
    if even.is_some_and(|row| row.any_outside > FALSE_MOST) { Err(Stop::Negative) } else { Ok(()) }
}

/// The folder of the models and the URL of their library, which the method `gp` needs.
fn models_and_library(arguments: &Arguments) -> Result<(&PathBuf, &str), Stop> {
    match (&arguments.models, &arguments.library) {
        (Some(models), Some(library)) => Ok((models, library)),
        _ => Err(anyhow!(
            "--models: required with --method gp, which is the default, as is the --library of the models; without \
             models use --method inversion"
        ))
        .or_input(),
    }
}

/// Table of the inversion on uneven tracks.
async fn by_inversion(arguments: &Arguments) -> Result<(), Stop> {
    let library = match &arguments.library {
        Some(url) => Some(open_or_create(url).await?),
        None => None,
    };
    let total = 3 * u64::from(arguments.tracks);
    let bar = Mutex::new(Progress::begin("tracks", 0, total));
    let watch = |done, _| bar.lock().at(done, "");
    let Arguments { tracks, seed, making, .. } = *arguments;
    let rows = inversion_rows(tracks, seed, making.into(), library.as_ref(), &watch);
    let rows = rows.await.context("cannot score the inversion")?;
    bar.into_inner().end();
    if arguments.json {
        print_json(&rows);
        return Ok(());
    }
    println_stdout(
        "unevenness  parameter                   sleepers  median |ln error|  in the 90 % interval  correlation  not \
         valid",
    );
    for row in &rows {
        for (parameter, score) in &row.estimates {
            println_stdout(&format!(
                "{:>8.0} %  {:27} {:>8}  {:>17.3}  {:>18.0} %  {:>11}  {:>7.1} %",
                100.0 * row.scatter,
                parameter.label(),
                score.sleepers,
                score.median_log_error,
                100.0 * score.holds_90,
                score.correlation.map_or_else(|| "-".to_owned(), |it| format!("{it:.2}")),
                100.0 * row.invalid
            ));
        }
    }
    Ok(())
}

fn settings(given: &[Setting]) -> Result<Vec<(Parameter, f64)>, Stop> {
    check_whole_track(given).or_input()?;
    Ok(given.iter().map(|setting| (setting.parameter, setting.value)).collect())
}

fn rows(
    evaluator: &Evaluator,
    settings: Vec<(Parameter, f64)>,
    counts: Counts,
) -> anyhow::Result<Vec<CoverageRow>> {
    let coverage = Coverage {
        evaluator,
        experiment: evaluator.experiment(),
        fixed: *evaluator.fixed(),
        settings,
        counts,
    };
    let bar = Mutex::new(None::<Progress>);
    let rows = coverage.rows(&|done, total| {
        let begin = || Progress::begin("tracks", 0, total as u64);
        bar.lock().get_or_insert_with(begin).at(done as u64, "");
    })?;
    bar.into_inner().into_iter().for_each(Progress::end);
    Ok(rows)
}

/// Table of the tracks flagged as outside the library, then the coverage of the intervals.
fn tables(rows: &[CoverageRow]) -> String {
    let width = rows.iter().map(|row| name(row.kind).len()).max().unwrap_or(0);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let mut lines = vec![format!(
        "{:width$}  tracks  any sleeper outside  most outside  named to widen first",
        "Flagged as outside the library"
    )];
    for row in rows {
        let named: Vec<_> =
            row.widen.iter().map(|(of, share)| format!("{of} {}", percent(*share))).collect();
        lines.push(format!(
            "{:width$}  {:>6}  {:>19}  {:>12}  {}",
            name(row.kind),
            row.tracks,
            percent(row.any_outside),
            percent(row.most_outside),
            named.join(", ")
        ));
    }
    let columns = rows.first().map(|row| row.estimates.keys().copied().collect::<Vec<_>>());
    let columns = columns.unwrap_or_default();
    let heads = columns.iter().map(|parameter| format!("{:>16}", parameter.symbol()));
    lines.push(String::new());
    lines.push(format!(
        "{:width$}{}  assumed unevenness",
        "Inside the 90 % interval",
        heads.collect::<String>()
    ));
    for row in rows.iter().filter(|row| matches!(row.kind, Kind::Inside { .. })) {
        let cells = columns.iter().map(|parameter| {
            let of = row.estimates[parameter];
            format!(
                "{:>16}",
                format!("{} ({})", percent(of.holds_90), percent(of.holds_90_if_even))
            )
        });
        let cells = cells.collect::<String>();
        lines.push(format!("{:width$}{cells}  {}", name(row.kind), percent(row.assumed_scatter)));
    }
    lines.extend(shortfalls(rows));
    lines.join("\n")
}

/// Ends beyond which too few tracks are flagged.
fn shortfalls(rows: &[CoverageRow]) -> impl Iterator<Item = String> + '_ {
    let missed = rows
        .iter()
        .filter(|row| matches!(row.kind, Kind::Beyond { .. }) && row.any_outside < FOUND_LEAST);
    missed.map(|row| {
        format!(
            "{}: fewer than {:.0} % are flagged as outside the library",
            name(row.kind),
            100.0 * FOUND_LEAST
        )
    })
}

/// Name of the tracks of a row.
fn name(kind: Kind) -> String {
    match kind {
        Kind::Inside { scatter } if scatter <= 0.0 => "inside, even".to_owned(),
        Kind::Inside { scatter } => format!("inside, {:.0} % unevenness", 100.0 * scatter),
        Kind::Beyond { parameter, side: Side::Low } => format!("{parameter} 30 % below"),
        Kind::Beyond { parameter, side: Side::High } => format!("{parameter} 30 % above"),
        Kind::Set { parameter, value } => format!("{parameter} = {value:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn the_default_method_requires_models() {
        let arguments = |given: &[&str]| {
            Line::try_parse_from([&["coverage", "--library", "sqlite:x"][..], given].concat())
                .unwrap()
                .arguments
        };
        for given in [&[][..], &["--method", "gp"]] {
            let arguments = arguments(given);
            let refused = models_and_library(&arguments);
            let Err(Stop::Input(error)) = refused else { panic!("{refused:?}") };
            assert!(error.to_string().starts_with("--models: required"), "{error}");
        }
        let with_models = arguments(&["--models", "m"]);
        assert!(models_and_library(&with_models).is_ok_and(|(_, library)| library == "sqlite:x"));
    }
}
