//! The program `tracktwin-worker`, unchanged, built for the tests of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin_worker::command::main()
}
