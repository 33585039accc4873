//! A blind trial: truths sealed, recordings made, diagnosed, opened and scored, by as many nodes as
//! share a library.
//!
//! Owns the order of the steps and the files of the folder. The trial crate owns the hidden physics
//! and the scores; the library holds leases and answers, so an interrupted trial can be continued.

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

/// Result files: tables, one line per case, numbers.
const TABLES: &str = "trial.md";
const SCORES: &str = "scores.jsonl";
const SUMMARY: &str = "summary.json";

/// Interval of checking the cases of other machines.
const WAIT: Duration = Duration::from_secs(2);

/// Time limit of an unavailable library.
const PATIENCE: Duration = Duration::from_mins(10);

/// A trial, as one node takes part in it.
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command")]
pub struct Trial {
    /// Decides what is hidden.
    pub seed: u64,
    /// How many cases.
    pub cases: u32,
    /// Where this node keeps its files.
    pub folder: PathBuf,
    /// Where all nodes keep their answers.
    pub library: Library,
    /// Name of this machine.
    pub node: String,
    /// Whether single effects are diagnosed again without their kind.
    pub knock_out: bool,
    /// Whether local effects that were found are diagnosed again with shuffled sleepers.
    pub shuffle: bool,
    /// The models of the paper's pipeline, if it is to be asked too.
    pub paper: Option<Evaluator>,
    /// Whether recordings are removed once they are scored.
    pub discard_recordings: bool,
    /// Whether files that the program did not write are replaced.
    pub force: bool,
}

/// Identity of a folder's trial.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Terms {
    /// The first format did not state it.
    #[serde(default = "first_format")]
    format: u32,
    seed: u64,
    code_version: String,
}

const fn first_format() -> u32 {
    1
}

/// Why a trial ends before its time.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The folder holds another trial.
    #[error(
        "{folder}: contains a trial of seed {seed} by version {version}; use another --out, \
             or the same seed"
    )]
    Other {
        /// The folder.
        folder: String,
        /// Seed of the trial there.
        seed: u64,
        /// Version of the program that began it.
        version: String,
    },
    /// The folder holds a trial whose cases are others.
    #[error(
        "{folder}: contains a trial of format {format}, whose cases are others than those of this \
             program (format {}); use another --out, or the program that began it",
        FORMAT
    )]
    OtherFormat {
        /// The folder.
        folder: String,
        /// Format of the trial there.
        format: u32,
    },
    /// The library fails, or refuses.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// A truth was changed.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// A recording cannot be made.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Diagnoses broke down, each with its reason by the number of its case; all others are answered.
    #[error(
        "{} of {of} diagnoses failed; all others are scored; repeat the command to try these again\n{}",
        .cases.len(),
        .cases.iter().map(|(number, reason)| format!("case {number}: {reason}")).collect::<Vec<_>>().join("\n")
    )]
    BrokenDown {
        /// The cases.
        cases: BTreeMap<u32, String>,
        /// Of how many.
        of: u32,
    },
    /// A diagnosis broke down.
    #[error("case {number}: {source}")]
    Diagnosis {
        /// Number of the case.
        number: u32,
        /// Why.
        source: DiagnosingError,
    },
    /// A recording has no track to compare with.
    #[error("case {number}: the recording has no track to compare with")]
    NoTrack {
        /// Number of the case.
        number: u32,
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
    /// A file cannot be written, or exists already.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A file cannot be read.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
}

impl TrialError {
    /// Whether the same may succeed later, when the library answers again.
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

    /// Makes the folder, or makes sure that it holds this trial; seals all truths, here and in the
    /// library, before anything is diagnosed. Gives the digest of all seals.
    ///
    /// # Errors
    /// [`TrialError::Other`] when the folder holds another trial, [`TrialError::Seal`] when seals
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

    /// How many cases have all their answers.
    ///
    /// # Errors
    /// [`TrialError`] when the library cannot be read.
    pub async fn answered(&self) -> Result<u64, TrialError> {
        let scores = self.scores().await?;
        Ok(u64::from(self.cases) - self.open(&scores).len() as u64)
    }

    /// Works on the cases that lack an answer and that no other node works on, until none lacks one;
    /// then sums up. A library that does not answer is waited for; a case whose diagnosis breaks down
    /// is left, and counts as such.
    ///
    /// # Errors
    /// [`TrialError`] when a seal is broken; [`TrialError::BrokenDown`] at the end, after the
    /// summary.
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

    /// One case, or a look at what the others do; the summary once all is answered but for what has
    /// broken down here.
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

    /// The cases that lack an answer.
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

    /// Makes sure that the folder's trial is this one.
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

    /// Writes the seals down, or makes sure that they are those that were; gives their digest.
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

/// Content of a file, if it exists. An unreadable file is an error, not a missing file.
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
