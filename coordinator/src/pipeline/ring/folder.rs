//! The folder of a ring study: its files, and the identity of its ring.

use super::{RingStudy, RingStudyError};
use crate::pipeline::trial::Trial;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::Path;
use tracktwin_experiment::{CODE_VERSION, MODEL_HASH};
use tracktwin_files::{FilesError, Kind, check, read_text, replace};
use tracktwin_ring::Plan;

/// File that identifies the ring of the folder.
const TERMS: &str = "plan.json";
/// Folders of the recording, of evaluations and of diagnoses.
pub(super) const RECORDING: &str = "recording";
pub(super) const EVALUATIONS: &str = "evaluations";
pub(super) const DIAGNOSES: &str = "diagnoses";
/// Result files.
pub(super) const PAGE: &str = "report.html";
pub(super) const STATEMENTS: &str = "ring.json";
pub(super) const TABLE: &str = "ring.csv";
pub(super) const TRUTH: [&str; 2] = ["truth.json", "truth.csv"];

/// Identity of a folder's ring.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Terms {
    #[serde(flatten)]
    plan: Plan,
    code_version: String,
    /// Hash of the physics. Other physics gives other estimates.
    model_hash: String,
}

/// Checks that the study can be written to a folder.
///
/// # Errors
/// Returns [`FilesError`] with the first file that the program did not write.
pub fn check_folder(folder: &Path, force: bool) -> Result<(), FilesError> {
    let names = [PAGE, STATEMENTS, TABLE, TRUTH[0], TRUTH[1]];
    check(folder, Kind::Results, force, &names)?;
    if folder.join(TERMS).symlink_metadata().is_ok() { Ok(()) } else { check_parts(folder) }
}

/// Returns an error if the folder has parts of a ring without a plan. They would be used for this ring.
fn check_parts(folder: &Path) -> Result<(), FilesError> {
    let mut paths = [RECORDING, EVALUATIONS, DIAGNOSES].into_iter().map(|name| folder.join(name));
    match paths.find(|path| Trial::is_taken(path)) {
        Some(path) => Err(FilesError::Foreign { path }),
        None => Ok(()),
    }
}

impl RingStudy<'_> {
    /// Checks that the folder contains this ring, or records its identity in an empty folder.
    pub(super) fn begin(&self) -> Result<(), RingStudyError> {
        let path = self.folder.join(TERMS);
        let terms = Terms {
            plan: self.ring.plan().clone(),
            code_version: CODE_VERSION.to_owned(),
            model_hash: MODEL_HASH.to_owned(),
        };
        let Some(text) = if_there(&path)? else {
            check_parts(self.folder)?;
            let text = serde_json::to_string_pretty(&terms).expect("a plan is plain JSON");
            return Ok(replace(&path, text.as_bytes())?);
        };
        let known: Terms = serde_json::from_str(&text)
            .map_err(|source| RingStudyError::Terms { path: path.display().to_string(), source })?;
        if known == terms {
            return Ok(());
        }
        let Plan { seed, laps, speeds_km_h, stretch } = &known.plan;
        let (version, hash) = (&known.code_version, &known.model_hash);
        let known = format!(
            "seed {seed}, {laps} laps at {speeds_km_h:?} km/h, sleepers {stretch}, version {version}, \
             models {hash}"
        );
        Err(RingStudyError::Other { folder: self.folder.display().to_string(), known })
    }
}

/// Text of a file; `None` if the file does not exist.
fn if_there(path: &Path) -> Result<Option<String>, FilesError> {
    match path.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        _ => read_text(path).map(Some),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_without_a_plan_are_not_taken_for_the_rings() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join(RECORDING);
        std::fs::create_dir(&recording).unwrap();
        assert!(check_folder(folder.path(), false).is_ok());
        std::fs::write(recording.join("recording.json"), "{}").unwrap();
        for force in [false, true] {
            let refused = check_folder(folder.path(), force);
            assert!(matches!(refused, Err(FilesError::Foreign { path }) if path == recording));
        }
        std::fs::write(folder.path().join(TERMS), "{}").unwrap();
        assert!(check_folder(folder.path(), false).is_ok());
    }
}
