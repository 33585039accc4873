//! A blind trial, which all machines with access to one library can share. Truths are sealed; recordings
//! are simulated, diagnosed, unsealed and scored.
//!
//! This module defines the order of the steps and the files of the folder. The trial crate defines the
//! hidden physics and the scores. The library stores leases and answers, so that an interrupted trial can
//! be continued.

mod case;
mod error;
mod folder;
mod lease;
mod scores;

pub use error::TrialError;
pub use folder::check_folder;

use crate::pipeline::evaluate::Evaluator;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tracktwin_experiment::{CODE_VERSION, MODEL_HASH};
use tracktwin_files::{FileName, Kind, Output, replace};
use tracktwin_library::{Library, TrialRecord};
use tracktwin_parameters::Preset;
use tracktwin_trial::{CaseScore, FORMAT, Making, Plan, Seals, Summary, plan_on};

/// File that identifies the trial of the folder.
const TERMS: &str = "trial.json";

/// File of the seals.
const SEALS: &str = "seals.sha256";

/// Names of the result files: tables, one line per case, and numbers.
const TABLES: &str = "trial.md";
const SCORES: &str = "scores.jsonl";
const SUMMARY: &str = "summary.json";

/// What the page of a trial of a line says about its makings.
const ONE_SIMULATOR: &str =
    " All cases have the making `second`: no other simulator has this track.";

/// Pause before the next check for open cases, if other machines hold all of them.
const WAIT: Duration = Duration::from_secs(2);

/// Maximum outage of the library; a longer one ends the trial.
const PATIENCE: Duration = Duration::from_mins(10);

/// A trial with the settings of this machine.
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command")]
pub struct Trial {
    /// Track of all cases.
    pub preset: Preset,
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
    /// Track of the cases; not in files of trials of V-Track.
    #[serde(default, skip_serializing_if = "is_v_track")]
    preset: Preset,
    seed: u64,
    code_version: String,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_v_track(preset: &Preset) -> bool {
    *preset == Preset::VTrack
}

const fn first_format() -> u32 {
    1
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
            let content = text(&self.plan(number));
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
        let numbers: Vec<u32> = scores.keys().copied().collect();
        let scores: Vec<CaseScore> = scores.into_values().map(|case| case.score).collect();
        if open.is_empty() {
            return self.sum_up(&scores, &(0..self.cases).collect::<Vec<_>>()).map(Some);
        }
        let (done, others) = (u64::from(self.cases) - open.len() as u64, open.len());
        if let Some(number) = self.lease(open).await? {
            if !scores.is_empty() {
                self.sum_up(&scores, &numbers)?;
            }
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

    /// Writes the tables of these cases; one without a score is a failed diagnosis.
    fn sum_up(&self, scores: &[CaseScore], numbers: &[u32]) -> Result<Summary, TrialError> {
        let makings: Vec<Making> = numbers.iter().map(|&number| self.plan(number).making).collect();
        let summary = Summary::new(&makings, scores);
        let line = |score| serde_json::to_string(score).expect("plain data is plain JSON") + "\n";
        let lines: String = scores.iter().map(line).collect();
        let (track, remark) = match self.preset {
            Preset::VTrack => (String::new(), ""),
            line => (format!(" {},", line.name()), ONE_SIMULATOR),
        };
        let cases = if numbers.len() < self.cases as usize {
            format!("{} of {} cases so far", numbers.len(), self.cases)
        } else {
            format!("{} cases", self.cases)
        };
        let tables = format!(
            "Trial of{track} seed {}, {cases}, version {CODE_VERSION}.{remark}\n\n{}",
            self.seed,
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
        let preset = self.preset;
        let terms = Terms { format: FORMAT, preset, seed: self.seed, code_version };
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
        if known.preset != preset {
            return Err(TrialError::OtherPreset { folder, preset: known.preset });
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
        // Part of the id: machines with another track do not share the trial.
        let model_hash = match self.preset {
            Preset::VTrack => MODEL_HASH.to_owned(),
            line => format!("{MODEL_HASH} {}", line.name()),
        };
        let code_version = CODE_VERSION.to_owned();
        TrialRecord { seed: self.seed, code_version, model_hash, seals }
    }

    /// The plan of a case.
    fn plan(&self, number: u32) -> Plan {
        plan_on(self.preset, self.seed, number)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_v_track_are_those_of_earlier_programs_and_a_line_states_its_track() {
        let terms = |preset| Terms { format: 2, preset, seed: 1, code_version: "0.2.0".to_owned() };
        let written = |preset| serde_json::to_string(&terms(preset)).unwrap();
        let earlier = r#"{"format":2,"seed":1,"code_version":"0.2.0"}"#;
        assert_eq!(written(Preset::VTrack), earlier);
        let line = written(Preset::Concrete60E1);
        assert!(line.contains(r#""preset":"60E1-concrete""#), "{line}");
        let read: Terms = serde_json::from_str(&line).unwrap();
        assert_eq!(read, terms(Preset::Concrete60E1));
    }
}
