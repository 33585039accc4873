//! The ring study: recorded, evaluated as a whole, by lap and by speed, diagnosed, compared with its
//! truth.
//!
//! Owns the order of the stages and the files of the folder; a stage whose file is there is not done
//! again. The ring crate owns the ring and the statements.

mod part;

use crate::pipeline::compute::compute;
use crate::pipeline::diagnose::{DiagnosingError, Setting, diagnose};
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::invert::{InvertingError, invert};
use part::{Part, sections};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_evaluation::{check_recording, features};
use tracktwin_experiment::CODE_VERSION;
use tracktwin_files::{FileName, FilesError, Kind, Output, check, read_text, replace};
use tracktwin_library::Library;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::TruthError;
use tracktwin_ring::{Estimated, Method, Plan, RailSpectra, Ring, RingError, Study};
use tracktwin_signal::recording::{Recording, RecordingError};
use tracktwin_signal::{Extractor, FeatureDefinition, FeatureError};

/// File that identifies the ring of the folder.
const TERMS: &str = "plan.json";
/// Folders of the recording, of evaluations and of diagnoses.
const RECORDING: &str = "recording";
const EVALUATIONS: &str = "evaluations";
const DIAGNOSES: &str = "diagnoses";
/// Result files.
const PAGE: &str = "report.html";
const STATEMENTS: &str = "ring.json";
const TABLE: &str = "ring.csv";
const TRUTH: [&str; 2] = ["truth.json", "truth.csv"];

/// Digits of a library's digest in the name of a folder.
const DIGEST_SHOWN: usize = 12;

/// Files of an evaluation and of a diagnosis.
const EVALUATION: &str = "evaluation.json";
const DIAGNOSIS: &str = "diagnosis.json";

/// A ring study, and where it is kept.
pub struct RingStudy<'a> {
    /// The ring.
    pub ring: &'a Ring,
    /// Its folder.
    pub folder: &'a Path,
    /// Keeps the null simulations, if there is one.
    pub library: Option<&'a Library>,
    /// The models of the paper's method, if it is to be asked too.
    pub models: Option<&'a Evaluator>,
    /// Whether every lap is diagnosed.
    pub diagnose: bool,
    /// Whether files that the program did not write are replaced.
    pub force: bool,
}

/// Why a ring study ends before its time.
#[derive(Debug, thiserror::Error)]
pub enum RingStudyError {
    /// The folder holds another ring.
    #[error(
        "{folder}: contains a ring of other settings ({known}); use another --out, or the same settings"
    )]
    Other {
        /// The folder.
        folder: String,
        /// Seed, laps, speeds and stretch of the ring there, and the version that began it.
        known: String,
    },
    /// The ring cannot be recorded.
    #[error("cannot record the ring: {0}")]
    Truth(#[from] TruthError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A part of the recording cannot be evaluated by inversion.
    #[error("{part}: {source}")]
    Inversion {
        /// The part.
        part: String,
        /// Why.
        source: InvertingError,
    },
    /// The recording has no spectra.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The models cannot evaluate the recording, or a window of it has no spectrum.
    #[error(transparent)]
    Models(#[from] tracktwin_evaluation::Error),
    /// A part of the recording cannot be diagnosed.
    #[error("{part}: {source}")]
    Diagnosis {
        /// The part.
        part: String,
        /// Why.
        source: DiagnosingError,
    },
    /// A file of the folder is not what it was.
    #[error("{path}: {source}; remove it, and it is made again")]
    NoEvaluation {
        /// The file.
        path: String,
        /// Why.
        source: RingError,
    },
    /// The same of a file of the program's own.
    #[error("{path}: {source}; remove it, and it is made again")]
    Json {
        /// The file.
        path: String,
        /// Why.
        source: serde_json::Error,
    },
    /// A file cannot be read or written, or belongs to another.
    #[error(transparent)]
    Files(#[from] FilesError),
}

impl RingStudyError {
    /// Whether the settings or the folder are to be changed.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::Other { .. }
            | Self::Models(_)
            | Self::NoEvaluation { .. }
            | Self::Json { .. } => true,
            Self::Files(error) => error.is_wrong_input(),
            Self::Inversion { source: InvertingError::Recording(_), .. }
            | Self::Diagnosis { source: DiagnosingError::Recording(_), .. } => true,
            _ => false,
        }
    }
}

/// Identity of a folder's ring.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Terms {
    #[serde(flatten)]
    plan: Plan,
    code_version: String,
}

/// Progress of a study: steps done, and what is being done.
pub type Watch<'a> = dyn Fn(u64, &str) + Sync + 'a;

/// Checks that the study can be written into a folder.
///
/// # Errors
/// [`FilesError`] names the first file that is not the program's.
pub fn check_folder(folder: &Path, force: bool) -> Result<(), FilesError> {
    let names = [PAGE, STATEMENTS, TABLE, TRUTH[0], TRUTH[1]];
    check(folder, Kind::Results, force, &names)
}

impl RingStudy<'_> {
    /// Steps of the study.
    pub fn steps(&self) -> u64 {
        let plan = self.ring.plan();
        let diagnoses =
            if self.diagnose { plan.laps * sections(plan.stretch.sleepers()).len() } else { 0 };
        let evaluations = self.parts().len() + usize::from(self.models.is_some());
        (1 + evaluations + diagnoses) as u64
    }

    /// Does what is not done yet, and compares all with the truth.
    ///
    /// # Errors
    /// [`RingStudyError`]; what is done by then is kept.
    pub async fn run(&self, watch: &Watch<'_>) -> Result<Study, RingStudyError> {
        self.begin()?;
        watch(0, "recording");
        let recording = self.recording()?;
        let mut study = Study::new(self.ring);
        study.spectra = Some(compute(|| spectra(&recording, &study))?);
        let mut done = 1;
        for part in self.parts() {
            let estimated = self.inversion(&recording, &part, done, watch).await?;
            match part {
                Part::All => study.methods.push((Method::Inversion, estimated)),
                Part::Lap(_) => study.laps.push(estimated),
                Part::Speed(speed_km_h) => study.speeds.push((speed_km_h, estimated)),
            }
            done += 1;
        }
        if let Some(models) = self.models {
            watch(done, "Gaussian processes");
            self.by_models(&recording, models, &mut study)?;
            done += 1;
        }
        if self.diagnose {
            for lap in 1..=self.ring.plan().laps {
                study.diagnoses.add_lap(&self.diagnoses(&recording, lap, &mut done, watch).await?);
            }
        }
        Ok(study)
    }

    /// Writes page, table and statements; gives the path of the page.
    ///
    /// # Errors
    /// [`FilesError`] of a file that cannot be written.
    pub fn write(&self, study: &Study, page: &str) -> Result<PathBuf, FilesError> {
        let truth = &study.truth;
        let mut output = Output::begin(self.folder, Kind::Results, self.force)?;
        for (name, text) in [
            (TRUTH[0], &truth.to_json()),
            (TRUTH[1], &truth.to_csv()),
            (TABLE, &study.to_csv()),
            (STATEMENTS, &study.to_json()),
        ] {
            output.add(&FileName::new(name)?, text.as_bytes())?;
        }
        output.add(&FileName::new(PAGE)?, page.as_bytes())?;
        output.commit()?;
        Ok(self.folder.join(PAGE))
    }

    /// All passes; with several laps or speeds, each of them alone too.
    fn parts(&self) -> Vec<Part> {
        let plan = self.ring.plan();
        let mut parts = vec![Part::All];
        if plan.laps > 1 {
            parts.extend((1..=plan.laps).map(Part::Lap));
        }
        if plan.speeds_km_h.len() > 1 {
            parts.extend(plan.speeds_km_h.iter().map(|&speed_km_h| Part::Speed(speed_km_h)));
        }
        parts
    }

    /// Makes sure that the folder's ring is this one.
    fn begin(&self) -> Result<(), RingStudyError> {
        let path = self.folder.join(TERMS);
        let terms = Terms { plan: self.ring.plan().clone(), code_version: CODE_VERSION.to_owned() };
        let Some(text) = if_there(&path)? else {
            let text = serde_json::to_string_pretty(&terms).expect("a plan is plain JSON");
            return Ok(replace(&path, text.as_bytes())?);
        };
        let known: Terms = serde_json::from_str(&text).map_err(json(&path))?;
        if known == terms {
            return Ok(());
        }
        let Plan { seed, laps, speeds_km_h, stretch } = &known.plan;
        let version = &known.code_version;
        let known = format!(
            "seed {seed}, {laps} laps at {speeds_km_h:?} km/h, sleepers {stretch}, version {version}"
        );
        Err(RingStudyError::Other { folder: self.folder.display().to_string(), known })
    }

    /// The recording, made if it is not there.
    fn recording(&self) -> Result<Recording, RingStudyError> {
        let folder = self.folder.join(RECORDING);
        if !folder.join("recording.json").exists() {
            compute(|| self.ring.record())?.write(&folder)?;
        }
        Ok(Recording::open(&folder)?)
    }

    async fn inversion(
        &self,
        recording: &Recording,
        part: &Part,
        done: u64,
        watch: &Watch<'_>,
    ) -> Result<Estimated, RingStudyError> {
        let folder = self.folder.join(EVALUATIONS).join(part.name());
        let path = folder.join(EVALUATION);
        if !path.exists() {
            let some = part.of(recording);
            let shown = |stage: &'static str, share: f64| {
                watch(done, &format!("{part}: {stage} {:.0} %", 100.0 * share));
            };
            let inverted = invert(&some, &Preset::VTrack.track(), self.library, &shown).await;
            let inversion = inverted
                .map_err(|source| RingStudyError::Inversion { part: part.to_string(), source })?;
            let mut output = Output::begin(&folder, Kind::Results, self.force)?;
            inversion.add_to(&mut output, "evaluation")?;
            output.commit()?;
        }
        let text = read_text(&path)?;
        Estimated::read(&text).map_err(no_evaluation(&path))
    }

    /// Adds what models and model selector say of the whole recording.
    fn by_models(
        &self,
        recording: &Recording,
        models: &Evaluator,
        study: &mut Study,
    ) -> Result<(), RingStudyError> {
        // Models of other results give other estimates: each library has its own folder.
        let digest = models.models().library_digest().chars().take(DIGEST_SHOWN);
        let name = format!("models-{}", digest.collect::<String>());
        let folder = self.folder.join(EVALUATIONS).join(name);
        let path = folder.join(EVALUATION);
        if !path.exists() {
            check_recording(recording, models.design(), &models.set().speeds_km_h)?;
            let evaluation = compute(|| models.evaluate(recording))?;
            let mut output = Output::begin(&folder, Kind::Results, self.force)?;
            evaluation.add_to(&mut output)?;
            output.commit()?;
        }
        let text = read_text(&path)?;
        let estimated = Estimated::read(&text).map_err(no_evaluation(&path))?;
        study.methods.push((Method::GaussianProcesses, estimated));
        let selected = Estimated::read_selector(&text).map_err(no_evaluation(&path))?;
        study.methods.extend(selected.map(|selected| (Method::Selector, selected)));
        Ok(())
    }

    /// The diagnoses of a lap, section by section.
    async fn diagnoses(
        &self,
        recording: &Recording,
        lap: usize,
        done: &mut u64,
        watch: &Watch<'_>,
    ) -> Result<Vec<Diagnosis>, RingStudyError> {
        let lap = Part::Lap(lap);
        let recording = lap.of(recording);
        let mut all = Vec::new();
        for range in sections(recording.sleepers.len()) {
            let section = part::cut(&recording, range);
            let [first, last] = [section.sleepers.first(), section.sleepers.last()]
                .map(|it| it.map(|sleeper| sleeper.id.clone()).unwrap_or_default());
            let place = format!("{first}-{last}");
            let folder = self.folder.join(DIAGNOSES).join(lap.name()).join(&place);
            let path = folder.join(DIAGNOSIS);
            if !path.exists() {
                let shown = |stage: &'static str, share: f64| {
                    let share = 100.0 * share;
                    watch(*done, &format!("{lap}, {place}: diagnosis, {stage} {share:.0} %"));
                };
                let diagnosis = self.diagnosis(&section, &shown).await;
                let diagnosis = diagnosis.map_err(|source| RingStudyError::Diagnosis {
                    part: format!("{lap}, {place}"),
                    source,
                })?;
                let text = serde_json::to_string_pretty(&diagnosis);
                let text = text.expect("a diagnosis is plain JSON");
                let mut output = Output::begin(&folder, Kind::Results, self.force)?;
                output.add(&FileName::new(DIAGNOSIS)?, text.as_bytes())?;
                output.commit()?;
            }
            all.push(serde_json::from_str(&read_text(&path)?).map_err(json(&path))?);
            *done += 1;
        }
        Ok(all)
    }

    async fn diagnosis(
        &self,
        section: &Recording,
        watch: &(dyn Fn(&'static str, f64) + Sync),
    ) -> Result<Diagnosis, DiagnosingError> {
        let track = Preset::VTrack.track();
        let setting = Setting { track: &track, library: self.library, without: &[], shuffle: None };
        Ok(diagnose(section, setting, watch).await?.diagnosis)
    }
}

/// Spectra of the rails at the highest speed.
fn spectra(recording: &Recording, study: &Study) -> Result<RailSpectra, RingStudyError> {
    let fastest = study.plan.speeds_km_h.iter().copied().fold(0.0, f64::max);
    let definition = FeatureDefinition::default();
    let extractor = Extractor::new(&definition)?;
    let found = features(&Part::Speed(fastest).of(recording), &extractor, &[fastest])?;
    Ok(RailSpectra::new(&study.truth, fastest, definition.frequencies_hz(), &found))
}

/// Text of a file; none where there is none.
fn if_there(path: &Path) -> Result<Option<String>, FilesError> {
    match path.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        _ => read_text(path).map(Some),
    }
}

fn json(path: &Path) -> impl Fn(serde_json::Error) -> RingStudyError + '_ {
    |source| RingStudyError::Json { path: path.display().to_string(), source }
}

fn no_evaluation(path: &Path) -> impl Fn(RingError) -> RingStudyError + '_ {
    |source| RingStudyError::NoEvaluation { path: path.display().to_string(), source }
}
