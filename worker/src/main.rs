//! The program `tracktwin-worker`; see `command`.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin_worker::command::main()
}
