//! The hammer test: from receptances of the rail to the stiffness under every sleeper.
//!
//! Owns the files of a hammer test as text, the fit of the track model to receptances, and the
//! record that says the outcome. The receptances of a track are `tracktwin-track`'s; where files
//! lie and how results look is left to others.

mod beside;
mod files;
mod fit;
mod forward;
mod layout;
mod measured;
mod read;
mod record;
mod simulate;
mod unknowns;

pub use beside::{Beside, BesideError, Loaded, LoadedSleeper, beside};
pub use fit::{FitError, Fitted, fit};
pub use layout::{Layout, LayoutError, SLEEPERS_MAX};
pub use measured::{COHERENCE_MIN, PointReceptance, Selected, Selection, select};
pub use read::{Nodes, ReadError, ReadFault, read};
pub use record::{FORMAT, HammerRecord, Interval, NINETY_PER_CENT, Sleeper, SleeperFlag};
pub use simulate::{HammerTest, SimulateError, table, truth};
pub use unknowns::Quantity;
