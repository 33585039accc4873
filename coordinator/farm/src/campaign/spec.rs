//! The campaign file (TOML) and the checked [`Campaign`] that is built from it.

mod parameters;
mod surface;

use parameters::Parameters;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_parameters::quantity::CASES;
use tracktwin_parameters::{
    OWEN_POINTS_MAX, Parameter, ParameterSpace, Preset, QuantityError, Sequence, SpaceError, Track,
    TrackError, toml_fault,
};
use tracktwin_signal::FeatureDefinition;
use tracktwin_track::extension::SampledExtension;

/// Maximum length of a campaign's name, in characters.
const NAME_CHARACTERS_MAX: usize = 64;

/// The built-in campaign file, which `tracktwin run` uses if no file is given.
pub const DEFAULT: &str = include_str!("default.toml");

/// A set of cases: the sampled parameter space and the simulation of each case.
///
/// All settings except `name` and `cases` determine the results, and therefore the identity of the
/// campaign. The number of cases can be increased later; the campaign keeps its identity.
#[derive(Clone, Debug, Serialize)]
pub struct Campaign {
    /// Name of the campaign.
    pub name: String,
    /// Number of cases.
    pub cases: u32,
    /// Whether the sequence was chosen from the number of cases, because the file does not name one.
    #[serde(skip)]
    pub sequence_by_cases: bool,
    /// Settings that determine the results.
    #[serde(flatten)]
    pub definition: Definition,
}

/// Definition of a campaign: equal definitions have equal cases and equal results.
#[derive(Clone, Debug, Serialize)]
pub struct Definition {
    /// Seed of the sample points and of every case's surface.
    pub seed: u64,
    /// Sequence of the sample points.
    pub sequence: Sequence,
    /// The varied parameters and their ranges.
    pub space: ParameterSpace,
    /// Values of the parameters, in catalogue order. Only those of parameters that are not varied are used.
    pub fixed: [f64; Parameter::COUNT],
    /// Whether every case has a separate irregularity.
    #[serde(skip_serializing_if = "Surfaces::is_default")]
    pub surfaces: Surfaces,
    /// Simulation of each case, and the features computed from it.
    pub experiment: Experiment,
}

/// Choice of the irregularities of the cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surfaces {
    /// Every case has a separate irregularity, as every stretch of a real track has.
    #[default]
    PerCase,
    /// All cases have the same irregularity, scaled by the level. Models trained on such a library learn
    /// this one surface and cannot be used for a recording. The library of the paper may have been made
    /// this way.
    Shared,
}

impl Surfaces {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Reasons for refusing a campaign file. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// The file can't be read.
    #[error("{0}")]
    Unreadable(#[from] tracktwin_files::FilesError),
    /// The file is not TOML, has an unknown key, or has a value of the wrong type.
    #[error("{path}:{line}: {message}")]
    Malformed {
        /// Path of the file.
        path: String,
        /// Line number, from 1.
        line: usize,
        /// Error message of the parser.
        message: String,
    },
    /// The name is empty, too long, or has a character that is not allowed.
    #[error(
        "{path}: name: {name:?} must start with a letter or digit and have up to \
             {NAME_CHARACTERS_MAX} letters, digits, spaces, and . _ - +"
    )]
    Name {
        /// Path of the file.
        path: String,
        /// The given name.
        name: String,
    },
    /// The range of a parameter is invalid.
    #[error("{path}: parameters.{source}")]
    Space {
        /// Path of the file.
        path: String,
        /// Cause, with the name of the parameter.
        source: SpaceError,
    },
    /// The experiment cannot be simulated with these settings.
    #[error("{path}: {source}")]
    Experiment {
        /// Path of the file.
        path: String,
        /// Cause.
        source: ExperimentError,
    },
    /// The track file is invalid.
    #[error("{path}: track: {track}: {source}")]
    Track {
        /// Path of the campaign file.
        path: String,
        /// Path of the track file.
        track: String,
        /// Cause.
        source: Box<TrackError>,
    },
    /// The file gives both a preset and a track file.
    #[error("{path}: track: a preset is given too; remove one of the two")]
    TwoTracks {
        /// Path of the file.
        path: String,
    },
    /// A number is outside the limits of its key.
    #[error("{path}: {key}: {source}")]
    Number {
        /// Path of the file.
        path: String,
        /// The key with its section, as in the file.
        key: String,
        /// Cause.
        source: QuantityError,
    },
    /// The number of cases is zero.
    #[error("{path}: cases: a campaign needs at least one case")]
    NoCases {
        /// Path of the file.
        path: String,
    },
    /// The number of cases exceeds the number of points of the sequence.
    #[error(
        "{path}: cases: {cases} exceeds the {OWEN_POINTS_MAX} points of the owen_scrambled \
             sequence; write `sequence = \"rotated\"`"
    )]
    SequenceExhausted {
        /// Path of the file.
        path: String,
        /// Requested number of cases.
        cases: u32,
    },
}

/// Content of the campaign file before it is checked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    seed: u64,
    cases: u32,
    preset: Option<Preset>,
    track: Option<PathBuf>,
    sequence: Option<Sequence>,
    #[serde(default)]
    surfaces: Surfaces,
    speeds_km_h: Option<Vec<f64>>,
    #[serde(default)]
    parameters: Parameters,
    #[serde(default)]
    simulation: Simulation,
    #[serde(default)]
    features: FeatureDefinition,
    #[serde(default)]
    extension: Vec<SampledExtension>,
}

/// The numerical settings that a campaign may change.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Simulation {
    spans: Option<usize>,
    rail_elements_per_span: Option<usize>,
    sleeper_elements: Option<usize>,
    time_step_s: Option<f64>,
    run_in_spans: Option<f64>,
    local_flexibility: Option<bool>,
}

impl Campaign {
    /// Reads a campaign file. If `cases` is given, it replaces the number of cases in the file.
    ///
    /// # Errors
    /// Returns [`SpecError`]; its message is one line with the position, the cause and the remedy.
    pub fn read(path: &Path, cases: Option<u32>) -> Result<Self, SpecError> {
        let shown = path.display().to_string();
        let text = tracktwin_files::read_text(path)?;
        Self::parse(&text, &shown, cases)
    }

    /// Returns the built-in campaign. If `cases` is given, it replaces the number of cases.
    ///
    /// # Errors
    /// Returns [`SpecError`] if the number of cases is invalid.
    pub fn built_in(cases: Option<u32>) -> Result<Self, SpecError> {
        Self::parse(DEFAULT, "built-in campaign", cases)
    }

    /// Returns the built-in campaign for another track, with the name of this track.
    ///
    /// # Errors
    /// As [`Campaign::built_in`].
    pub fn built_in_on(track: &Track, cases: Option<u32>) -> Result<Self, SpecError> {
        const PATH: &str = "built-in campaign";
        let mut file = File::parse(DEFAULT, PATH)?;
        file.name.clone_from(&track.name);
        file.check(PATH, cases, track)
    }

    /// Parses a campaign from text. Error messages use `path` as the name of the file.
    ///
    /// # Errors
    /// As [`Campaign::read`], except for errors of reading the file.
    pub fn parse(text: &str, path: &str, cases: Option<u32>) -> Result<Self, SpecError> {
        let file = File::parse(text, path)?;
        let track = file.track(path)?;
        file.check(path, cases, &track)
    }

    /// Id in the library: the name and the beginning of the definition's hash.
    pub fn id(&self) -> String {
        format!("{}-{}", self.name, &self.definition_hash()[..12])
    }

    /// Hash (BLAKE3, hexadecimal) of [`Campaign::definition_json`].
    pub fn definition_hash(&self) -> String {
        blake3::hash(self.definition_json().as_bytes()).to_hex().to_string()
    }

    /// The definition as canonical JSON.
    pub fn definition_json(&self) -> String {
        serde_json::to_string(&self.definition).expect("numbers and names become JSON")
    }
}

impl File {
    fn parse(text: &str, path: &str) -> Result<Self, SpecError> {
        toml::from_str(text).map_err(|error| {
            let (line, message) = toml_fault(text, &error);
            SpecError::Malformed { path: path.to_owned(), line, message }
        })
    }

    /// Returns the preset or reads the track file. The path of a track file is relative to the folder of
    /// the campaign file.
    fn track(&self, path: &str) -> Result<Track, SpecError> {
        let Some(file) = &self.track else {
            return Ok(self.preset.unwrap_or_default().track());
        };
        if self.preset.is_some() {
            return Err(SpecError::TwoTracks { path: path.to_owned() });
        }
        let file = Path::new(path).parent().unwrap_or(Path::new("")).join(file);
        let text = tracktwin_files::read_text(&file)?;
        Track::parse(&text).map_err(|source| SpecError::Track {
            path: path.to_owned(),
            track: file.display().to_string(),
            source: Box::new(source),
        })
    }

    fn check(self, path: &str, cases: Option<u32>, track: &Track) -> Result<Campaign, SpecError> {
        let is_name = |c: char| c.is_alphanumeric() || " ._-+".contains(c);
        let fits = (1..=NAME_CHARACTERS_MAX).contains(&self.name.chars().count());
        let begins = self.name.starts_with(char::is_alphanumeric);
        if !fits || !begins || !self.name.chars().all(is_name) {
            return Err(SpecError::Name { path: path.to_owned(), name: self.name });
        }
        let cases = cases.unwrap_or(self.cases);
        if cases == 0 {
            return Err(SpecError::NoCases { path: path.to_owned() });
        }
        CASES.check(f64::from(cases)).map_err(|source| number(path, "cases", source))?;
        let sequence = self.sequence.unwrap_or(Sequence::for_cases(cases));
        if sequence == Sequence::OwenScrambled && cases > OWEN_POINTS_MAX {
            return Err(SpecError::SequenceExhausted { path: path.to_owned(), cases });
        }
        let (space, fixed) = self.parameters.sampled(path, track)?;
        let experiment = self
            .experiment(track)
            .map_err(|source| SpecError::Experiment { path: path.to_owned(), source })?;
        let fixed = *fixed.values();
        let (seed, surfaces) = (self.seed, self.surfaces);
        let definition = Definition { seed, sequence, space, fixed, surfaces, experiment };
        let sequence_by_cases = self.sequence.is_none();
        Ok(Campaign { name: self.name, cases, sequence_by_cases, definition })
    }

    fn experiment(&self, track: &Track) -> Result<Experiment, ExperimentError> {
        let simulation = &self.simulation;
        let mut experiment = Experiment::new(track.design.clone());
        self.parameters.set_design(&mut experiment)?;
        experiment.wavelengths_m = track.wavelengths_m;
        let speeds = self.speeds_km_h.as_ref();
        experiment.speeds_km_h.clone_from(speeds.unwrap_or(&track.speeds_km_h));
        experiment.features = self.features.clone();
        experiment.extensions.clone_from(&self.extension);
        if !experiment.extensions.iter().any(|extension| extension.physics == surface::SPECTRUM) {
            experiment.extensions.extend(surface::slope(track, &experiment.speeds_km_h));
        }
        replace(&mut experiment.spans, simulation.spans);
        replace(&mut experiment.rail_elements_per_span, simulation.rail_elements_per_span);
        replace(&mut experiment.sleeper_elements, simulation.sleeper_elements);
        replace(&mut experiment.time_step_s, simulation.time_step_s);
        replace(&mut experiment.run_in_spans, simulation.run_in_spans);
        replace(&mut experiment.local_flexibility, simulation.local_flexibility);
        experiment.checked()
    }
}

fn number(path: &str, key: &str, source: QuantityError) -> SpecError {
    SpecError::Number { path: path.to_owned(), key: key.to_owned(), source }
}

fn replace<T>(setting: &mut T, chosen: Option<T>) {
    if let Some(value) = chosen {
        *setting = value;
    }
}

#[cfg(test)]
mod tests;
