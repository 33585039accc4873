//! Time domain: a wheel runs over the track; the result is the axle-box acceleration.
//!
//! [`pass`] is the reference solver, one case at a time. The crate `tracktwin-signal` evaluates the
//! accelerations.

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

/// Displacement in m of the contact point of the standing wheel on a smooth rail.
#[cfg(test)]
pub(crate) fn standing(model: &crate::model::TrackModel, pass: &Pass) -> f64 {
    equilibrium::Equilibrium::new(model, pass, &[0.0]).unwrap().contacts_m[0]
}
