//! The program `tracktwin`, unchanged, built for the tests of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin::commands::main()
}
