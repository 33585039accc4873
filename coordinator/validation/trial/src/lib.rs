//! Blind trials: recordings with hidden physics, diagnosed without the truth, then scored.
//!
//! This crate contains the plans of hidden effects ([`Plan`]), the seals ([`Seals`]) and the scores
//! ([`CaseScore`], [`Summary`]). Simulators that share no discretisation with the diagnosis make the
//! recordings ([`Making`]). The command `trial` diagnoses the recordings and writes files.

mod baseline;
mod class;
mod draw;
mod effect;
mod known;
mod line_effect;
mod making;
mod measures;
mod names;
mod paper;
mod place;
mod rate;
mod score;
mod seal;
mod site;
mod strength;
mod summary;
mod table;
#[cfg(test)]
mod testing;
mod varied;
mod visible;

pub use baseline::Bias;
pub use class::Class;
pub use draw::{FORMAT, Plan, orders, plan, plan_on};
pub use making::Making;
pub use paper::Paper;
pub use rate::Rate;
pub use score::{CaseScore, KnockedOut, Named, Placed, placed, score};
pub use seal::{SealError, Seals};
pub use strength::StrengthRow;
pub use summary::{KindRow, MeasureRow, Summary};
pub use visible::detectability;
