//! `tracktwin hammer`: stiffness under every sleeper from a hammer test.

mod evaluate;
mod simulate;

use super::Stop;
use clap::Subcommand;

/// What to do with a hammer test.
#[derive(Subcommand)]
pub(super) enum Action {
    /// Estimate railpad, ballast and sleeper bending stiffness from receptances.
    Evaluate(evaluate::Arguments),
    /// Simulate the receptances of a hammer test as a table.
    Simulate(simulate::Arguments),
}

pub(super) fn run(action: &Action) -> Result<(), Stop> {
    match action {
        Action::Evaluate(arguments) => evaluate::run(arguments),
        Action::Simulate(arguments) => simulate::run(arguments),
    }
}
