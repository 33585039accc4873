//! `tracktwin hammer evaluate`: estimates from the files of a hammer test.

use crate::commands::evaluate::command;
use crate::commands::files::{Force, check, make_folder, read as read_bytes, read_text};
use crate::commands::numbers::number;
use crate::commands::track::TrackChoice;
use crate::commands::{OrInput, Stop, print_json, println_stderr, println_stdout};
use anyhow::anyhow;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_hammer::{
    Beside, FitError, Fitted, HammerRecord, Layout, Loaded, Nodes, PointReceptance, Selected,
    Selection, beside, fit, read, select,
};
use tracktwin_parameters::quantity::{FREQUENCY, PLACE};
use tracktwin_parameters::{Quantity, Track};

const PAGE: &str = "report.html";
const PICTURE: &str = "stiffness.svg";
const NAMES: [&str; 4] = [PAGE, PICTURE, "estimates.csv", "estimates.json"];

/// Extensions of the files that are read in a folder.
const ENDINGS: [&str; 3] = ["csv", "uff", "unv"];

/// Note if hammer test and evaluation have no sleeper in common with valid estimates.
const NONE_COMPARED: &str =
    "No sleeper has valid estimates by hammer test and evaluation: they are not compared.";

/// Coherence, gamma squared.
const COHERENCE: Quantity = Quantity::new("coherence", "", [0.0, 1.0], [0.8, 0.99]);

/// Arguments of `hammer evaluate`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin hammer simulate --sleepers 12 --unevenness 15 --out hammer.csv
  tracktwin hammer evaluate hammer.csv --out result

Each file is one of:
  - a table (CSV) of receptances: position_m, frequency_Hz, receptance_real_m_N,
    receptance_imag_m_N, and optionally coherence and hits;
  - a table (CSV) of signals: position_m, time_s, force_N, acceleration_m_s2, and optionally hit;
    the hits at a position are averaged (H1);
  - a universal file (ASCII): dataset 58 with functions of type 4 and 6, dataset 15 with the nodes.
Force and response are positive in the same direction; units are those of the SI.

The stiffness is that without the load of a wheel. With --aba it is shown beside the stiffness
under the wheel.

Exit codes: 0 done, 1 done, but the estimates of half of the struck sleepers or more are not valid
(see the last lines of the output), 2 wrong input, 3 failure.")]
pub(in crate::commands) struct Arguments {
    /// Files of the hammer test, or folders whose .csv, .uff and .unv files are read.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Position of one sleeper in m.
    #[arg(long, default_value_t = 0.0, value_name = "M", value_parser = number(PLACE),
          allow_negative_numbers = true)]
    sleeper: f64,
    /// Position of a node of a universal file in m; may be repeated.
    #[arg(long = "node", value_name = "NODE=M", value_parser = node)]
    nodes: Vec<(u64, f64)>,
    /// Lowest frequency in Hz [default: 100 Hz on V-Track, lower by the ratio of the spacings
    /// elsewhere].
    #[arg(long, value_name = "HZ", value_parser = number(FREQUENCY))]
    from: Option<f64>,
    /// Highest frequency in Hz [default: 4000 Hz on V-Track, lower by the ratio of the spacings
    /// elsewhere].
    #[arg(long, value_name = "HZ", value_parser = number(FREQUENCY))]
    to: Option<f64>,
    /// Least coherence; values with less are left out.
    #[arg(long, default_value_t = tracktwin_hammer::COHERENCE_MIN, value_parser = number(COHERENCE))]
    coherence: f64,
    /// Output folder of `evaluate` for a recording of the same track, in the same positions.
    #[arg(long, value_name = "DIR")]
    aba: Option<PathBuf>,
    /// Output folder for estimates.csv, estimates.json, report.html and stiffness.svg (the charts
    /// along the track).
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    track: TrackChoice,
    #[command(flatten)]
    force: Force,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

fn node(text: &str) -> Result<(u64, f64), String> {
    let (node, place) = text.split_once('=').ok_or("write NODE=METRES")?;
    let node = node.parse().map_err(|_| format!("`{node}` is not the number of a node"))?;
    Ok((node, PLACE.parse(place).map_err(|error| error.to_string())?))
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { out, force, .. } = arguments;
    let points = points(arguments)?;
    let loaded = arguments.aba.as_deref().map(loaded).transpose()?;
    let track = arguments.track.track()?;
    check(out, Kind::Results, *force, &NAMES)?;
    let selection = selection(arguments, &Selection::usual(&track.design)).or_input()?;
    let Selected { points, notes } = select(&points, &selection);
    for note in &notes {
        println_stderr(note);
    }
    if let Some(loaded) = &loaded {
        check_places(&track, arguments.sleeper, &points, loaded)?;
    }
    make_folder(out)?;
    let fitted = fit(&track, arguments.sleeper, &points).map_err(|error| match error {
        FitError::Layout(_) | FitError::Turned { .. } | FitError::Repeated { .. } => {
            Stop::Input(error.into())
        }
        failed => Stop::Failure(failed.into()),
    })?;
    let spacing_m = track.design.sleeper.spacing_m;
    let mut record = record(&fitted, &track, &selection, points.len(), loaded.as_ref());
    let compared = loaded.as_ref().map(|loaded| beside(&record, loaded, spacing_m));
    if compared.as_ref().is_some_and(Vec::is_empty) {
        record.notes.push(NONE_COMPARED.to_owned());
    }
    let said = record.notes.clone();
    record.notes.splice(0..0, notes);
    let beside = loaded.as_ref().zip(compared.as_deref());
    write(&record, beside, out, *force)?;
    if arguments.json {
        print_json(&summary(&record, compared.as_deref().unwrap_or_default(), out));
    } else {
        print(&record, &said, compared.as_deref().unwrap_or_default(), out);
    }
    conclude(&record)
}

/// Returns a negative result if at least half of the struck sleepers have no valid estimates.
fn conclude(record: &HammerRecord) -> Result<(), Stop> {
    let struck = record.sleepers.iter().filter(|sleeper| sleeper.misfit.is_some()).count();
    let invalid = record.sleepers.iter().filter(|sleeper| !sleeper.is_valid()).count();
    if 2 * invalid >= struck { Err(Stop::Negative) } else { Ok(()) }
}

/// Checks, before the fit, that the evaluation has a sleeper at some position of the hammer test.
fn check_places(
    track: &Track,
    sleeper_at_m: f64,
    points: &[PointReceptance],
    loaded: &Loaded,
) -> Result<(), Stop> {
    let struck_m = points.iter().map(|point| point.position_m);
    let layout = Layout::new(&track.design, sleeper_at_m, struck_m).or_input()?;
    let mut places_m = (layout.first..).take(layout.reported).map(|number| layout.place_m(number));
    if places_m.any(|x_m| loaded.at(x_m, layout.spacing_m).is_some()) {
        return Ok(());
    }
    Err(Stop::Input(anyhow!(
        "--aba: no sleeper of the evaluation stands where one of the hammer test does; give both the \
         same positions"
    )))
}

/// Record of a fit, with the sleeper names of the evaluation.
fn record(
    fitted: &Fitted,
    track: &Track,
    selection: &Selection,
    receptances: usize,
    loaded: Option<&Loaded>,
) -> HammerRecord {
    let name = |number: i64, x_m: f64| {
        let known = loaded.and_then(|loaded| loaded.at(x_m, track.design.sleeper.spacing_m));
        known.map_or_else(|| format!("SN{number}"), |sleeper| sleeper.id.clone())
    };
    HammerRecord::new(fitted, &track.name, selection.range_hz, receptances, name)
}

/// All receptances of the files, in their order.
fn points(arguments: &Arguments) -> Result<Vec<PointReceptance>, Stop> {
    let nodes: Nodes = arguments.nodes.iter().copied().collect();
    let mut points = Vec::new();
    for path in &arguments.files {
        for file in files(path)? {
            let text = text(read_bytes(&file).or_input()?);
            let of_file =
                read(&text, &nodes).map_err(|error| anyhow!("{}: {error}", file.display()));
            points.extend(of_file.or_input()?);
        }
    }
    Ok(points)
}

/// Content of a file as text. If the file is not UTF-8, non-ASCII bytes become question marks; such bytes
/// are in Latin-1 remarks and in binary data.
fn text(bytes: Vec<u8>) -> String {
    let ascii = |byte: &u8| if byte.is_ascii() { char::from(*byte) } else { '?' };
    String::from_utf8(bytes).unwrap_or_else(|error| error.as_bytes().iter().map(ascii).collect())
}

/// The file itself, or the files of a folder in the order of their names.
fn files(path: &Path) -> Result<Vec<PathBuf>, Stop> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let of_folder = || -> std::io::Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
        entries.collect()
    };
    let unreadable = |source| FilesError::System { path: path.to_owned(), action: "read", source };
    let mut files = of_folder().map_err(unreadable)?;
    let is_read = |file: &PathBuf| {
        let ending = file.extension().map(|it| it.to_string_lossy().to_lowercase());
        ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    };
    files.retain(is_read);
    files.sort();
    if files.is_empty() {
        return Err(Stop::Input(anyhow!(
            "{}: the folder has no .csv, .uff or .unv files",
            path.display()
        )));
    }
    Ok(files)
}

fn loaded(folder: &Path) -> Result<Loaded, Stop> {
    let path = folder.join("evaluation.json");
    let text = read_text(&path).or_input()?;
    Loaded::parse(&text).map_err(|error| anyhow!("{}: {error}", path.display())).or_input()
}

fn selection(arguments: &Arguments, usual: &Selection) -> Result<Selection, anyhow::Error> {
    let [low, high] = usual.range_hz;
    let range_hz = [arguments.from.unwrap_or(low), arguments.to.unwrap_or(high)];
    if range_hz[0] >= range_hz[1] {
        let [low, high] = range_hz;
        return Err(anyhow!("--from {low} --to {high}: the lower frequency in Hz must come first"));
    }
    Ok(Selection { range_hz, coherence: arguments.coherence })
}

fn write(
    record: &HammerRecord,
    beside: Option<(&Loaded, &[Beside])>,
    folder: &Path,
    force: Force,
) -> Result<(), FilesError> {
    let page = tracktwin_report::hammer_page(record, beside, &command());
    let mut output = Output::begin(folder, Kind::Results, force.force)?;
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    let picture = tracktwin_report::hammer_chart(record, beside.map(|it| it.0));
    output.add(&FileName::new(PICTURE)?, picture.as_bytes())?;
    record.add_to(&mut output)?;
    output.commit()
}

fn print(record: &HammerRecord, said: &[String], compared: &[Beside], folder: &Path) {
    println_stdout(&format!(
        "{} sleepers evaluated from {} receptances; report: {}",
        record.sleepers.len(),
        record.receptances,
        folder.join(PAGE).display()
    ));
    for sentence in said.iter().cloned().chain(compared.iter().map(Beside::sentence)) {
        println_stdout(&sentence);
    }
}

fn summary(record: &HammerRecord, compared: &[Beside], folder: &Path) -> serde_json::Value {
    json!({
        "sleepers": record.sleepers.len(), "receptances": record.receptances,
        "gain": record.gain, "model_error_dB": record.model_error_db, "notes": record.notes,
        "under_load": compared.iter().map(Beside::sentence).collect::<Vec<_>>(),
        "report": folder.join(PAGE).display().to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_utf_8_is_read_as_far_as_it_is_ascii() {
        assert_eq!(text(b"Gleis \xfcber M\xfchle".to_vec()), "Gleis ?ber M?hle");
        assert_eq!(text("\u{fc}ber".as_bytes().to_vec()), "\u{fc}ber");
    }
}
