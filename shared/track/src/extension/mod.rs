//! Physics beyond the paper's model, joined to the track through ports.

use crate::model::Assembly;

/// A piece of physics that adds stiffness, damping, mass or degrees of freedom to the track.
pub trait Extension {
    /// Adds its terms to the track being assembled.
    fn assemble(&self, assembly: &mut Assembly);
}
