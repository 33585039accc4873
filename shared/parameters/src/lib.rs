//! Definition of every physical quantity: name, symbol, unit, nominal value and range.
//!
//! This crate contains the catalogue of parameters, the parameter space of a campaign, its sampling
//! points, and the presets with their designs. The crate `tracktwin-track` contains the equations.
//!
//! Convention: **one rail, half sleepers**. Every stiffness, damping and mass refers to one rail seat,
//! without a factor of two.

mod case;
mod catalogue;
mod design;
mod design_number;
mod preset;
mod prior;
pub mod quantity;
mod random;
mod set;
mod sobol;
mod space;
mod track;
mod wavelengths;

pub use case::Case;
pub use catalogue::Parameter;
pub use design::{BeamSection, SleeperDesign, TrackDesign, Wheel};
pub use design_number::{DesignAxis, DesignAxisError, DesignNumber};
pub use preset::Preset;
pub use prior::Prior;
pub use quantity::{Quantity, QuantityError};
pub use random::unit;
pub use set::ParameterSet;
pub use sobol::{OWEN_POINTS_MAX, Sequence, SobolError};
pub use space::{Axis, ParameterSpace, Scale, SpaceError};
pub use track::{TRACK_FORMAT, Track, TrackError, toml_fault};
pub use wavelengths::{WavelengthsError, check_wavelengths};
