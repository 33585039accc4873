//! What the tests of the whole program share: starting it, stopping it, reading what it says.

mod made_up;
mod process;

pub use made_up::RAIL_ABSORBER;
pub use process::{Process, until};
pub use test_needs::free_port;

use std::process::{Command, Output};

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
