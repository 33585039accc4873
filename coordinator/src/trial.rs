//! A blind trial in a folder: recordings made, truths sealed, diagnosed, opened and scored.
//!
//! Owns the order of things and the files; what is hidden and how answers are scored is the trial
//! crate's. Every step leaves a file, so that an interrupted trial goes on.

use crate::diagnosing::{self, Compared, Diagnosed, DiagnosingError, Setting};
use crate::evaluating::Evaluator;
use anyhow::Context;
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::{CalibrationError, Diagnosis, Verdict};
use tracktwin_library::Library;
use tracktwin_parameters::{Preset, TrackDesign};
use tracktwin_signal::recording::{Recording, RecordingError};
use tracktwin_trial::{
    KnockedOut, Paper, Plan, Score, SealError, Seals, Summary, detectability, score,
};
use tracktwin_truth::TruthError;
use tracktwin_worker::CODE_VERSION;

/// File of the seals.
const SEALS: &str = "seals.sha256";

/// A trial and its folder.
#[derive(Debug)]
pub struct Trial {
    /// Decides what is hidden.
    pub seed: u64,
    /// How many cases.
    pub cases: u32,
    /// Where everything is kept.
    pub folder: PathBuf,
    /// Whether single effects are diagnosed again without their kind.
    pub knock_out: bool,
    /// Whether local effects that were found are diagnosed again with shuffled sleepers.
    pub shuffle: bool,
    /// The models of the paper's pipeline, if it is to be asked too.
    pub paper: Option<Evaluator>,
    /// Whether recordings are removed once they are scored.
    pub discard_recordings: bool,
}

/// What a folder's trial is.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Terms {
    seed: u64,
    code_version: String,
}

/// Why a trial ends before its time.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The folder holds another trial.
    #[error(
        "{folder}: holds a trial of seed {seed} by version {version}; take another folder with --out, or the same seed"
    )]
    Other {
        /// The folder.
        folder: String,
        /// Seed of the trial there.
        seed: u64,
        /// Version of the program that began it.
        version: String,
    },
    /// A truth was changed.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// A recording cannot be made.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A diagnosis broke down.
    #[error("case {number}: {source}")]
    Diagnosis {
        /// Number of the case.
        number: u32,
        /// Why.
        source: DiagnosingError,
    },
    /// The paper's pipeline can't be asked.
    #[error("case {number}: {source}")]
    Paper {
        /// Number of the case.
        number: u32,
        /// Why.
        source: tracktwin_evaluation::Error,
    },
    /// The truth makes no track.
    #[error(transparent)]
    Model(#[from] CalibrationError),
    /// A file is not what it was.
    #[error("{path}: {source}")]
    Json {
        /// The file.
        path: String,
        /// Why.
        source: serde_json::Error,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
}

impl Trial {
    /// Makes the folder, or makes sure that it holds this trial.
    ///
    /// # Errors
    /// [`TrialError::Other`] when it holds another one.
    pub fn begin(&self) -> Result<(), TrialError> {
        let parts = ["recordings", "sealed", "diagnoses", "scores"];
        for part in parts {
            let path = self.folder.join(part);
            std::fs::create_dir_all(&path).map_err(|source| file(&path, source))?;
        }
        let path = self.folder.join("trial.json");
        let terms = Terms { seed: self.seed, code_version: CODE_VERSION.to_owned() };
        match Self::read::<Terms>(&path)? {
            Some(known) if known == terms => Ok(()),
            Some(known) => Err(TrialError::Other {
                folder: self.folder.display().to_string(),
                seed: known.seed,
                version: known.code_version,
            }),
            None => write(&path, &terms),
        }
    }

    /// Makes the recordings and seals their truths; gives the digest of all seals.
    ///
    /// # Errors
    /// [`TrialError`] when a recording cannot be made or the seals were changed.
    pub fn hide(&self, progress: impl FnMut(u64, &str)) -> Result<String, TrialError> {
        let mut progress = progress;
        let path = self.folder.join(SEALS);
        let mut seals = Seals::default();
        for number in 0..self.cases {
            let plan = tracktwin_trial::plan(self.seed, number);
            let truth = self.folder.join(sealed(number));
            let content = text(&plan.scene);
            seals.seal(&sealed(number), content.as_bytes());
            if !truth.exists() {
                tracktwin_truth::record(&plan.scene, &self.recording(number))?;
                std::fs::write(&truth, content).map_err(|source| file(&truth, source))?;
            }
            progress(u64::from(number) + 1, "");
        }
        if let Ok(known) = std::fs::read_to_string(&path) {
            let known = Seals::from_text(&known)?;
            // A longer trial of the same seed has more seals, but none other.
            for number in 0..self.cases.min(known.count()) {
                let name = sealed(number);
                known.open(
                    &name,
                    text(&tracktwin_trial::plan(self.seed, number).scene).as_bytes(),
                )?;
            }
            if known.count() > self.cases {
                return Ok(known.digest());
            }
        }
        std::fs::write(&path, seals.to_text()).map_err(|source| file(&path, source))?;
        Ok(seals.digest())
    }

    /// How many cases have a score.
    pub fn scored(&self) -> u64 {
        (0..self.cases).filter(|number| self.score_path(*number).exists()).count() as u64
    }

    /// Diagnoses what has no score yet, opens its seal and scores it; then sums up.
    ///
    /// # Errors
    /// [`TrialError`] when a seal is broken or a diagnosis breaks down.
    pub async fn answer(
        &self,
        library: &Library,
        progress: impl FnMut(u64, &str),
    ) -> Result<Summary, TrialError> {
        let mut progress = progress;
        let design = Preset::VTrack.design();
        let mut scores = Vec::new();
        for number in 0..self.cases {
            let score = match Self::read::<Score>(&self.score_path(number))? {
                Some(score) => score,
                None => self.case(number, &design, library).await?,
            };
            let score = self.controlled(score, &design, library).await?;
            self.discard(number)?;
            let said = if score.is_right() { "right" } else { "not as it should be" };
            progress(u64::from(number) + 1, &format!("case {number}: {said}"));
            scores.push(score);
        }
        let summary = Summary::new(&scores);
        write(&self.folder.join("summary.json"), &summary)?;
        let page = self.folder.join("trial.md");
        let tables = format!(
            "Trial of seed {}, {} cases, version {CODE_VERSION}.\n\n{}",
            self.seed,
            self.cases,
            summary.to_markdown(&scores)
        );
        std::fs::write(&page, tables).map_err(|source| file(&page, source))?;
        Ok(summary)
    }

    /// A score with the controls that are wanted and not made yet.
    async fn controlled(
        &self,
        mut score: Score,
        design: &TrackDesign,
        library: &Library,
    ) -> Result<Score, TrialError> {
        let knock_out = self.knock_out && score.can_be_knocked_out() && score.knocked_out.is_none();
        let shuffle = self.shuffle && score.can_be_shuffled() && score.shuffled.is_none();
        let paper = self.paper.as_ref().filter(|_| score.paper.is_none());
        if !knock_out && !shuffle && paper.is_none() {
            return Ok(score);
        }
        let plan = self.opened(score.number)?;
        let recording = self.again(&plan)?;
        let setting = Setting { design, library: Some(library), without: &[], shuffle: None };
        if let Some(evaluator) = paper {
            let evaluation = evaluator
                .evaluate(&recording)
                .map_err(|source| TrialError::Paper { number: score.number, source })?;
            score.paper = Paper::of(&plan.scene, &evaluation);
        }
        if knock_out {
            score.knocked_out = Some(self.knocked_out(&plan, &recording, setting).await?);
        }
        if shuffle {
            let setting = Setting { shuffle: Some(self.seed), ..setting };
            let (diagnosis, _) = self.diagnose(score.number, &recording, setting).await?;
            write(
                &self.folder.join(format!("diagnoses/{:04}-shuffled.json", score.number)),
                &diagnosis,
            )?;
            score.shuffled = Some(diagnosis.verdict);
        }
        write(&self.score_path(score.number), &score)?;
        Ok(score)
    }

    /// A case's recording, made once more if it was discarded.
    fn again(&self, plan: &Plan) -> Result<Recording, TrialError> {
        let folder = self.recording(plan.number);
        if !folder.exists() {
            tracktwin_truth::record(&plan.scene, &folder)?;
        }
        Ok(Recording::open(folder)?)
    }

    fn discard(&self, number: u32) -> Result<(), TrialError> {
        let folder = self.recording(number);
        if !self.discard_recordings || !folder.exists() {
            return Ok(());
        }
        std::fs::remove_dir_all(&folder).map_err(|source| file(&folder, source))
    }

    /// One case: diagnosed, written down, opened, scored.
    async fn case(
        &self,
        number: u32,
        design: &TrackDesign,
        library: &Library,
    ) -> Result<Score, TrialError> {
        let recording = Recording::open(self.recording(number))?;
        let before = cpu_s();
        let setting = Setting { design, library: Some(library), without: &[], shuffle: None };
        let (diagnosis, Compared { subject, search }) =
            self.diagnose(number, &recording, setting).await?;
        let cpu_s = cpu_s() - before;
        let path = self.folder.join(format!("diagnoses/{number:04}.json"));
        write(&path, &diagnosis)?;
        let plan = self.opened(number)?;
        let lengths: Vec<Option<f64>> = plan
            .scene
            .left_out
            .iter()
            .map(|hidden| detectability(&recording, &subject, &search, &plan.scene, hidden))
            .collect::<Result<_, _>>()?;
        let score = score(&plan, &diagnosis, &lengths, cpu_s);
        write(&self.score_path(number), &score)?;
        Ok(score)
    }

    async fn diagnose(
        &self,
        number: u32,
        recording: &Recording,
        setting: Setting<'_>,
    ) -> Result<(Diagnosis, Compared), TrialError> {
        let diagnosed = diagnosing::diagnose(recording, setting, &|_, _| ()).await;
        let compared = diagnosed.and_then(|Diagnosed { diagnosis, compared }| {
            let compared = compared.context("the recording has no track to compare with")?;
            Ok((diagnosis, compared))
        });
        compared.map_err(|source| TrialError::Diagnosis { number, source })
    }

    /// The same recording without the hidden effect's kind in the catalogue.
    async fn knocked_out(
        &self,
        plan: &Plan,
        recording: &Recording,
        setting: Setting<'_>,
    ) -> Result<KnockedOut, TrialError> {
        let without: Vec<String> =
            plan.scene.left_out.iter().map(|hidden| hidden.physics().to_owned()).collect();
        let setting = Setting { without: &without, ..setting };
        let (diagnosis, _) = self.diagnose(plan.number, recording, setting).await?;
        let path = self.folder.join(format!("diagnoses/{:04}-knocked-out.json", plan.number));
        write(&path, &diagnosis)?;
        let unknown = diagnosis.verdict == Verdict::UnknownPhysics;
        let place = tracktwin_trial::placed(&plan.scene, &diagnosis);
        Ok(KnockedOut { verdict: diagnosis.verdict, unknown, place })
    }

    /// The truth, its seal unbroken.
    fn opened(&self, number: u32) -> Result<Plan, TrialError> {
        let path = self.folder.join(sealed(number));
        let content = std::fs::read(&path).map_err(|source| file(&path, source))?;
        let path = self.folder.join(SEALS);
        let seals = std::fs::read_to_string(&path).map_err(|source| file(&path, source))?;
        Seals::from_text(&seals)?.open(&sealed(number), &content)?;
        Ok(tracktwin_trial::plan(self.seed, number))
    }

    fn recording(&self, number: u32) -> PathBuf {
        self.folder.join(format!("recordings/{number:04}"))
    }

    fn score_path(&self, number: u32) -> PathBuf {
        self.folder.join(format!("scores/{number:04}.json"))
    }

    /// A JSON file that may be there.
    fn read<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, TrialError> {
        let Ok(content) = std::fs::read(path) else { return Ok(None) };
        let parsed = serde_json::from_slice(&content);
        parsed
            .map(Some)
            .map_err(|source| TrialError::Json { path: path.display().to_string(), source })
    }
}

fn sealed(number: u32) -> String {
    format!("sealed/{number:04}.json")
}

fn text(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("plain data is plain JSON");
    text.push('\n');
    text
}

fn write(path: &Path, value: &impl Serialize) -> Result<(), TrialError> {
    std::fs::write(path, text(value)).map_err(|source| file(path, source))
}

fn file(path: &Path, source: std::io::Error) -> TrialError {
    TrialError::File { path: path.display().to_string(), source }
}

/// CPU time of this process so far in s.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
