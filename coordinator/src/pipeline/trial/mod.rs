//! A blind trial, which all machines with access to one library can share. Truths are sealed; recordings
//! are simulated, diagnosed, unsealed and scored.
//!
//! This module defines the order of the steps and the files of the folder. The trial crate defines the
//! hidden physics and the scores. The library stores leases and answers, so that an interrupted trial can
//! be continued.

mod case;
mod folder;
mod lease;
mod scores;

pub use folder::check_folder;

use crate::pipeline::diagnose::DiagnosingError;
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::null_models::NullModelError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tracktwin_diagnosis::CalibrationError;
use tracktwin_experiment::{CODE_VERSION, MODEL_HASH};
use tracktwin_files::{FileName, FilesError, Kind, Output, replace};
use tracktwin_library::{Library, LibraryError, TrialRecord};
use tracktwin_reference_simulator::TruthError;
use tracktwin_signal::recording::RecordingError;
use tracktwin_trial::{CaseScore, FORMAT, Making, SealError, Seals, Summary, plan};

/// File that identifies the trial of the folder.
const TERMS: &str = "trial.json";

/// File of the seals.
const SEALS: &str = "seals.sha256";

/// Names of the result files: tables, one line per case, and numbers.
const TABLES: &str = "trial.md";
const SCORES: &str = "scores.jsonl";
const SUMMARY: &str = "summary.json";

/// Pause before the next check for open cases, if other machines hold all of them.
const WAIT: Duration = Duration::from_secs(2);

/// Maximum outage of the library; a longer one ends the trial.
const PATIENCE: Duration = Duration::from_mins(10);

/// A trial with the settings of this machine.
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command")]
pub struct Trial {
    /// Seed that determines the hidden extensions.
    pub seed: u64,
    /// Number of cases.
    pub cases: u32,
    /// Output folder of this machine.
    pub folder: PathBuf,
    /// Library shared by all machines of the trial.
    pub library: Library,
    /// Name of this machine.
    pub node: String,
    /// Whether cases with a single hidden extension are diagnosed again without its kind (knock-out).
    pub knock_out: bool,
    /// Whether cases with a local effect that was found are diagnosed again with shuffled sleepers.
    pub shuffle: bool,
    /// Models of the paper's method; `None` if this method is not scored.
    pub paper: Option<Evaluator>,
    /// Whether recordings are deleted after scoring.
    pub discard_recordings: bool,
    /// Whether files that the program did not write may be replaced.
    pub force: bool,
}

/// Identity of the trial in a folder.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Terms {
    /// Format of the cases; files of the first format do not contain this field.
    #[serde(default = "first_format")]
    format: u32,
    seed: u64,
    code_version: String,
}

const fn first_format() -> u32 {
    1
}

/// Errors that end a trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The folder contains another trial.
    #[error(
        "{folder}: contains a trial of seed {seed} by version {version}; use another --out, \
             or the same seed"
    )]
    Other {
        /// Path of the folder.
        folder: String,
        /// Seed of the existing trial.
        seed: u64,
        /// Version of the program that started the existing trial.
        version: String,
    },
    /// The folder contains a trial with cases of another format.
    #[error(
        "{folder}: contains a trial of format {format}, whose cases are others than those of this \
             program (format {}); use another --out, or the program that began it",
        FORMAT
    )]
    OtherFormat {
        /// Path of the folder.
        folder: String,
        /// Format of the existing trial.
        format: u32,
    },
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// A truth was changed after sealing.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// A recording cannot be simulated.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Some diagnoses failed. All other cases were answered and scored.
    #[error(
        "{} of {of} diagnoses failed; all others are scored; repeat the command to try these again\n{}",
        .cases.len(),
        .cases.iter().map(|(number, reason)| format!("case {number}: {reason}")).collect::<Vec<_>>().join("\n")
    )]
    BrokenDown {
        /// Reason of each failure, by number of the case.
        cases: BTreeMap<u32, String>,
        /// Number of cases of the trial.
        of: u32,
    },
    /// A diagnosis failed.
    #[error("case {number}: {source}")]
    Diagnosis {
        /// Number of the case.
        number: u32,
        /// Cause.
        source: DiagnosingError,
    },
    /// The recording was not compared with a track model.
    #[error("case {number}: the recording has no track to compare with")]
    NoTrack {
        /// Number of the case.
        number: u32,
    },
    /// The paper's method cannot evaluate the recording.
    #[error("case {number}: {source}")]
    Paper {
        /// Number of the case.
        number: u32,
        /// Cause.
        source: tracktwin_evaluation::Error,
    },
    /// The track model of a truth cannot be built.
    #[error(transparent)]
    Model(#[from] CalibrationError),
    /// A file has invalid content.
    #[error("{path}: {source}")]
    Json {
        /// Path of the file.
        path: String,
        /// Cause.
        source: serde_json::Error,
    },
    /// A file cannot be written, or exists already.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A file cannot be read.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Cause.
        source: std::io::Error,
    },
}

impl TrialError {
    /// Whether the same call may succeed later, when the library is available again.
    fn is_temporary(&self) -> bool {
        match self {
            Self::Library(error) => error.is_temporary(),
            Self::Diagnosis {
                source: DiagnosingError::NullModel(NullModelError::Library(error)),
                ..
            } => error.is_temporary(),
            _ => false,
        }
    }
}

impl Trial {
    /// Id of the trial in the library.
    pub fn id(&self) -> String {
        self.record(Vec::new()).id()
    }

    /// Creates the folder, or checks that it contains this trial. Seals all truths in the folder and in the
    /// library, before any diagnosis. Returns the digest of all seals.
    ///
    /// # Errors
    /// Returns [`TrialError::Other`] if the folder contains another trial, [`TrialError::Seal`] if seals
    /// were changed.
    pub async fn begin(&self) -> Result<String, TrialError> {
        self.make_folder()?;
        self.begin_folder()?;
        let mut seals = Seals::default();
        for number in 0..self.cases {
            let content = text(&plan(self.seed, number));
            seals.seal(&sealed(number), content.as_bytes());
            let truth = self.folder.join(sealed(number));
            if !truth.try_exists().map_err(|source| file(&truth, source))? {
                replace(&truth, content.as_bytes())?;
            }
        }
        let digests = seals.digests().map(str::to_owned).collect();
        self.library.seal_trial(self.record(digests)).await?;
        self.seal_folder(&seals)
    }

    /// Number of cases with all their answers.
    ///
    /// # Errors
    /// Returns [`TrialError`] if the library cannot be read.
    pub async fn answered(&self) -> Result<u64, TrialError> {
        let scores = self.scores().await?;
        Ok(u64::from(self.cases) - self.open(&scores).len() as u64)
    }

    /// Processes cases that lack an answer and that no other machine holds, until all cases are answered.
    /// Then computes the summary. Calls to an unavailable library are retried for a limited time. A case
    /// whose diagnosis fails is skipped on this machine.
    ///
    /// # Errors
    /// Returns [`TrialError`] if a seal is broken. Returns [`TrialError::BrokenDown`] at the end, after the
    /// summary was written, if diagnoses failed.
    pub async fn answer(&self, mut progress: impl FnMut(u64, &str)) -> Result<Summary, TrialError> {
        let mut failing_since: Option<Instant> = None;
        let mut broken = BTreeMap::new();
        loop {
            match self.step(&broken, &mut progress).await {
                Ok(Some(summary)) if broken.is_empty() => return Ok(summary),
                Ok(Some(_)) => {
                    return Err(TrialError::BrokenDown { cases: broken, of: self.cases });
                }
                Ok(None) => failing_since = None,
                Err(error) if error.is_temporary() => {
                    let since = failing_since.get_or_insert_with(Instant::now);
                    if since.elapsed() > PATIENCE {
                        return Err(error);
                    }
                    tracing::warn!("{error}; retrying");
                    tokio::time::sleep(WAIT).await;
                }
                Err(TrialError::Diagnosis { number, source }) => {
                    tracing::warn!("case {number}: {source}; the other cases continue");
                    broken.insert(number, source.to_string());
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Processes one case, or waits for other machines. Returns the summary when all cases are answered
    /// except those that failed on this machine.
    async fn step(
        &self,
        broken: &BTreeMap<u32, String>,
        progress: &mut impl FnMut(u64, &str),
    ) -> Result<Option<Summary>, TrialError> {
        let scores = self.scores().await?;
        let mut open = self.open(&scores);
        open.retain(|number| !broken.contains_key(number));
        if open.is_empty() {
            let scores: Vec<CaseScore> = scores.into_values().map(|case| case.score).collect();
            return self.sum_up(&scores).map(Some);
        }
        let (done, others) = (u64::from(self.cases) - open.len() as u64, open.len());
        if let Some(number) = self.lease(open).await? {
            progress(done, &format!("case {number}"));
            self.work_on(number).await?;
        } else {
            progress(done, &format!("waiting for other machines: {others}"));
            tokio::time::sleep(WAIT).await;
        }
        Ok(None)
    }

    /// Numbers of the cases that lack an answer.
    fn open(&self, scores: &scores::Scores) -> Vec<u32> {
        let lacks = |number: &u32| !self.unanswered(scores.get(number)).is_empty();
        (0..self.cases).filter(lacks).collect()
    }

    fn sum_up(&self, scores: &[CaseScore]) -> Result<Summary, TrialError> {
        let makings: Vec<Making> =
            (0..self.cases).map(|number| plan(self.seed, number).making).collect();
        let summary = Summary::new(&makings, scores);
        let line = |score| serde_json::to_string(score).expect("plain data is plain JSON") + "\n";
        let lines: String = scores.iter().map(line).collect();
        let tables = format!(
            "Trial of seed {}, {} cases, version {CODE_VERSION}.\n\n{}",
            self.seed,
            self.cases,
            summary.to_markdown(scores)
        );
        let mut output = Output::begin(&self.folder, Kind::Trial, self.force)?;
        let files = [(TABLES, tables), (SCORES, lines), (SUMMARY, text(&summary))];
        for (name, content) in files {
            output.add(&FileName::new(name)?, content.as_bytes())?;
        }
        output.commit()?;
        Ok(summary)
    }

    /// Checks that the folder contains this trial, or records its identity.
    fn begin_folder(&self) -> Result<(), TrialError> {
        let path = self.folder.join(TERMS);
        let code_version = CODE_VERSION.to_owned();
        let terms = Terms { format: FORMAT, seed: self.seed, code_version };
        let Some(content) = read_if_there(&path)? else { return write(&path, &terms) };
        let known: Terms = serde_json::from_slice(&content)
            .map_err(|source| TrialError::Json { path: path.display().to_string(), source })?;
        if known == terms {
            return Ok(());
        }
        let folder = self.folder.display().to_string();
        if known.format != FORMAT {
            return Err(TrialError::OtherFormat { folder, format: known.format });
        }
        Err(TrialError::Other { folder, seed: known.seed, version: known.code_version })
    }

    /// Writes the seals, or checks that they equal the existing ones. Returns their digest.
    fn seal_folder(&self, seals: &Seals) -> Result<String, TrialError> {
        let path = self.folder.join(SEALS);
        if let Some(known) = read_if_there(&path)? {
            let not_text = |error| std::io::Error::new(ErrorKind::InvalidData, error);
            let known = String::from_utf8(known).map_err(|error| file(&path, not_text(error)))?;
            let known = Seals::from_text(&known)?;
            // A longer trial of the same seed has more seals, but none other.
            seals.agree(&known)?;
            if known.count() > self.cases as usize {
                return Ok(known.digest());
            }
        }
        replace(&path, seals.to_text().as_bytes())?;
        Ok(seals.digest())
    }

    fn record(&self, seals: Vec<String>) -> TrialRecord {
        TrialRecord {
            seed: self.seed,
            code_version: CODE_VERSION.to_owned(),
            model_hash: MODEL_HASH.to_owned(),
            seals,
        }
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
    Ok(replace(path, text(value).as_bytes())?)
}

/// Content of a file; `None` if the file does not exist. An unreadable file is an error.
fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>, TrialError> {
    match std::fs::read(path) {
        Ok(content) => Ok(Some(content)),
        Err(source) if source.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(file(path, source)),
    }
}

fn file(path: &Path, source: std::io::Error) -> TrialError {
    TrialError::File { path: path.display().to_string(), source }
}
