//! What measurements share: the clock, repetition, the cases and signals that are measured.
//!
//! The clock counts CPU time of this process, all its threads together, so that neighbours on a
//! shared machine lengthen a figure little. Linux only.

mod cases;
mod clock;
mod features;
mod figure;
mod stand_in;

pub use cases::{Track, cases};
pub use clock::{Cost, by_the_clock, cost, cpu_of_threads, once};
pub use features::{axle_box, feature_vectors, library};
pub use figure::{Curve, figure};
pub use stand_in::{CAMPAIGN, Failure, fill, finish, lease, sqlite_library};
