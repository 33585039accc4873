//! Common parts of the tests of the whole program: starting and stopping it, and reading its output.

mod made_up;
mod process;

pub use made_up::RAIL_ABSORBER;
pub use process::{Process, until};
pub use test_needs::free_port;

use std::path::Path;
use std::process::{Command, Output};

/// Part of a campaign file for tests of the farm: a coarse, short model.
pub const COARSE_MODEL: &str = "seed = 5\nspeeds_km_h = [13]\n\
     [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n";

/// Output of a program that has ended.
pub struct Answer {
    /// Exit code; `None` if a signal ended the program.
    pub code: Option<i32>,
    /// Text of standard output.
    pub out: String,
    /// Text of standard error.
    pub err: String,
}

impl Answer {
    /// Returns the text of standard output.
    ///
    /// # Panics
    /// Panics if the program did not succeed.
    pub fn succeeded(self) -> String {
        assert_eq!(self.code, Some(0), "{}", self.err);
        self.out
    }
}

/// Runs the program at the path `program` with these arguments, and waits for its end.
///
/// # Panics
/// Panics if the program cannot be started.
pub fn run(program: &str, arguments: &[&str]) -> Answer {
    let Output { status, stdout, stderr } =
        Command::new(program).args(arguments).output().expect("the program starts");
    Answer {
        code: status.code(),
        out: String::from_utf8_lossy(&stdout).into_owned(),
        err: String::from_utf8_lossy(&stderr).into_owned(),
    }
}

/// Simulates a recording with two passes at each of these speeds in km/h, on a track of `spans` spans with the
/// physics of this extension file (none if it is empty), and with a little noise, without which a second pass is a
/// copy. Returns the path of the recording.
///
/// # Panics
/// Panics if the extension file cannot be written or the simulation fails.
pub fn simulated(
    program: &str,
    recording: &Path,
    spans: &str,
    speeds: &[&str],
    extension: &str,
) -> String {
    let [file, out] =
        [recording.with_extension("toml"), recording.into()].map(|path| path.display().to_string());
    let mut arguments = vec!["simulate", "--passes", "2", "--noise", "0.01", "--seed", "3"];
    arguments.extend(["--spans", spans]);
    arguments.extend(speeds.iter().flat_map(|speed| ["--speed", speed]));
    arguments.extend(["--out", &out]);
    if !extension.is_empty() {
        std::fs::write(&file, extension).expect("the folder of the recording can be written");
        arguments.extend(["--extension", &file]);
    }
    run(program, &arguments).succeeded();
    out
}
