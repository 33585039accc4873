//! `tracktwin import`: recordings of other makes.

use super::files::read_text;
use super::{OrInput, Stop, say};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use tracktwin_signal::recording::import::{AccelerationUnit, Layout, PositionUnit, import};

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
    /// What the columns mean, as a TOML file.
    #[arg(long, value_name = "FILE.toml")]
    layout: Option<PathBuf>,
    /// What a column means: acceleration=NAME (may stand several times), time=NAME, position=NAME
    /// or speed=NAME.
    #[arg(long = "column", value_name = "QUANTITY=NAME")]
    columns: Vec<Meaning>,
    /// Unit of the accelerations, m/s2 if nothing is said; with `unknown` levels mean something within the recording only.
    #[arg(long, value_enum)]
    unit: Option<Unit>,
    /// Accelerations are positive upwards.
    #[arg(long)]
    upwards: bool,
    /// Unit of the column of positions: m, km or mm.
    #[arg(long, value_enum)]
    position_unit: Option<LengthUnit>,
    /// Samples per second, where no column of times says it.
    #[arg(long, value_name = "HZ")]
    sample_rate: Option<f64>,
    /// Speed in km/h, where there is neither a column of positions nor of speeds.
    #[arg(long, value_name = "KMH")]
    speed: Option<f64>,
    /// Distance of the sleepers in m; 0.6 if nothing is said.
    #[arg(long, value_name = "M")]
    spacing: Option<f64>,
    /// Place of any one sleeper in m; without it the recording has no sleepers.
    #[arg(long, value_name = "M")]
    sleeper: Option<f64>,
    /// Radius of the wheel in m.
    #[arg(long, value_name = "M")]
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
    let several = imported.len() > 1;
    let folder = |column: &str| {
        if several { arguments.out.join(column) } else { arguments.out.clone() }
    };
    for one in &imported {
        refuse_another(&folder(&one.column)).or_input()?;
    }
    if arguments.unit.is_none() && arguments.layout.is_none() {
        say("unit: taken as m/s2 (say --unit g or --unit unknown)");
    }
    for one in &imported {
        let folder = folder(&one.column);
        one.recording.write(&folder).or_input()?;
        for note in &one.notes {
            say(note);
        }
        say(&format!("recording: {}; look at it: tracktwin inspect {0}", folder.display()));
    }
    Ok(())
}

/// Somebody's recording is not written over.
fn refuse_another(folder: &Path) -> Result<(), anyhow::Error> {
    if folder.join("recording.json").exists() {
        let folder = folder.display();
        return Err(anyhow!(
            "{folder}: holds a recording already; remove it or give another --out"
        ));
    }
    Ok(())
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
        layout.acceleration_unit = match unit {
            Unit::MetrePerSecondSquared => AccelerationUnit::MetrePerSecondSquared,
            Unit::G => AccelerationUnit::G,
            Unit::Unknown => AccelerationUnit::Unknown,
        };
    }
    if let Some(unit) = arguments.position_unit {
        layout.position_unit = match unit {
            LengthUnit::M => PositionUnit::Metre,
            LengthUnit::Km => PositionUnit::Kilometre,
            LengthUnit::Mm => PositionUnit::Millimetre,
        };
    }
    layout.upwards |= arguments.upwards;
    layout.spacing_m = arguments.spacing.unwrap_or(layout.spacing_m);
    layout.sample_rate_hz = arguments.sample_rate.or(layout.sample_rate_hz);
    layout.speed_km_h = arguments.speed.or(layout.speed_km_h);
    layout.sleeper_m = arguments.sleeper.or(layout.sleeper_m);
    layout.wheel_radius_m = arguments.wheel_radius.or(layout.wheel_radius_m);
    check(&layout)?;
    Ok(layout)
}

fn layout_of(path: &Path) -> Result<Layout, anyhow::Error> {
    toml::from_str(&read_text(path)?).with_context(|| format!("{}: is no layout", path.display()))
}

/// Numbers that must be positive where they are given.
fn check(layout: &Layout) -> Result<(), anyhow::Error> {
    let given = [
        ("sample_rate_Hz", layout.sample_rate_hz),
        ("speed_km_h", layout.speed_km_h),
        ("spacing_m", Some(layout.spacing_m)),
        ("wheel_radius_m", layout.wheel_radius_m),
    ];
    for (name, value) in given {
        if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
            return Err(anyhow!(
                "{name}: is {}; give a positive number",
                value.unwrap_or_default()
            ));
        }
    }
    Ok(())
}
