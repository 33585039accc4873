//! The library on real files.

mod histories;
mod opening;
mod queue;
mod results;
mod support;
