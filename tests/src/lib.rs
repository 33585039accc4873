//! What the tests of the whole program share: starting it, stopping it, reading what it says.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

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
    eprintln!("skipped: ../shared is not there");
    None
}

/// What a finished program said.
pub struct Answer {
    /// Its exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// Its standard output.
    pub out: String,
    /// Its standard error.
    pub err: String,
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
