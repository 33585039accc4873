//! Hashes everything that decides what a parameter set becomes.
//!
//! A worker whose hash is not the coordinator's is refused: its results might differ. Sources and
//! locked dependencies are hashed rather than a number that somebody must remember to raise.

use std::error::Error;
use std::path::{Path, PathBuf};

/// The physics, as seen from this crate.
const SOURCES: [&str; 6] = [
    "../Cargo.lock",
    "../shared/parameters/src",
    "../shared/signal/src",
    "../shared/track/src",
    "src/experiment.rs",
    "src/simulate.rs",
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files)?;
    }
    files.sort();
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin physics 1");
    for file in files {
        hasher.update(file.to_string_lossy().as_bytes()).update(&std::fs::read(&file)?);
    }
    let hash = hasher.finalize().to_hex();
    println!("cargo::rustc-env=TRACKTWIN_MODEL_HASH={}", &hash[..32]);
    Ok(())
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if path.is_dir() {
        for entry in std::fs::read_dir(path)? {
            collect(&entry?.path(), files)?;
        }
    } else {
        files.push(path.to_owned());
    }
    Ok(())
}
