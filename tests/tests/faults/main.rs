//! The farm as processes that are killed, stopped and cut off: in every case the digest is that of
//! an undisturbed run, no case is lost and none is stored twice.
//!
//! The tests marked as ignored take minutes; `docs/farm-faults.md` tells how to run them and what
//! they found.

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
