//! The worker under test: exactly `tracktwin-worker`.

use std::process::ExitCode;

fn main() -> ExitCode {
    tracktwin_worker::command::main()
}
