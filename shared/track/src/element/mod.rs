//! Single elements: their matrices and shape functions; where they stand is the model's.

mod beam;
mod spring_damper;

pub use beam::{BeamElement, ElementMatrix};
pub use spring_damper::SpringDamper;
