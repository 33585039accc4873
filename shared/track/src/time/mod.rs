//! A wheel runs over the track: what its axle box feels.
//!
//! [`pass`] is the reference solver, one case at a time. What the accelerations mean is
//! `tracktwin-signal`'s.

mod cholesky;
mod equilibrium;
mod newmark;
mod run;

pub use newmark::pass;
pub use run::{Pass, PassError, PassRecord};
