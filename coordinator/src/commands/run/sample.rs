//! The recording that comes with the program, for those who have none at hand.
//!
//! Made by `tracktwin simulate`; how, and what is hidden in it, stands beside it in
//! `coordinator/sample/README.md`.

use super::super::Stop;
use super::super::files::{Force, check};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_signal::recording::Recording;

/// The files of the sample's folder.
const FILES: [(&str, &[u8]); 4] = [
    ("recording.json", include_bytes!("../../../sample/recording.json")),
    ("pass-07kmh-1.parquet", include_bytes!("../../../sample/pass-07kmh-1.parquet")),
    ("pass-10kmh-1.parquet", include_bytes!("../../../sample/pass-10kmh-1.parquet")),
    ("pass-13kmh-1.parquet", include_bytes!("../../../sample/pass-13kmh-1.parquet")),
];

/// Makes sure that the sample may be written.
pub(super) fn check_files(folder: &Path, force: Force) -> Result<(), FilesError> {
    check(folder, Kind::SimulatedRecording, force, &FILES.map(|(name, _)| name))
}

/// Writes the sample to `folder`, so that a user can look at it, and opens it.
pub(super) fn open(folder: &Path, force: Force) -> Result<Recording, Stop> {
    let mut output = Output::begin(folder, Kind::SimulatedRecording, force.force)?;
    let [manifest, passes @ ..] = FILES;
    for (name, bytes) in passes {
        output.add(&FileName::new(name)?, bytes)?;
    }
    output.add_manifest(&FileName::new(manifest.0)?, manifest.1)?;
    output.commit()?;
    Ok(Recording::open(folder)?)
}
