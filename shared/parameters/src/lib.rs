//! Every physical quantity once: its name, symbol, unit, nominal value and range.
//!
//! Owns the catalogue of parameters, the space a campaign samples, the points it samples and the
//! designs (V-Track, real scale) around them. What the quantities do is the track model's.
//!
//! Convention: **one rail, half sleepers**. Every stiffness, damping and mass is that of one rail
//! seat; nothing is doubled anywhere.

mod case;
mod catalogue;
mod design;
mod preset;
mod prior;
pub mod quantity;
mod random;
mod set;
mod sobol;
mod space;
mod track;

pub use case::Case;
pub use catalogue::Parameter;
pub use design::{BeamSection, SleeperDesign, TrackDesign, Wheel};
pub use preset::Preset;
pub use prior::Prior;
pub use quantity::{Quantity, QuantityError};
pub use random::unit;
pub use set::ParameterSet;
pub use sobol::{OWEN_POINTS_MAX, Sequence, SobolError};
pub use space::{Axis, ParameterSpace, Scale, SpaceError};
pub use track::{TRACK_FORMAT, Track, TrackError, toml_fault};
