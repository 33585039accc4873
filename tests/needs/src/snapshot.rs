//! Texts that are kept beside the tests, so that a change of them is seen and meant.

use std::path::Path;

/// Set to write kept texts anew.
const WRITE: &str = "TRACKTWIN_WRITE_SNAPSHOTS";

/// Compares a text with the one that is kept under a name in `tests/snapshots`, or keeps it anew where
/// the environment has `TRACKTWIN_WRITE_SNAPSHOTS`.
///
/// # Panics
/// When they differ, at the first line that does.
pub fn assert_snapshot(name: &str, now: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../snapshots").join(name);
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, now).expect("the checkout takes files");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let mut lines = kept.lines().zip(now.lines()).zip(1..);
    let other = lines.find(|((kept, now), _)| kept != now);
    if let Some(((kept, now), number)) = other {
        panic!("{name}:{number}: was `{kept}`, is `{now}`; if that is meant, set {WRITE}=1");
    }
    assert_eq!(kept, now, "{name} has another end; if that is meant, set {WRITE}=1");
}
