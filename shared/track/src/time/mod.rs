//! A wheel runs over the track: what its axle box feels.
//!
//! [`pass`] is the reference solver, one case at a time. What the accelerations mean is
//! `tracktwin-signal`'s.

mod cholesky;
mod coupled;
mod equilibrium;
mod kinematics;
mod lanes;
mod newmark;
mod passes;
mod rolling;
mod run;
mod statics;

pub use newmark::pass;
pub use passes::passes;
pub use run::{Pass, PassError, PassRecord};
pub(crate) use statics::StaticSolution;

/// Where the contact point of the standing wheel is on a smooth rail, in m.
#[cfg(test)]
pub(crate) fn standing(model: &crate::model::TrackModel, pass: &Pass) -> f64 {
    equilibrium::Equilibrium::new(model, pass, &[0.0]).unwrap().contacts_m[0]
}
