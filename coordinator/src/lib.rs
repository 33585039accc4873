//! The command line of tracktwin.
//!
//! - [`commands`]: the subcommands: arguments, printing, exit codes.
//! - [`pipeline`]: computations that commands share: train, evaluate, diagnose, reproduce, blind trials.
//!
//! Everything else is in the crates beside `src`: `farm`, `library`, `twin`, `validation`,
//! `report`.

pub mod commands;
pub mod pipeline;
