//! The sample recording bundled with the program.
//!
//! It was created with `tracktwin simulate`; `coordinator/sample/README.md` contains the command and the
//! hidden parameters.

use super::super::Stop;
use super::super::files::{Force, check};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_signal::recording::Recording;

/// The files of the sample.
const FILES: [(&str, &[u8]); 4] = [
    ("recording.json", include_bytes!("../../../sample/recording.json")),
    ("pass-07kmh-1.parquet", include_bytes!("../../../sample/pass-07kmh-1.parquet")),
    ("pass-10kmh-1.parquet", include_bytes!("../../../sample/pass-10kmh-1.parquet")),
    ("pass-13kmh-1.parquet", include_bytes!("../../../sample/pass-13kmh-1.parquet")),
];

/// Checks that the sample may be written.
pub(super) fn check_files(folder: &Path, force: Force) -> Result<(), FilesError> {
    check(folder, Kind::SimulatedRecording, force, &FILES.map(|(name, _)| name))
}

/// Writes the sample to `folder` and opens it.
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
