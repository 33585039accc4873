//! The campaign file (TOML) and the checked campaign it becomes.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_parameters::quantity::CASES;
use tracktwin_parameters::{
    Axis, OWEN_POINTS_MAX, Parameter, ParameterSet, ParameterSpace, Preset, QuantityError, Scale,
    Sequence, SpaceError, Track, TrackError, toml_fault,
};
use tracktwin_signal::FeatureDefinition;
use tracktwin_track::extension::SampledExtension;

/// Longest name of a campaign.
const NAME_CHARACTERS_MAX: usize = 64;

/// The campaign that `tracktwin run` simulates where none is named.
pub const DEFAULT: &str = include_str!("default.toml");

/// A set of cases: where they are sampled and what is done with each.
///
/// Everything but `name` and `cases` decides results and therefore the campaign's identity; so a
/// campaign may be given more cases later and stays itself.
#[derive(Clone, Debug, Serialize)]
pub struct Campaign {
    /// Its name.
    pub name: String,
    /// How many cases it has.
    pub cases: u32,
    /// Whether the sequence of its points follows from that number, for the file names none.
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
    /// Sequence that the sample points come from.
    pub sequence: Sequence,
    /// The varied parameters and their ranges.
    pub space: ParameterSpace,
    /// The values of the parameters that don't vary, in catalogue order.
    pub fixed: [f64; Parameter::COUNT],
    /// Whether every case has a separate irregularity.
    #[serde(skip_serializing_if = "Surfaces::is_default")]
    pub surfaces: Surfaces,
    /// What is simulated and measured in each case.
    pub experiment: Experiment,
}

/// Which irregularity the cases run over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surfaces {
    /// Every case has its own, as every stretch of a real track has.
    #[default]
    PerCase,
    /// All cases share one, scaled by the level: models learn that surface by heart and are of no
    /// use for a recording, but this may be how the paper's library was made.
    Shared,
}

impl Surfaces {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Why a campaign file is refused; one line each.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// The file can't be read.
    #[error("{0}")]
    Unreadable(#[from] tracktwin_files::FilesError),
    /// Not TOML, an unknown key, or a value of the wrong type.
    #[error("{path}:{line}: {message}")]
    Malformed {
        /// The file.
        path: String,
        /// The line, from 1.
        line: usize,
        /// Error of the parser.
        message: String,
    },
    /// A name that terminals, pages and commands can't take.
    #[error(
        "{path}: name: {name:?} must start with a letter or digit and have up to \
             {NAME_CHARACTERS_MAX} letters, digits, spaces, and . _ - +"
    )]
    Name {
        /// The file.
        path: String,
        /// The name.
        name: String,
    },
    /// A range is wrong.
    #[error("{path}: parameters.{source}")]
    Space {
        /// The file.
        path: String,
        /// What is wrong.
        source: SpaceError,
    },
    /// The simulation can't be done as described.
    #[error("{path}: {source}")]
    Experiment {
        /// The file.
        path: String,
        /// What is wrong.
        source: ExperimentError,
    },
    /// The track's description is wrong.
    #[error("{path}: track: {track}: {source}")]
    Track {
        /// The campaign file.
        path: String,
        /// The track file.
        track: String,
        /// What is wrong.
        source: Box<TrackError>,
    },
    /// Two descriptions of the track.
    #[error("{path}: track: a preset is given too; remove one of the two")]
    TwoTracks {
        /// The file.
        path: String,
    },
    /// A number can't be what it is given for.
    #[error("{path}: {key}: {source}")]
    Number {
        /// The file.
        path: String,
        /// The key.
        key: String,
        /// Why not.
        source: QuantityError,
    },
    /// No case at all.
    #[error("{path}: cases: a campaign needs at least one case")]
    NoCases {
        /// The file.
        path: String,
    },
    /// More cases than the sequence has points.
    #[error(
        "{path}: cases: {cases} exceeds the {OWEN_POINTS_MAX} points of the owen_scrambled \
             sequence; write `sequence = \"rotated\"`"
    )]
    SequenceExhausted {
        /// The file.
        path: String,
        /// The cases asked for.
        cases: u32,
    },
}

/// The campaign file as it is written.
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
    parameters: BTreeMap<Parameter, Range>,
    #[serde(default)]
    simulation: Simulation,
    #[serde(default)]
    features: FeatureDefinition,
    #[serde(default)]
    extension: Vec<SampledExtension>,
}

/// How a parameter is given.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number, [low, high] or { low, high, scale }")]
enum Range {
    Fixed(f64),
    Between([f64; 2]),
    Scaled { low: f64, high: f64, scale: Scale },
}

impl Range {
    /// The numbers that were given.
    fn values(self) -> Vec<f64> {
        match self {
            Self::Fixed(value) => vec![value],
            Self::Between(ends) => ends.to_vec(),
            Self::Scaled { low, high, .. } => vec![low, high],
        }
    }
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
    /// Reads a campaign file; `cases`, if given, takes the place of the file's own number.
    ///
    /// # Errors
    /// [`SpecError`] states in one line what is wrong, where, and what to do.
    pub fn read(path: &Path, cases: Option<u32>) -> Result<Self, SpecError> {
        let shown = path.display().to_string();
        let text = tracktwin_files::read_text(path)?;
        Self::parse(&text, &shown, cases)
    }

    /// The campaign that is simulated where none is named.
    ///
    /// # Errors
    /// As [`Campaign::read`], for a number of cases that can't be.
    pub fn built_in(cases: Option<u32>) -> Result<Self, SpecError> {
        Self::parse(DEFAULT, "built-in campaign", cases)
    }

    /// The same campaign on another track, whose name it takes.
    ///
    /// # Errors
    /// As [`Campaign::built_in`].
    pub fn built_in_on(track: &Track, cases: Option<u32>) -> Result<Self, SpecError> {
        const PATH: &str = "built-in campaign";
        let mut file = File::parse(DEFAULT, PATH)?;
        file.name.clone_from(&track.name);
        file.check(PATH, cases, track)
    }

    /// Reads a campaign from text, which errors call `path`.
    ///
    /// # Errors
    /// As [`Campaign::read`], the file's own apart.
    pub fn parse(text: &str, path: &str, cases: Option<u32>) -> Result<Self, SpecError> {
        let file = File::parse(text, path)?;
        let track = file.track(path)?;
        file.check(path, cases, &track)
    }

    /// The name in the library: the given name and the hash of the definition.
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

    /// The track of the preset or of the file, whose path is relative to the campaign file's folder.
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
        let (space, fixed) = self.sampled(path, track)?;
        let experiment = self
            .experiment(track)
            .map_err(|source| SpecError::Experiment { path: path.to_owned(), source })?;
        let fixed = *fixed.values();
        let (seed, surfaces) = (self.seed, self.surfaces);
        let definition = Definition { seed, sequence, space, fixed, surfaces, experiment };
        let sequence_by_cases = self.sequence.is_none();
        Ok(Campaign { name: self.name, cases, sequence_by_cases, definition })
    }

    /// The sampled space, and the values of what isn't sampled.
    fn sampled(
        &self,
        path: &str,
        track: &Track,
    ) -> Result<(ParameterSpace, ParameterSet), SpecError> {
        let mut axes = Vec::new();
        let mut fixed = track.nominal;
        for &parameter in Parameter::ALL {
            let linear = |low, high| Axis { parameter, low, high, scale: Scale::Linear };
            match self.parameters.get(&parameter) {
                None => axes.push(track.axis(parameter)),
                Some(&Range::Between([low, high])) => axes.push(linear(low, high)),
                Some(&Range::Scaled { low, high, scale }) => {
                    axes.push(Axis { parameter, low, high, scale });
                }
                Some(&Range::Fixed(value)) => fixed[parameter] = value,
            }
            let given = self.parameters.get(&parameter);
            for value in given.map(|range| range.values()).unwrap_or_default() {
                let key = format!("parameters.{parameter}");
                let checked = parameter.quantity().check(value);
                checked.map_err(|source| number(path, &key, source))?;
            }
        }
        let space = ParameterSpace::new(axes)
            .map_err(|source| SpecError::Space { path: path.to_owned(), source })?;
        Ok((space, fixed))
    }

    fn experiment(&self, track: &Track) -> Result<Experiment, ExperimentError> {
        let simulation = &self.simulation;
        let mut experiment = Experiment::new(track.design.clone());
        experiment.wavelengths_m = track.wavelengths_m;
        let speeds = self.speeds_km_h.as_ref();
        experiment.speeds_km_h.clone_from(speeds.unwrap_or(&track.speeds_km_h));
        experiment.features = self.features.clone();
        experiment.extensions.clone_from(&self.extension);
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
