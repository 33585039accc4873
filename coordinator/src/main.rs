//! The program `tracktwin`; see `commands`.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin::commands::main()
}
