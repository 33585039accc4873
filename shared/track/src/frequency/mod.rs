//! The track in the frequency domain: what a hammer test measures.
//!
//! Works on the matrices that the time domain runs on; draws nothing and names no resonance.

#![expect(
    clippy::inline_always,
    reason = "what solves must be compiled into each instruction set's own copy"
)]

mod lane;
mod peaks;
mod rail;
mod receptance;

pub use peaks::{Peak, peaks};
pub use rail::{RailReceptances, receptances_ahead, seat_stiffness, shares};
pub use receptance::{FrequencyError, Place, receptance};
