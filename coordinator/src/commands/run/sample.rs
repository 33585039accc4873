//! The recording that comes with the program, for those who have none at hand.
//!
//! Made by `tracktwin simulate`; how, and what is hidden in it, stands beside it in
//! `coordinator/sample/README.md`.

use super::super::Stop;
use anyhow::Context;
use std::path::Path;
use tracktwin_signal::recording::Recording;

/// The files of the sample's folder.
const FILES: [(&str, &[u8]); 4] = [
    ("recording.json", include_bytes!("../../../sample/recording.json")),
    ("pass-07kmh-1.parquet", include_bytes!("../../../sample/pass-07kmh-1.parquet")),
    ("pass-10kmh-1.parquet", include_bytes!("../../../sample/pass-10kmh-1.parquet")),
    ("pass-13kmh-1.parquet", include_bytes!("../../../sample/pass-13kmh-1.parquet")),
];

/// Writes the sample to `folder`, so that a user can look at it, and opens it.
pub(super) fn open(folder: &Path) -> Result<Recording, Stop> {
    let unwritable = || format!("{}: the sample cannot be written", folder.display());
    std::fs::create_dir_all(folder).with_context(unwritable)?;
    for (name, bytes) in FILES {
        std::fs::write(folder.join(name), bytes).with_context(unwritable)?;
    }
    Ok(Recording::open(folder)?)
}
