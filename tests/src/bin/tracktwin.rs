//! The program as its users run it, built for the tests of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin::commands::main()
}
