//! The command line of tracktwin.
//!
//! - [`commands`]: what `tracktwin` can be told to do: arguments, printing, exit codes.
//! - [`pipeline`]: what commands have in common: train, evaluate, diagnose, reproduce, blind trials.
//!
//! All else is crates beside `src`: `farm`, `library`, `twin`, `validation`, `report`.

pub mod commands;
pub mod pipeline;
