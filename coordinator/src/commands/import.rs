//! `tracktwin import`: recordings of other makes.

use super::files::{Force, read_text};
use super::numbers::number;
use super::{OrInput, Stop, println_stdout};
use anyhow::Context;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tracktwin_files::{Kind, Names, Output};
use tracktwin_parameters::quantity::{PLACE, SAMPLE_RATE, SPACING, SPEED, WHEEL_RADIUS};
use tracktwin_signal::recording::import::{
    AccelerationUnit, Imported, Layout, PositionUnit, SpeedUnit, TimeUnit, import,
};

/// What `import` is told.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tracktwin import run.csv --out recording --column acceleration=acc --column time=t --speed 67
  tracktwin import day1.mat day2.mat --out recording --layout vehicle.toml

Without a column of acceleration the command says which columns a file has. A layout file has the
same entries: acceleration = [\"acc_left\"], time = \"t_s\", position = \"km\", position_unit = \"km\",
acceleration_unit = \"g\", sample_rate_Hz = 2000, spacing_m = 0.6. Flags override it.")]
pub(super) struct Arguments {
    /// Files of one vehicle over one track, a pass each: .csv .txt .parquet .npy .npz .mat (v5 to
    /// v7).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Folder for the recording; of several columns of acceleration each gets a folder inside it.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// What the columns mean, as a TOML file.
    #[arg(long, value_name = "FILE.toml")]
    layout: Option<PathBuf>,
    /// What a column means: acceleration=NAME (may stand several times), time=NAME, position=NAME
    /// or speed=NAME.
    #[arg(long = "column", value_name = "QUANTITY=NAME")]
    columns: Vec<Meaning>,
    /// Unit of the accelerations, m/s2 if neither this nor the file says one; with `unknown` levels
    /// mean something within the recording only.
    #[arg(long, value_enum)]
    unit: Option<Unit>,
    /// Accelerations are positive upwards.
    #[arg(long)]
    upwards: bool,
    /// Unit of the column of positions: m, km or mm.
    #[arg(long, value_enum)]
    position_unit: Option<LengthUnit>,
    /// Unit of the column of times.
    #[arg(long, value_enum)]
    time_unit: Option<DurationUnit>,
    /// Unit of the column of speeds.
    #[arg(long, value_enum)]
    speed_unit: Option<VelocityUnit>,
    /// Samples per second, where no column of times says it.
    #[arg(long, value_name = "HZ", value_parser = number(SAMPLE_RATE))]
    sample_rate: Option<f64>,
    /// Speed in km/h, where there is neither a column of positions nor of speeds.
    #[arg(long, value_name = "KMH", value_parser = number(SPEED))]
    speed: Option<f64>,
    /// Distance of the sleepers in m; 0.6 if nothing is said.
    #[arg(long, value_name = "M", value_parser = number(SPACING))]
    spacing: Option<f64>,
    /// Place of any one sleeper in m; without it the recording has no sleepers.
    #[arg(long, value_name = "M", value_parser = number(PLACE), allow_negative_numbers = true)]
    sleeper: Option<f64>,
    /// Radius of the wheel in m.
    #[arg(long, value_name = "M", value_parser = number(WHEEL_RADIUS))]
    wheel_radius: Option<f64>,
}

/// Units of acceleration on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum Unit {
    /// Metres per second squared.
    #[value(name = "m/s2")]
    MetrePerSecondSquared,
    /// Standard gravity.
    G,
    /// Not known.
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
                return Err(format!(
                    "`{quantity}` is none of acceleration, time, position and speed"
                ));
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
    // All are written before the first gets its name.
    let mut outputs = Vec::with_capacity(imported.len());
    for (one, folder) in imported.iter().zip(&folders) {
        let mut output = Output::begin(folder, Kind::MeasuredRecording, force)?;
        one.recording.add_to(&mut output)?;
        output.check()?;
        outputs.push(output);
    }
    for ((one, folder), output) in imported.iter().zip(&folders).zip(outputs) {
        output.commit()?;
        for note in &one.notes {
            println_stdout(note);
        }
        println_stdout(&format!(
            "recording: {}; look at it: tracktwin inspect {0}",
            folder.display()
        ));
    }
    Ok(())
}

/// Where the recordings go: of several columns each has a folder that is called like it.
fn folders(out: &Path, imported: &[Imported]) -> Vec<PathBuf> {
    if let [_] = imported {
        return vec![out.to_owned()];
    }
    let mut names = Names::default();
    imported.iter().map(|one| names.make(&one.column).within(out)).collect()
}

/// The layout file's entries under the flags.
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
    layout.spacing_m = arguments.spacing.unwrap_or(layout.spacing_m);
    layout.sample_rate_hz = arguments.sample_rate.or(layout.sample_rate_hz);
    layout.speed_km_h = arguments.speed.or(layout.speed_km_h);
    layout.sleeper_m = arguments.sleeper.or(layout.sleeper_m);
    layout.wheel_radius_m = arguments.wheel_radius.or(layout.wheel_radius_m);
    Ok(layout)
}

fn layout_of(path: &Path) -> Result<Layout, anyhow::Error> {
    let layout: Layout = toml::from_str(&read_text(path)?)
        .with_context(|| format!("{}: is no layout", path.display()))?;
    layout.check().with_context(|| path.display().to_string())?;
    Ok(layout)
}
