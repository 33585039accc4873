//! The ring study. The ring is recorded, evaluated as a whole, by lap and by speed, diagnosed, and compared
//! with its true values.
//!
//! This module defines the order of the stages and the files of the folder. A stage is skipped if its file
//! exists. The ring crate defines the ring and the statements.

mod diagnoses;
mod error;
mod folder;
mod part;

pub use error::RingStudyError;
pub use folder::check_folder;

use crate::pipeline::compute::compute;
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::invert::invert;
use error::no_evaluation;
use folder::{EVALUATIONS, PAGE, RECORDING, STATEMENTS, TABLE, TRUTH};
use part::Part;
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_evaluation::{ModelSpeeds, check_recording, features};
use tracktwin_files::{FileName, FilesError, Kind, Output, read_text};
use tracktwin_library::Library;
use tracktwin_parameters::Preset;
use tracktwin_ring::{Estimated, Method, RailSpectra, Ring, Study};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureDefinition};
use tracktwin_surrogate::Trained;

/// Number of digits of a library's digest in the name of a folder.
const DIGEST_SHOWN: usize = 12;

/// Name of the file with an evaluation.
const EVALUATION: &str = "evaluation.json";

/// A ring study with its settings and its folder.
pub struct RingStudy<'a> {
    /// The ring to record.
    pub ring: &'a Ring,
    /// Output folder.
    pub folder: &'a Path,
    /// Library for storing null simulations, if available.
    pub library: Option<&'a Library>,
    /// Models of the paper's method; `None` if this method is not used.
    pub models: Option<&'a Evaluator>,
    /// Whether every lap is diagnosed.
    pub diagnose: bool,
    /// Makes the page of a diagnosis.
    pub page: &'a (dyn Fn(&Diagnosis) -> String + Sync),
    /// Whether files that the program did not write may be replaced.
    pub force: bool,
}

/// A part of the recording to evaluate.
struct Evaluated<'a> {
    /// Copies the part; called only if its evaluation is missing.
    recording: &'a (dyn Fn() -> Recording + Sync),
    /// Name of the folder of the evaluation.
    name: String,
    /// Diagnosis whose accepted physics is part of the model.
    diagnosis: Option<&'a Diagnosis>,
}

/// Receives the progress of a study: number of completed steps, and name of the current step.
pub type Watch<'a> = dyn Fn(u64, &str) + Sync + 'a;

impl RingStudy<'_> {
    /// Number of steps of the study.
    pub fn steps(&self) -> u64 {
        // Every lap is diagnosed; then all passes are evaluated once more.
        let diagnoses = if self.diagnose { self.ring.plan().laps + 1 } else { 0 };
        let evaluations = self.parts().len() + usize::from(self.models.is_some());
        (1 + evaluations + diagnoses) as u64
    }

    /// Computes the missing stages, and compares all results with the true values.
    ///
    /// # Errors
    /// Returns [`RingStudyError`]. Stages completed before the error are kept.
    pub async fn run(&self, watch: &Watch<'_>) -> Result<Study, RingStudyError> {
        self.begin()?;
        watch(0, "recording");
        let recording = self.recording()?;
        let mut study = Study::new(self.ring);
        study.spectra = Some(compute(|| spectra(&recording, &study))?);
        let mut done = 1;
        for part in self.parts() {
            let evaluated = Evaluated {
                recording: &|| part.of(&recording),
                name: part.name(),
                diagnosis: None,
            };
            let estimated = self.inversion(evaluated, &part.to_string(), done, watch).await?;
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
            let first = self.diagnosis(&recording, 1, done, watch).await?;
            study.diagnoses.add_lap(&first);
            for lap in 2..=self.ring.plan().laps {
                done += 1;
                let diagnosis = self.diagnosis(&recording, lap, done, watch).await?;
                study.diagnoses.add_lap(&diagnosis);
            }
            done += 1;
            let evaluated = Evaluated {
                recording: &|| recording.clone(),
                name: "with-diagnosis".to_owned(),
                diagnosis: Some(&first),
            };
            let estimated = self.inversion(evaluated, "with the diagnosis", done, watch).await?;
            study.methods.push((Method::InversionWithDiagnosis, estimated));
        }
        Ok(study)
    }

    /// Writes page, tables and statements. Returns the path of the page.
    ///
    /// # Errors
    /// Returns [`FilesError`] if a file cannot be written.
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

    /// The parts to evaluate: all passes; with several laps or speeds, also each lap or speed.
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

    /// The recording, created if missing.
    fn recording(&self) -> Result<Recording, RingStudyError> {
        let folder = self.folder.join(RECORDING);
        if !folder.join("recording.json").exists() {
            compute(|| self.ring.record())?.write(&folder)?;
        }
        Ok(Recording::open(&folder)?)
    }

    /// Estimates of a part of the recording, evaluated if its file is missing. `shown` is its name for people.
    async fn inversion(
        &self,
        evaluated: Evaluated<'_>,
        shown: &str,
        done: u64,
        watch: &Watch<'_>,
    ) -> Result<Estimated, RingStudyError> {
        let Evaluated { recording, name, diagnosis } = evaluated;
        let folder = self.folder.join(EVALUATIONS).join(name);
        let path = folder.join(EVALUATION);
        if !path.exists() {
            let progress = |stage: &'static str, share: f64| {
                watch(done, &format!("{shown}: {stage} {:.0} %", 100.0 * share));
            };
            let track = Preset::VTrack.track();
            let inverted = invert(&recording(), &track, diagnosis, self.library, &progress).await;
            let inversion = inverted
                .map_err(|source| RingStudyError::Inversion { part: shown.to_owned(), source })?;
            let mut output = Output::begin(&folder, Kind::Results, self.force)?;
            inversion.add_to(&mut output, "evaluation")?;
            output.commit()?;
        }
        let text = read_text(&path)?;
        Estimated::read(&text).map_err(no_evaluation(&path))
    }

    /// Adds the estimates of models and model selector for the whole recording.
    fn by_models(
        &self,
        recording: &Recording,
        models: &Evaluator,
        study: &mut Study,
    ) -> Result<(), RingStudyError> {
        let folder = self.folder.join(EVALUATIONS).join(models_name(models.models()));
        let path = folder.join(EVALUATION);
        if !path.exists() {
            let design = models.design_for(recording);
            check_recording(recording, &design, &models.set().speeds_km_h)?;
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
}

/// Name of the folder of an evaluation with models. Models of other results, of another half of them, or of
/// features up to another frequency give other estimates.
fn models_name(trained: &Trained) -> String {
    let digest: String = trained.library_digest().chars().take(DIGEST_SHOWN).collect();
    let bins = trained.frequencies_hz().len();
    format!("models-{digest}-seed-{}-bins-{bins}", trained.split_seed())
}

/// Spectra of the rails at the highest speed.
fn spectra(recording: &Recording, study: &Study) -> Result<RailSpectra, RingStudyError> {
    let fastest = study.plan.speeds_km_h.iter().copied().fold(0.0, f64::max);
    let definition = FeatureDefinition::default();
    let extractor = Extractor::new(&definition)?;
    let found =
        features(&Part::Speed(fastest).of(recording), &extractor, &ModelSpeeds::only(&[fastest]))?;
    Ok(RailSpectra::new(&study.truth, fastest, definition.frequencies_hz(), &found))
}
