//! A wheel runs over the track: what its axle box feels.
//!
//! [`pass`] is the reference solver, one case at a time. What the accelerations mean is
//! `tracktwin-signal`'s.

mod cholesky;
mod equilibrium;
mod lanes;
mod newmark;
mod run;

pub use lanes::passes;
pub use newmark::pass;
pub use run::{Pass, PassError, PassRecord};
