//! Common parts of the benchmarks: clock, repetition, and the measured cases and signals.
//!
//! The clock counts the CPU time of all threads of this process, so that other processes on a shared
//! machine have little influence. Linux only.

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
