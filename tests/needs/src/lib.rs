//! What tests need beyond the checkout, such as reference data, a server or a port.
//!
//! Where it is missing, a test skips and the run says so in one line, unless it is demanded.

mod snapshot;

pub use snapshot::assert_snapshot;

use std::collections::BTreeSet;
use std::io::Write;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// The one recording that `tests/reference` keeps whole.
const KEPT_WHOLE: &str = "dev-01";

/// The reference data of the checkout; its README says what is there and where it is from.
pub fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference")
}

/// Folders of a recording of a simulator that shares no code with this project: the passes of it
/// that are in the checkout, if any, and the whole of it, if it lies beside.
pub fn recordings(name: &str) -> Vec<PathBuf> {
    let kept = reference().join("recordings").join(name);
    if name == KEPT_WHOLE {
        return vec![kept];
    }
    let whole = shared_data().map(|folder| folder.join("recordings").join(name));
    kept.is_dir().then_some(kept).into_iter().chain(whole).collect()
}

/// The reference data that lies beside a checkout, if it is there.
///
/// # Panics
/// When it is missing although `TRACKTWIN_REQUIRE_SHARED` is set.
pub fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if folder.is_dir() {
        return Some(folder);
    }
    missing("TRACKTWIN_REQUIRE_SHARED", "tests on reference data; ../shared is not there");
    None
}

/// Says that tests skip what they need, for it is missing.
///
/// # Panics
/// When the environment has this variable: then it is demanded.
pub fn missing(demanded_by: &str, what: &'static str) {
    assert!(std::env::var_os(demanded_by).is_none(), "{demanded_by} is set, but skipped: {what}");
    skipped(what);
}

/// Says once what is skipped and why, past the harness, which keeps what passing tests print.
///
/// # Panics
/// Where a test has panicked here.
pub fn skipped(what: &'static str) {
    static SAID: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());
    if SAID.lock().expect("nobody panics while holding it").insert(what) {
        let _ = writeln!(std::io::stderr(), "skipped: {what}");
    }
}

/// A port that nobody listens on now.
///
/// # Panics
/// When the loopback interface has none.
pub fn free_port() -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has ports");
    listener.local_addr().expect("a bound socket has an address").port()
}
