//! The track as equations of motion: geometry, supports, contact, assembled matrices.
//!
//! The modules `time` and `frequency` solve the equations. An [`Extension`] adds physics beyond the
//! paper.
//!
//! [`Extension`]: crate::extension::Extension

mod assembly;
mod contact;
mod force_law;
mod irregularity;
mod layout;
mod matrices;
mod mesh;
mod support;
mod track;
mod vehicle;

pub use assembly::{Assembly, Port};
pub use contact::{ContactPatch, HertzContact};
pub use force_law::{ForceLaw, Law, Reaction};
pub use irregularity::{Roughness, Surface};
pub use layout::{Layout, RailPoint, SleeperLayout};
pub use matrices::Matrices;
pub use mesh::Mesh;
pub use support::Support;
pub use track::{ModelError, TrackModel};
pub use vehicle::{ContactOscillator, Vehicle};
