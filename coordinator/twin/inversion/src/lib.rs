//! Evaluation by inversion: fits the track model to a recording, with a posterior for every sleeper.
//!
//! The fit uses all passes and speeds together. The frequency-domain model predicts the mean log power of
//! every sleeper and band. Each sleeper has its own unknowns: ballast stiffness, railpad stiffness and
//! irregularity level. All sleepers share the other unknowns: bending stiffness, damping, spectrum of the
//! surface, gains. The variation of the stiffness between sleepers is estimated from the recording itself.
//! The posterior is Gaussian in the logarithms (Laplace's approximation).
//!
//! This crate contains the estimation of the variation along the track and the record of the result. The
//! forward model and the fit belong to the crate `tracktwin-diagnosis`.
//!
//! # Example: stiffness of a track from a recording
//!
//! The bundled sample is simulated. Its ballast stiffness is 14 MN/m, and 8 MN/m from SN13 to SN20.
//!
//! ```
//! use std::path::Path;
//! use tracktwin_diagnosis::{NullModel, Own, first_calibration};
//! use tracktwin_inversion::{fit, sections};
//! use tracktwin_signal::recording::Recording;
//!
//! let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sample");
//! let recording = Recording::open(&folder)?;
//! let track = recording.stated_track().track;
//! let mut section = sections(&recording, &track)?.remove(0);
//! let start = first_calibration(&section, &[])?;
//! section.forward.allow_beyond(&start)?;
//! let grid = NullModel::grid_values(&section.forward, &start);
//! let null = NullModel::simulate(&section.forward, &grid, 8, 1, &|_| ())?;
//! let fitted = fit(&section, &null, &[], start)?;
//!
//! for (id, expected) in [("SN11", 14e6), ("SN15", 8e6)] {
//!     let number = recording.sleepers.iter().position(|sleeper| sleeper.id == id).unwrap();
//!     let compared = number - section.first_sleeper;
//!     let found = fitted.values[fitted.unknowns.at(Own::BallastStiffness, compared)].exp();
//!     assert!((found / expected - 1.0).abs() < 0.2, "{id}: {found} N/m");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod accepted;
mod along;
mod beside;
mod files;
mod fit;
mod record;
mod soft;
mod stored;

pub use accepted::{accepted, modelled};
pub use beside::{Beside, beside};
pub use fit::{Fitted, fit, sections};
pub use record::{
    Along, COMMON, Inversion, METHOD, PER_SLEEPER, Prior, Provenance, Sleeper, Unexplained,
};
