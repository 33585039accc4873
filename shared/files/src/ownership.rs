//! Ownership of files. A hidden list in each folder contains the files that the program wrote, with
//! their hashes. The hashes distinguish these files from files added or changed by others.

use crate::FilesError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Formatter};
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

/// File name of the list.
pub(crate) const LIST: &str = ".tracktwin.json";
const FORMAT: &str = "tracktwin-files/1";

/// Kind of output that a file belongs to. A file replaces only files of its own kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A recording of `simulate`, or the sample of `run`.
    SimulatedRecording,
    /// A recording of `import`. It is measured and therefore never replaced.
    MeasuredRecording,
    /// Models of `train`.
    Models,
    /// Results and pages of `evaluate`, `diagnose`, `inspect`, `reproduce` and `run`.
    Results,
    /// Tables of `trial`.
    Trial,
    /// Tables of `library export`.
    Export,
    /// A campaign of `extend`.
    Campaign,
    /// Certificates of `certs`.
    Certificates,
    /// Curves of `receptance`.
    Curves,
    /// A track description of `new`, which the user edits.
    Description,
    /// Pages of `manual`.
    Manual,
}

impl Kind {
    /// Whether the program replaces its own files of this kind.
    const fn is_replaced(self) -> bool {
        !matches!(self, Self::MeasuredRecording | Self::Description)
    }
}

impl Display for Kind {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::SimulatedRecording => "a simulated recording",
            Self::MeasuredRecording => "an imported recording",
            Self::Models => "models",
            Self::Results => "results",
            Self::Trial => "a trial",
            Self::Export => "tables of a library",
            Self::Campaign => "a campaign",
            Self::Certificates => "certificates",
            Self::Curves => "receptances",
            Self::Description => "a description of a track",
            Self::Manual => "manual pages",
        })
    }
}

/// A file of the list: what it belongs to, and the BLAKE3 of each content that it may have.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Entry {
    pub(crate) kind: Kind,
    pub(crate) blake3: BTreeSet<String>,
}

/// The files of a folder that the program made.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct List {
    format: String,
    about: String,
    pub(crate) files: BTreeMap<String, Entry>,
}

impl Default for List {
    fn default() -> Self {
        let about =
            "files in this folder that tracktwin wrote and may replace; it replaces no others";
        Self { format: FORMAT.to_owned(), about: about.to_owned(), files: BTreeMap::new() }
    }
}

impl List {
    /// The list of a folder; empty where there is none that the program can read.
    pub(crate) fn of(folder: &Path) -> Self {
        let text = std::fs::read(folder.join(LIST)).unwrap_or_default();
        serde_json::from_slice(&text)
            .ok()
            .filter(|it: &Self| it.format == FORMAT)
            .unwrap_or_default()
    }

    pub(crate) fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("names and hashes are JSON");
        text.push('\n');
        text
    }

    /// Whether a file's content is one that the program gave it, and may replace with one of `kind`.
    pub(crate) fn allows(&self, name: &str, kind: Kind, path: &Path) -> Result<(), FilesError> {
        let foreign = || FilesError::Foreign { path: path.to_owned() };
        let entry = self.files.get(name).ok_or_else(foreign)?;
        if !entry.blake3.contains(&hash(path)?) {
            return Err(foreign());
        }
        if entry.kind == kind && kind.is_replaced() {
            return Ok(());
        }
        Err(FilesError::OtherKind { path: path.to_owned(), kind: entry.kind })
    }
}

/// Checks, before a computation, that files with these names may be written to a folder. A file may be
/// written if it does not exist, if the program wrote it as the same kind, or with `force`.
///
/// # Errors
/// [`FilesError`] names the first file that may not be replaced.
pub fn check(folder: &Path, kind: Kind, force: bool, names: &[&str]) -> Result<(), FilesError> {
    let list = List::of(folder);
    for name in names {
        let path = folder.join(name);
        match std::fs::symlink_metadata(&path) {
            Ok(found) if found.is_dir() => return Err(FilesError::Folder { path }),
            Ok(_) if force => {}
            Ok(_) => list.allows(name, kind, &path)?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(source) => return Err(FilesError::system(&path, "written")(source)),
        }
    }
    Ok(())
}

/// Whether the program wrote this file and its content is unchanged.
pub fn is_own(folder: &Path, kind: Kind, name: &str) -> bool {
    let path = folder.join(name);
    path.exists() && List::of(folder).allows(name, kind, &path).is_ok()
}

/// BLAKE3 of a file's content, hexadecimal; of a link's own text, for it is the link that would be
/// replaced.
pub(crate) fn hash(path: &Path) -> Result<String, FilesError> {
    let read = || -> std::io::Result<blake3::Hash> {
        if path.symlink_metadata()?.is_symlink() {
            let target = std::fs::read_link(path)?;
            return Ok(blake3::derive_key(
                "tracktwin link 1",
                target.as_os_str().as_encoded_bytes(),
            )
            .into());
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(File::open(path)?)?;
        Ok(hasher.finalize())
    };
    let hash = read().map_err(FilesError::system(path, "read"))?;
    Ok(hash.to_hex().to_string())
}
