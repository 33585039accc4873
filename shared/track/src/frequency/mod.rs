//! The track in the frequency domain: the receptances that a hammer test measures.
//!
//! This module uses the same matrices as the time domain. It does not plot receptances or identify
//! resonances.

#![expect(
    clippy::inline_always,
    reason = "what solves must be compiled into each instruction set's own copy"
)]

mod ahead;
mod banded;
mod by_state;
mod lane;
mod peaks;
mod piece;
mod rail;
mod receptance;
mod receptances;
mod states;
mod varied;
mod vectorized;

pub use ahead::{receptances_ahead, shares};
pub use by_state::StateReceptances;
pub use peaks::{Peak, peaks};
pub use rail::seat_stiffness;
pub use receptance::{FrequencyError, ReceptancePoint, receptance};
pub use receptances::{RailReceptances, SeatReceptances};
pub use varied::KnownRail;
pub use vectorized::vectorized;
