//! Single elements: matrices and shape functions. The model defines the positions of the elements.

mod beam;
mod spring_damper;

pub use beam::{BeamElement, ElementMatrix};
pub use spring_damper::SpringDamper;
