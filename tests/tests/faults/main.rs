//! The farm as processes that are killed, stopped and disconnected. In every test the digest equals that of
//! a run without faults, no case is lost and none is stored twice.
//!
//! The tests marked as ignored take minutes; `docs/farm-faults.md` describes how to run them, and their
//! results.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod clocks;
mod coordinators;
mod databases;
mod farm;
mod hosts;
mod locks;
mod networks;
mod proxy;
mod workers;
