//! Physics beyond the paper's model, joined to the track through ports.
//!
//! Owns the trait and one file a kind; the ports come from [`Layout`](crate::model::Layout), and
//! what is added stands in the matrices that both solvers use.

mod sleeper_bolt;

pub use sleeper_bolt::SleeperBolt;

use crate::model::Assembly;

/// A piece of physics that adds stiffness, damping, mass or degrees of freedom to the track.
pub trait Extension {
    /// Adds its terms to the track being assembled.
    fn assemble(&self, assembly: &mut Assembly);
}
