//! The program `tracktwin` with one additional kind in its catalogue.

use std::process::ExitCode;
use system_tests::RAIL_ABSORBER;
use tracktwin_track::extension::Kind;

fn main() -> ExitCode {
    Kind::add(&RAIL_ABSORBER).expect("no other kind was added");
    tracktwin::commands::main()
}
