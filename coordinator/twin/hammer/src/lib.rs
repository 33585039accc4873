//! Hammer test: estimates of the stiffness under every sleeper from receptances of the rail.
//!
//! This crate reads and writes the text of hammer-test files, fits the track model to receptances, and
//! makes the record of the result. The crate `tracktwin-track` computes the receptances of a track. Other
//! crates choose paths of files and present results.

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
pub use record::{FORMAT, Gain, HammerRecord, Interval, Sleeper, SleeperFlag};
pub use simulate::{HammerTest, table, truth};
pub use unknowns::Quantity;
