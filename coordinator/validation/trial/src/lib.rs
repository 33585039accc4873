//! Blind trials: recordings with hidden physics, diagnosed without the truth, then scored.
//!
//! Owns what is hidden ([`Plan`]), the seals ([`Seals`]) and the scores ([`CaseScore`], [`Summary`]).
//! The recordings come from a simulator that shares no discretisation with the diagnosis; diagnosing
//! and files belong to the command.

mod class;
mod draw;
mod effect;
mod known;
mod paper;
mod place;
mod rate;
mod score;
mod seal;
mod summary;
mod table;
mod visible;

pub use class::Class;
pub use draw::{Plan, orders, plan};
pub use paper::Paper;
pub use rate::Rate;
pub use score::{Bias, CaseScore, KnockedOut, Named, Placed, placed, score};
pub use seal::{SealError, Seals};
pub use summary::{KindRow, MeasureRow, Summary};
pub use visible::detectability;
