//! What the tests of the whole program share: starting it, stopping it, reading what it says.

mod process;

pub use process::{Process, free_port, until};

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;

/// The reference data that lies beside a checkout, if it is there.
///
/// Prints one line where it isn't, so that a skipped test says so.
///
/// # Panics
/// When the data is missing although `TRACKTWIN_REQUIRE_SHARED` is set.
pub fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(
        std::env::var_os("TRACKTWIN_REQUIRE_SHARED").is_none(),
        "{} is demanded and missing",
        folder.display()
    );
    skipped("tests on reference data; ../shared is not there");
    None
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

/// Of a campaign where what is tested is the farm: a coarse, short model.
pub const COARSE_MODEL: &str = "seed = 5\nspeeds_km_h = [13]\n\
     [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n";

/// What a finished program said.
pub struct Answer {
    /// Its exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// Its standard output.
    pub out: String,
    /// Its standard error.
    pub err: String,
}

impl Answer {
    /// What it wrote to standard output.
    ///
    /// # Panics
    /// When it failed.
    pub fn succeeded(self) -> String {
        assert_eq!(self.code, Some(0), "{}", self.err);
        self.out
    }
}

/// Runs the program at `program` with these arguments, to its end.
///
/// # Panics
/// When the program can't be started.
pub fn run(program: &str, arguments: &[&str]) -> Answer {
    let Output { status, stdout, stderr } =
        Command::new(program).args(arguments).output().expect("the program starts");
    Answer {
        code: status.code(),
        out: String::from_utf8_lossy(&stdout).into_owned(),
        err: String::from_utf8_lossy(&stderr).into_owned(),
    }
}
