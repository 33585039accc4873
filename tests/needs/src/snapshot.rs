//! Comparison of texts with stored files, so that a change of a text is visible in review.

use std::path::Path;

/// Environment variable that makes the tests write the files again.
const WRITE: &str = "TRACKTWIN_WRITE_SNAPSHOTS";

/// Compares a text with the stored text of this name in `tests/snapshots`. If `TRACKTWIN_WRITE_SNAPSHOTS`
/// is set, stores the text instead.
///
/// # Panics
/// Panics if the texts differ, with the first different line.
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
