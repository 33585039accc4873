//! `tracktwin receptance`: receptance of the track (hammer test).

use super::files::{Force, check, is_stream, write_file};
use super::numbers::{count, number};
use super::simulate::{Setting, check_whole_track};
use super::track::TrackChoice;
use super::{OrInput, Stop, println_stdout};
use anyhow::anyhow;
use clap::Args;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_parameters::quantity::{FREQUENCY, PLACE, POINTS, SPANS};
use tracktwin_parameters::{ParameterSet, Track};
use tracktwin_report::ReceptanceCurve;
use tracktwin_track::frequency::{self, ReceptancePoint};
use tracktwin_track::model::{Mesh, Support, TrackModel};

/// Arguments of `receptance`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin receptance --at sleeper --at midspan --out receptance.csv

The columns are frequency_Hz and, for each --at, PLACE_real_m_N and PLACE_imag_m_N: real and
imaginary part in m/N. Positions count from the start of the rail.")]
pub(super) struct Arguments {
    /// Point of excitation and measurement on the rail: `sleeper` (above the middle sleeper),
    /// `midspan` (half a spacing further), a position in m, or `A:B` for excitation at A and
    /// measurement at B; may be repeated.
    #[arg(long = "at", value_name = "PLACE", required = true)]
    at: Vec<Test>,
    /// Output file (CSV); a plot (SVG) is written beside it.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Number of sleeper spans; 25 spans, as in the paper, show standing waves, 200 spans behave as
    /// an infinite track.
    #[arg(long, default_value_t = 200, value_parser = count::<usize>(SPANS))]
    spans: usize,
    /// Lowest frequency in Hz.
    #[arg(long, default_value_t = 50.0, value_name = "HZ", value_parser = number(FREQUENCY))]
    from: f64,
    /// Highest frequency in Hz.
    #[arg(long, default_value_t = 8000.0, value_name = "HZ", value_parser = number(FREQUENCY))]
    to: f64,
    /// Number of frequencies, in equal steps on a logarithmic axis.
    #[arg(long, default_value_t = 400, value_parser = count::<usize>(POINTS))]
    points: usize,
    /// Value of a parameter, e.g. `railpad_stiffness_N_m=9e7`; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    #[command(flatten)]
    track: TrackChoice,
}

/// A point on the rail as written on the command line.
#[derive(Clone, Copy, Debug)]
enum TestPoint {
    Sleeper,
    Midspan,
    At(f64),
}

/// Points of excitation and measurement, and their text.
#[derive(Clone, Debug)]
struct Test {
    struck: TestPoint,
    measured: TestPoint,
    name: String,
}

impl FromStr for Test {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (struck, measured) = text.split_once(':').unwrap_or((text, text));
        Ok(Self {
            struck: test_point(struck)?,
            measured: test_point(measured)?,
            name: text.to_owned(),
        })
    }
}

fn test_point(text: &str) -> Result<TestPoint, String> {
    match text {
        "sleeper" => Ok(TestPoint::Sleeper),
        "midspan" => Ok(TestPoint::Midspan),
        _ => PLACE
            .parse(text)
            .map(TestPoint::At)
            .map_err(|error| format!("{error}; write sleeper, midspan or a position in m")),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    check_files(arguments)?;
    let frequencies = frequencies(arguments).or_input()?;
    check_whole_track(&arguments.settings).or_input()?;
    let track = arguments.track.track()?;
    let set = arguments.settings.iter().fold(track.nominal, |set, setting| setting.apply(set, 0));
    let model = model(arguments.spans, &track, &set)?;
    let middle = arguments.spans / 2;
    let spacing = track.design.sleeper.spacing_m;
    let place = |test_point| match test_point {
        TestPoint::Sleeper => ReceptancePoint::Rail(middle as f64 * spacing),
        TestPoint::Midspan => ReceptancePoint::Rail((middle as f64 + 0.5) * spacing),
        TestPoint::At(x_m) => ReceptancePoint::Rail(x_m),
    };
    let mut curves = Vec::new();
    for test in &arguments.at {
        let (struck, measured) = (place(test.struck), place(test.measured));
        let values = frequency::receptance(&model, struck, measured, &frequencies).or_input()?;
        curves.push(ReceptanceCurve { name: test.name.clone(), values });
    }
    let table = csv(&frequencies, &curves)?;
    let picture = tracktwin_report::receptance_chart(&frequencies, &curves);
    write(arguments, &table, &picture)
}

/// Writes table and plot together.
fn write(arguments: &Arguments, table: &[u8], picture: &str) -> Result<(), Stop> {
    let Arguments { out, force, .. } = arguments;
    if is_stream(out) {
        return Ok(write_file(out, Kind::Curves, *force, table)?);
    }
    let [table_name, picture_name] = names(out)?;
    let (folder, _) = FileName::of_path(out)?;
    let mut output = Output::in_folder(&folder, Kind::Curves, force.force)?;
    output.add(&picture_name, picture.as_bytes())?;
    output.add(&table_name, table)?;
    output.commit()?;
    let picture = picture_name.within(&folder);
    println_stdout(&format!("receptance: {}; plot: {}", out.display(), picture.display()));
    Ok(())
}

/// Names of the files with table and plot.
fn names(out: &Path) -> Result<[FileName; 2], Stop> {
    let (_, table) = FileName::of_path(out)?;
    let (_, picture) = FileName::of_path(&out.with_extension("svg"))?;
    if table == picture {
        let table = anyhow!(
            "--out {}: this is the name of the plot; give the name of the table, for example ",
            out.display()
        );
        return Err(anyhow!("{table}{}", out.with_extension("csv").display())).or_input();
    }
    Ok([table, picture])
}

/// Checks that table and plot may be written.
fn check_files(Arguments { out, force, .. }: &Arguments) -> Result<(), Stop> {
    if is_stream(out) {
        return Ok(());
    }
    let (folder, _) = FileName::of_path(out)?;
    let names = names(out)?;
    Ok(check(&folder, Kind::Curves, *force, &[names[0].as_str(), names[1].as_str()])?)
}

fn frequencies(arguments: &Arguments) -> Result<Vec<f64>, anyhow::Error> {
    let Arguments { from, to, points, .. } = *arguments;
    if from >= to {
        return Err(anyhow!("--from {from} --to {to}: the lower frequency in Hz must come first"));
    }
    let ratio = (to / from).powf(1.0 / (points - 1) as f64);
    Ok((0..points).map(|point| from * ratio.powf(point as f64)).collect())
}

fn model(spans: usize, track: &Track, set: &ParameterSet) -> Result<TrackModel, Stop> {
    let supports = vec![Support::from(set); spans.saturating_sub(1)];
    TrackModel::build(&track.design, &Mesh::uniform(spans, 8, 8), &supports, &[]).or_input()
}

fn csv(frequencies: &[f64], curves: &[ReceptanceCurve]) -> Result<Vec<u8>, anyhow::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut heads = vec!["frequency_Hz".to_owned()];
    for curve in curves {
        heads.push(format!("{}_real_m_N", curve.name));
        heads.push(format!("{}_imag_m_N", curve.name));
    }
    table.write_record(&heads)?;
    for (row, frequency) in frequencies.iter().enumerate() {
        let mut record = vec![frequency.to_string()];
        for curve in curves {
            record.push(format!("{:e}", curve.values[row].re));
            record.push(format!("{:e}", curve.values[row].im));
        }
        table.write_record(&record)?;
    }
    Ok(table.into_inner()?)
}
