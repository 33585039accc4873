//! Resources that tests need in addition to the checkout, such as reference data, a server or a port.
//!
//! If a resource is missing, the test is skipped and prints one line, unless an environment variable
//! demands the resource.

mod snapshot;

pub use snapshot::assert_snapshot;

use std::collections::BTreeSet;
use std::io::Write;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Name of the only recording that `tests/reference` contains completely.
const KEPT_WHOLE: &str = "dev-01";

/// Folder of the reference data in the checkout. Its README describes content and origin.
pub fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference")
}

/// Folders of a recording by a simulator that shares no code with this project. They are the folder in the
/// checkout, which has some of the passes, and the complete one beside the checkout; each only if it
/// exists.
pub fn recordings(name: &str) -> Vec<PathBuf> {
    let kept = reference().join("recordings").join(name);
    if name == KEPT_WHOLE {
        return vec![kept];
    }
    let whole = shared_data().map(|folder| folder.join("recordings").join(name));
    kept.is_dir().then_some(kept).into_iter().chain(whole).collect()
}

/// Folder of the reference data beside the checkout; `None` if it does not exist.
///
/// # Panics
/// Panics if the folder is missing although `TRACKTWIN_REQUIRE_SHARED` is set.
pub fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if folder.is_dir() {
        return Some(folder);
    }
    missing("TRACKTWIN_REQUIRE_SHARED", "tests on reference data; ../shared is not there");
    None
}

/// Prints that tests are skipped because a resource is missing.
///
/// # Panics
/// Panics if the environment variable `demanded_by` is set.
pub fn missing(demanded_by: &str, what: &'static str) {
    assert!(std::env::var_os(demanded_by).is_none(), "{demanded_by} is set, but skipped: {what}");
    skipped(what);
}

/// Prints once what is skipped and why. It bypasses the test harness, which hides the output of passing
/// tests.
///
/// # Panics
/// Panics if another thread has panicked in this function.
pub fn skipped(what: &'static str) {
    static SAID: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());
    if SAID.lock().expect("nobody panics while holding it").insert(what) {
        let _ = writeln!(std::io::stderr(), "skipped: {what}");
    }
}

/// Returns a TCP port that is free at present.
///
/// # Panics
/// Panics if the loopback interface has no free port.
pub fn free_port() -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has ports");
    listener.local_addr().expect("a bound socket has an address").port()
}
