//! Comparison of texts with files stored beside the tests.

use std::fs;
use std::path::Path;

/// Environment variable that makes the tests write the files again.
const WRITE: &str = "TRACKTWIN_WRITE_GOLDEN";

fn file(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/library/snapshots").join(name)
}

/// The stored text with this name; empty if there is none.
pub(crate) fn kept(name: &str) -> String {
    fs::read_to_string(file(name)).unwrap_or_default()
}

/// Compares a text with the stored text of this name.
pub(crate) fn assert_kept(name: &str, text: &str) {
    if std::env::var_os(WRITE).is_some() {
        fs::write(file(name), text).unwrap();
    }
    let kept = kept(name);
    let differing = kept.lines().zip(text.lines()).find(|(kept, now)| kept != now);
    assert!(
        kept == text,
        "{name} was kept otherwise, from {differing:?}; {WRITE}=1 writes it anew"
    );
}
