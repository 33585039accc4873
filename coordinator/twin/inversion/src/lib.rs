//! Evaluation by the physics: the track that explains a recording, sleeper by sleeper.
//!
//! All passes and speeds tell together. The frequency-domain model predicts the mean log powers of
//! every sleeper and band; the unknowns are each sleeper's ballast stiffness, railpad stiffness and
//! irregularity level, and what is common to all (bending stiffness, dampings, the surface's
//! spectrum, gains). How much sleepers differ is learned from the recording itself. The posterior is
//! Gaussian in the logarithms (Laplace's approximation).
//!
//! Owns what is learned of the variation along the track and the record of the outcome; the forward
//! model and the fit are the diagnosis's.

mod along;
mod beside;
mod files;
mod fit;
mod record;
mod variation;

pub use beside::{Beside, beside};
pub use fit::{Fitted, fit, sections};
pub use record::{
    Along, COMMON, Inversion, METHOD, PER_SLEEPER, Prior, Provenance, Sleeper, Unexplained,
};
