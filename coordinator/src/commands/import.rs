//! `tracktwin import`: converts recordings from other formats.

use super::files::{Force, read_text};
use super::numbers::number;
use super::shell::quoted_path;
use super::{OrInput, Stop, print_json, println_stdout};
use anyhow::Context;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tracktwin_files::{Kind, Names, Output};
use tracktwin_parameters::quantity::{PLACE, SAMPLE_RATE, SPACING, SPEED, WHEEL_RADIUS};
use tracktwin_signal::recording::import::{
    AccelerationUnit, Imported, Layout, PositionUnit, SpeedUnit, TimeUnit, import,
};

/// Arguments of `import`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tracktwin import run.csv --out recording --column acceleration=acc --column time=t --speed 67
  tracktwin import day1.mat day2.mat --out recording --layout vehicle.toml

Without an acceleration column the command lists the columns of the file. A layout file has the
same entries: acceleration = [\"acc_left\"], time = \"t_s\", position = \"km\", position_unit = \"km\",
acceleration_unit = \"g\", sample_rate_Hz = 2000, spacing_m = 0.6. Flags override it.")]
pub(super) struct Arguments {
    /// Files of one vehicle on one track, one pass per file: .csv .txt .parquet .npy .npz .mat (v5
    /// to v7).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Output folder of the recording; with several acceleration columns, each gets a subfolder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// TOML file that assigns columns to quantities.
    #[arg(long, value_name = "FILE.toml")]
    layout: Option<PathBuf>,
    /// Assign a column to a quantity: acceleration=NAME (may be repeated), time=NAME, position=NAME
    /// or speed=NAME.
    #[arg(long = "column", value_name = "QUANTITY=NAME")]
    columns: Vec<Meaning>,
    /// Unit of the accelerations [default: the unit in the file, or m/s2]; with `unknown`, levels
    /// are comparable within the recording only.
    #[arg(long, value_enum)]
    unit: Option<Unit>,
    /// Accelerations in the file are positive upwards.
    #[arg(long)]
    upwards: bool,
    /// Unit of the position column [default: the unit in the file, or m].
    #[arg(long, value_enum)]
    position_unit: Option<LengthUnit>,
    /// Unit of the time column [default: the unit in the file, or s].
    #[arg(long, value_enum)]
    time_unit: Option<DurationUnit>,
    /// Unit of the speed column [default: the unit in the file, or km/h].
    #[arg(long, value_enum)]
    speed_unit: Option<VelocityUnit>,
    /// Sample rate in Hz; required without a time column.
    #[arg(long, value_name = "HZ", value_parser = number(SAMPLE_RATE))]
    sample_rate: Option<f64>,
    /// Speed in km/h; required without a position or speed column.
    #[arg(long, value_name = "KMH", value_parser = number(SPEED))]
    speed: Option<f64>,
    /// Sleeper spacing in m [default: 0.6].
    #[arg(long, value_name = "M", value_parser = number(SPACING))]
    spacing: Option<f64>,
    /// Position of one sleeper in m; required for `evaluate` and `diagnose`.
    #[arg(long, value_name = "M", value_parser = number(PLACE), allow_negative_numbers = true)]
    sleeper: Option<f64>,
    /// Radius of the wheel in m.
    #[arg(long, value_name = "M", value_parser = number(WHEEL_RADIUS))]
    wheel_radius: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Units of acceleration on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum Unit {
    /// Metres per second squared.
    #[value(name = "m/s2")]
    MetrePerSecondSquared,
    /// Standard acceleration of gravity.
    G,
    /// Unknown.
    Unknown,
}

/// Units of length on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum LengthUnit {
    /// Metres.
    M,
    /// Kilometres.
    Km,
    /// Millimetres.
    Mm,
}

/// Units of time on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum DurationUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

/// Units of speed on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum VelocityUnit {
    /// Kilometres per hour.
    #[value(name = "km/h")]
    KilometrePerHour,
    /// Metres per second.
    #[value(name = "m/s")]
    MetrePerSecond,
}

/// Quantity and column.
#[derive(Clone, Debug)]
struct Meaning {
    quantity: Quantity,
    column: String,
}

#[derive(Clone, Copy, Debug)]
enum Quantity {
    Acceleration,
    Time,
    Position,
    Speed,
}

impl FromStr for Meaning {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (quantity, column) =
            text.split_once('=').ok_or_else(|| format!("`{text}`: write QUANTITY=NAME"))?;
        let quantity = match quantity {
            "acceleration" => Quantity::Acceleration,
            "time" => Quantity::Time,
            "position" => Quantity::Position,
            "speed" => Quantity::Speed,
            _ => {
                return Err(format!("`{quantity}` is not acceleration, time, position or speed"));
            }
        };
        Ok(Self { quantity, column: column.to_owned() })
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let layout = layout(arguments).or_input()?;
    let imported = import(&arguments.files, &layout).or_input()?;
    let folders = folders(&arguments.out, &imported);
    let force = arguments.force.force;
    // All are written before the first is renamed.
    let mut outputs = Vec::with_capacity(imported.len());
    for (one, folder) in imported.iter().zip(&folders) {
        let mut output = Output::begin(folder, Kind::MeasuredRecording, force)?;
        one.recording.add_to(&mut output)?;
        output.check()?;
        outputs.push(output);
    }
    for ((one, folder), output) in imported.iter().zip(&folders).zip(outputs) {
        output.commit()?;
        if !arguments.json {
            print(one, folder);
        }
    }
    if arguments.json {
        let recordings = imported.iter().zip(&folders).map(|(one, folder)| json(one, folder));
        print_json(&recordings.collect::<Vec<_>>());
    }
    Ok(())
}

/// Prints what was changed or assumed, and the path of the recording.
fn print(imported: &Imported, folder: &Path) {
    for note in &imported.notes {
        println_stdout(note);
    }
    println_stdout(&format!(
        "recording: {}; inspect it with: tracktwin inspect {}",
        folder.display(),
        quoted_path(folder)
    ));
}

fn json(Imported { column, notes, .. }: &Imported, folder: &Path) -> serde_json::Value {
    let recording = folder.display().to_string();
    serde_json::json!({ "recording": recording, "column": column, "notes": notes })
}

/// Folders of the recordings: with several columns, one named after each column.
fn folders(out: &Path, imported: &[Imported]) -> Vec<PathBuf> {
    if let [_] = imported {
        return vec![out.to_owned()];
    }
    let mut names = Names::default();
    imported.iter().map(|one| names.make(&one.column).within(out)).collect()
}

/// The entries of the layout file, overridden by the flags.
fn layout(arguments: &Arguments) -> Result<Layout, anyhow::Error> {
    let mut layout = arguments.layout.as_deref().map(layout_of).transpose()?.unwrap_or_default();
    if arguments.columns.iter().any(|m| matches!(m.quantity, Quantity::Acceleration)) {
        layout.acceleration.clear();
    }
    for Meaning { quantity, column } in arguments.columns.clone() {
        match quantity {
            Quantity::Acceleration => layout.acceleration.push(column),
            Quantity::Time => layout.time = Some(column),
            Quantity::Position => layout.position = Some(column),
            Quantity::Speed => layout.speed = Some(column),
        }
    }
    if let Some(unit) = arguments.unit {
        layout.acceleration_unit = Some(match unit {
            Unit::MetrePerSecondSquared => AccelerationUnit::MetrePerSecondSquared,
            Unit::G => AccelerationUnit::G,
            Unit::Unknown => AccelerationUnit::Unknown,
        });
    }
    if let Some(unit) = arguments.position_unit {
        layout.position_unit = Some(match unit {
            LengthUnit::M => PositionUnit::Metre,
            LengthUnit::Km => PositionUnit::Kilometre,
            LengthUnit::Mm => PositionUnit::Millimetre,
        });
    }
    if let Some(unit) = arguments.time_unit {
        layout.time_unit = Some(match unit {
            DurationUnit::S => TimeUnit::Second,
            DurationUnit::Ms => TimeUnit::Millisecond,
            DurationUnit::Us => TimeUnit::Microsecond,
            DurationUnit::Ns => TimeUnit::Nanosecond,
        });
    }
    if let Some(unit) = arguments.speed_unit {
        layout.speed_unit = Some(match unit {
            VelocityUnit::KilometrePerHour => SpeedUnit::KilometrePerHour,
            VelocityUnit::MetrePerSecond => SpeedUnit::MetrePerSecond,
        });
    }
    layout.upwards |= arguments.upwards;
    layout.spacing_m = arguments.spacing.or(layout.spacing_m);
    layout.sample_rate_hz = arguments.sample_rate.or(layout.sample_rate_hz);
    layout.speed_km_h = arguments.speed.or(layout.speed_km_h);
    layout.sleeper_m = arguments.sleeper.or(layout.sleeper_m);
    layout.wheel_radius_m = arguments.wheel_radius.or(layout.wheel_radius_m);
    Ok(layout)
}

fn layout_of(path: &Path) -> Result<Layout, anyhow::Error> {
    let layout: Layout = toml::from_str(&read_text(path)?)
        .with_context(|| format!("{}: not a layout", path.display()))?;
    layout.check().with_context(|| path.display().to_string())?;
    Ok(layout)
}
