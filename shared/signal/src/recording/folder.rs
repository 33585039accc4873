//! A recording in memory and as a folder: passes, sleepers and measured quantity.

use super::columns::{Columns, NAMES};
use super::error::{Fault, RecordingError};
use super::manifest::{FILE_NAME, Manifest, PassEntry};
use super::motion::MotionFault;
use super::odometer::Odometer;
use super::selection::Selection;
use super::sleeper::Sleeper;
use super::track::doubts_on_names;
use super::window::SleeperWindow;
use super::{check, limits, parquet_file, quiet, speed_change};
use crate::Signal;
use serde_json::{Map, Value};
use std::ops::Range;
use std::path::{Path, PathBuf};
use tracktwin_files::{FileName, FilesError, Kind, Names, Output, inside};
use tracktwin_number::significant;

/// What is wrong with a path that is not a recording.
const FILE: &str = "is a file, but a recording is a folder; create one with `tracktwin import`";
const NO_FOLDER: &str =
    "the folder does not exist; correct its name, or create it with `tracktwin import`";
const NO_MANIFEST: &str = "the folder holds no recording.json; create one with `tracktwin import`";

/// Axle-box accelerations of one vehicle over one stretch of track, in several passes.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the recording: that of its folder, with the selected rail and axle.
    pub name: String,
    /// Samples per second of every pass, in Hz.
    pub sample_rate_hz: f64,
    /// Description of the measured quantity.
    pub channel: String,
    /// The passes, in the order of `recording.json`.
    pub passes: Vec<Pass>,
    /// The sleepers, along the track. Empty if their positions are unknown.
    pub sleepers: Vec<Sleeper>,
    /// Nominal values of rail, sleeper and wheel: `nominal` of `recording.json`.
    pub nominal: Map<String, Value>,
    /// Sleeper spacing in m: the length of the window of a sleeper.
    pub spacing_m: f64,
    /// Corrections made by the import or while reading, and doubts about the data: one sentence each. They are `notes`
    /// of `recording.json`.
    pub doubts: Vec<String>,
}

/// One run of the wheel along the track.
#[derive(Clone, Debug)]
pub struct Pass {
    /// The file from which the pass was read. Empty for a simulated pass.
    pub file: String,
    /// Nominal speed in km/h.
    pub speed_km_h: f64,
    /// Name of the axle whose axle box was measured. `None` if it is not stated.
    pub axle: Option<String>,
    /// Vertical axle-box acceleration in m/s2, positive downwards.
    pub signal: Signal,
    /// Position of the wheel along the track in m at every sample. Positions do not decrease.
    pub position_m: Vec<f64>,
    /// Share of the time with contact loss, 0 to 1. Only simulated passes have this value. No test of a
    /// recording uses it.
    pub contact_loss_share: Option<f64>,
}

impl Pass {
    /// Mean speed in m/s, from the positions.
    pub fn mean_speed_m_s(&self) -> f64 {
        let last = self.position_m.len() - 1;
        let way_m = self.position_m[last] - self.position_m[0];
        way_m / last as f64 * self.signal.sample_rate_hz()
    }
}

impl Recording {
    /// Reads and checks the recording in the folder `path`. All its passes are over one rail.
    ///
    /// # Errors
    /// The first error: its file, its field and the remedy.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        Self::open_selected(path, &Selection::default())
    }

    /// Reads and checks the selected passes of the recording in the folder `path`. A copy of an earlier pass is left
    /// out.
    ///
    /// # Errors
    /// The first error: its file, its field and the remedy.
    pub fn open_selected(
        path: impl AsRef<Path>,
        selection: &Selection,
    ) -> Result<Self, RecordingError> {
        let folder = path.as_ref();
        let (manifest_path, manifest, spacing_m) = stated(folder, Manifest::read)?;
        let selected = selection.of(&manifest_path, &manifest.passes)?;
        let mut passes = Vec::with_capacity(selected.len());
        let mut doubts = Vec::new();
        for (index, entry) in selected {
            let path = pass_path(folder, &manifest_path, index, entry)?;
            let (pass, step_m) = read_pass(&path, &manifest_path, index, &manifest, spacing_m)?;
            doubts.extend(step_m.map(|step_m| straightened(&pass.file, step_m)));
            passes.push(pass);
        }
        let paths: Vec<PathBuf> = passes.iter().map(|pass| folder.join(&pass.file)).collect();
        let samples = passes.iter().map(|pass| pass.signal.samples());
        // Simulated passes without noise repeat to the bit, so a copy is no fault of the folder. But as a second pass it
        // would say that passes do not vary.
        let copies = check::copies(paths.iter().map(PathBuf::as_path).zip(samples));
        doubts.extend(copies.iter().map(|(_, copy)| format!("left out: {copy}")));
        for (index, _) in copies.iter().rev() {
            passes.remove(*index);
        }
        let stated = Self::of_manifest(folder, manifest, spacing_m);
        let name = stated.name.clone() + &selection.suffix();
        doubts.extend(doubts_on_names(&stated.nominal));
        let mut recording = Self { name, passes, ..stated };
        recording.check_sleepers(&manifest_path)?;
        let gain_known = recording.gain_known();
        let quiet = recording.passes.iter().filter_map(|pass| quiet::doubt(pass, gain_known));
        doubts.extend(quiet);
        doubts.extend(recording.passes.iter().filter_map(speed_change::doubt));
        // A recording that was read and written again states them already.
        doubts.retain(|doubt| !recording.doubts.contains(doubt));
        recording.doubts.extend(doubts);
        Ok(recording)
    }

    /// Reads `recording.json` in the folder `path` without passes: sample rate, sleepers and track. The
    /// file may have no passes. A stream uses this, because its samples come from another source.
    ///
    /// # Errors
    /// The first error: its file, its field and the remedy.
    pub fn without_passes(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let folder = path.as_ref();
        let (_, manifest, spacing_m) = stated(folder, Manifest::read_without_passes)?;
        Ok(Self::of_manifest(folder, manifest, spacing_m))
    }

    /// What the manifest of a folder states, without passes.
    fn of_manifest(folder: &Path, manifest: Manifest, spacing_m: f64) -> Self {
        Self {
            name: name_of(folder),
            sample_rate_hz: manifest.sample_rate_hz,
            channel: manifest.channel,
            passes: Vec::new(),
            sleepers: manifest.sleepers,
            nominal: manifest.nominal,
            spacing_m,
            doubts: manifest.notes,
        }
    }

    /// Writes the recording as a folder: `recording.json` and one Parquet file per pass.
    ///
    /// Accelerations are stored in single precision; times start at zero. The folder is written
    /// completely or not at all. The function replaces an existing recording only if that recording was
    /// also simulated.
    ///
    /// # Errors
    /// [`FilesError`] names the file that cannot be written or already exists.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FilesError> {
        let mut output = Output::begin(path.as_ref(), Kind::SimulatedRecording, false)?;
        self.add_to(&mut output)?;
        output.commit()
    }

    /// Adds the files of the recording's folder to others.
    ///
    /// # Errors
    /// [`FilesError`] names the file that can't be written.
    pub fn add_to(&self, output: &mut Output) -> Result<(), FilesError> {
        let mut files = Vec::with_capacity(self.passes.len());
        for (pass, name) in self.passes.iter().zip(self.file_names()) {
            output.fill(&name, |path| write_pass(path, pass))?;
            files.push(output.unique_name(&name)?.to_string());
        }
        let text = self.manifest(files).to_json();
        output.add_manifest(&FileName::new(FILE_NAME)?, text.as_bytes())
    }

    /// The samples of pass `pass` while the wheel was within half a spacing of sleeper `sleeper`
    /// (indices into [`Recording::passes`] and [`Recording::sleepers`]; paper, section 2.3).
    ///
    /// `None` if the pass covers less than two fifths of this window.
    pub fn window(&self, pass: usize, sleeper: usize) -> Option<Range<usize>> {
        self.sleeper_window(sleeper).samples(&self.passes[pass].position_m)
    }

    /// Share of the window of the sleeper that the pass covers, 0 to 1.
    pub fn window_share(&self, pass: usize, sleeper: usize) -> f64 {
        self.sleeper_window(sleeper).share(&self.passes[pass].position_m)
    }

    /// The window of sleeper `sleeper` (index into [`Recording::sleepers`]) along the track.
    pub fn sleeper_window(&self, sleeper: usize) -> SleeperWindow {
        SleeperWindow::around(self.sleepers[sleeper].x_m, self.spacing_m)
    }

    /// The speeds of the passes in km/h, ascending, without duplicates.
    pub fn speeds_km_h(&self) -> Vec<f64> {
        let mut speeds: Vec<f64> = self.passes.iter().map(|pass| pass.speed_km_h).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.dedup();
        speeds
    }

    /// Whether accelerations are in m/s2. False only if `nominal.gain_known` is false.
    pub fn gain_known(&self) -> bool {
        self.nominal.get("gain_known") != Some(&Value::Bool(false))
    }

    /// The nominal value of the quantity `name` of `part`, such as `mass_kg` of the `wheel`, if it is
    /// stated.
    pub fn nominal_value(&self, part: &str, name: &str) -> Option<f64> {
        self.nominal.get(part)?.get(name)?.as_f64()
    }

    /// Median distance of neighbouring sleepers in m. `None` with fewer than two sleepers.
    pub fn median_distance_m(&self) -> Option<f64> {
        median_distance_m(&self.sleepers)
    }

    fn check_sleepers(&self, manifest: &Path) -> Result<(), RecordingError> {
        if self.sleepers.is_empty() {
            return Ok(());
        }
        let found = |pass| (0..self.sleepers.len()).any(|index| self.window(pass, index).is_some());
        if (0..self.passes.len()).any(found) {
            return Ok(());
        }
        let firsts = self.passes.iter().map(|pass| pass.position_m[0]);
        let lasts = self.passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
        let from_m = firsts.fold(f64::INFINITY, f64::min);
        let to_m = lasts.fold(f64::NEG_INFINITY, f64::max);
        let fault = Fault::NoSleeperInside { from_m, to_m };
        Err(RecordingError::new(manifest, "sleepers", fault))
    }

    /// Names such as `pass-07kmh-2.parquet`: speed and number among the passes at that speed.
    fn file_names(&self) -> Vec<FileName> {
        let tenths = |pass: &Pass| (10.0 * pass.speed_km_h).round();
        let mut names = Names::default();
        let mut name = |(index, pass): (usize, &Pass)| {
            let earlier = self.passes[..index].iter();
            let number = earlier.filter(|other| tenths(other) == tenths(pass)).count() + 1;
            let name = names.make(&format!("pass-{:02}kmh-{number}", tenths(pass) / 10.0));
            name.with_ending("parquet")
        };
        self.passes.iter().enumerate().map(&mut name).collect()
    }

    fn manifest(&self, files: Vec<String>) -> Manifest {
        let passes = self.passes.iter().zip(files);
        Manifest {
            sample_rate_hz: self.sample_rate_hz,
            channel: self.channel.clone(),
            passes: passes
                .map(|(pass, file)| PassEntry {
                    file,
                    speed_km_h: pass.speed_km_h,
                    rail: None,
                    axle: pass.axle.clone(),
                    contact_loss_share: pass.contact_loss_share,
                })
                .collect(),
            sleepers: self.sleepers.clone(),
            nominal: self.nominal.clone(),
            notes: self.doubts.clone(),
        }
    }
}

/// The manifest of a folder, checked: its path, its content and the spacing of the sleepers in m.
fn stated(
    folder: &Path,
    read: impl Fn(&Path) -> Result<Manifest, RecordingError>,
) -> Result<(PathBuf, Manifest, f64), RecordingError> {
    let path = folder.join(FILE_NAME);
    let fault = if folder.is_file() {
        Some(FILE)
    } else if !folder.exists() {
        Some(NO_FOLDER)
    } else if !path.exists() {
        Some(NO_MANIFEST)
    } else {
        None
    };
    if let Some(fault) = fault {
        return Err(RecordingError::new(folder, "recording", Fault::NoRecording(fault)));
    }
    let manifest = read(&path)?;
    limits::manifest(&path, &manifest)?;
    let spacing_m = spacing(&path, &manifest)?;
    Ok((path, manifest, spacing_m))
}

/// Path of the file of a pass, which must lie in the folder of the recording.
fn pass_path(
    folder: &Path,
    manifest: &Path,
    index: usize,
    entry: &PassEntry,
) -> Result<PathBuf, RecordingError> {
    inside(folder, &entry.file).map_err(|error| {
        let fault = Fault::OtherFolder { reason: error.to_string() };
        RecordingError::new(manifest, format!("passes[{index}].file"), fault)
    })
}

/// A pass, and the length in m of the steps of its positions, if these were interpolated.
fn read_pass(
    path: &Path,
    manifest_path: &Path,
    index: usize,
    manifest: &Manifest,
    spacing_m: f64,
) -> Result<(Pass, Option<f64>), RecordingError> {
    let (entry, sample_rate_hz) = (&manifest.passes[index], manifest.sample_rate_hz);
    let columns = Columns::read(path)?;
    let clock = check::times(manifest_path, path, &columns, sample_rate_hz)?;
    let of_position =
        |fault: MotionFault| RecordingError::new(path, "position_m", Fault::Motion(fault));
    let odometer = Odometer::straightened(columns.position_m, sample_rate_hz, spacing_m)
        .map_err(of_position)?;
    if !manifest.sleepers.is_empty() {
        odometer.tells_sleepers(spacing_m).map_err(of_position)?;
    }
    let field = format!("passes[{index}].speed_km_h");
    let Odometer { position_m, step_m } = odometer;
    check::speed(manifest_path, &field, path, &position_m, clock, entry.speed_km_h)?;
    check::length(path, &position_m, spacing_m)?;
    let signal = Signal::new(sample_rate_hz, columns.acceleration_m_s2)
        .expect("columns are finite and the rate is positive");
    let PassEntry { file, speed_km_h, axle, contact_loss_share, .. } = entry.clone();
    Ok((Pass { file, speed_km_h, axle, signal, position_m, contact_loss_share }, step_m))
}

/// Note that the steps of the positions were interpolated.
pub(super) fn straightened(file: &str, step_m: f64) -> String {
    let step = significant(step_m, 2);
    format!(
        "{file}: the positions advance in steps of {step} m; a constant speed is assumed \
             between steps, and the origin of the positions is known to one step"
    )
}

fn write_pass(path: &Path, pass: &Pass) -> Result<(), parquet::errors::ParquetError> {
    let samples = pass.signal.samples();
    let rate = pass.signal.sample_rate_hz();
    let times: Vec<f64> = (0..samples.len()).map(|index| index as f64 / rate).collect();
    let single: Vec<f32> = samples.iter().map(|&value| value as f32).collect();
    parquet_file::write(path, &NAMES, &times, &pass.position_m, &single)
}

/// The nominal spacing of the sleepers in m, or the median of their distances.
fn spacing(path: &Path, manifest: &Manifest) -> Result<f64, RecordingError> {
    const FIELD: &str = "nominal.sleeper.spacing_m";
    let expected = "the distance of the sleepers in m";
    let stated = manifest.nominal.get("sleeper").and_then(|sleeper| sleeper.get("spacing_m"));
    if let Some(value) = stated {
        return value.as_f64().filter(|&spacing| spacing > 0.0).ok_or_else(|| {
            let fault = Fault::WrongValue { found: value.to_string(), expected };
            RecordingError::new(path, FIELD, fault)
        });
    }
    median_distance_m(&manifest.sleepers).filter(|&spacing| spacing > 0.0).ok_or_else(|| {
        RecordingError::new(path, FIELD, Fault::NoField { remedy: format!("add {expected}") })
    })
}

fn median_distance_m(sleepers: &[Sleeper]) -> Option<f64> {
    let pairs = sleepers.windows(2);
    let mut distances: Vec<f64> = pairs.map(|pair| pair[1].x_m - pair[0].x_m).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

fn name_of(folder: &Path) -> String {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    full.file_name().map_or_else(|| "recording".to_owned(), |name| name.to_string_lossy().into())
}
