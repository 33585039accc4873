//! Finite-element model of wheel and track.
//!
//! Owns the elements, the assembled track, what may be added to it and how a wheel runs over it.
//! Signals and features made of the results are `tracktwin-signal`'s.
//!
//! Convention: one rail, half sleepers; displacement, load and irregularity positive **downwards**.

#[cfg(test)]
mod analytical;
pub mod element;
pub mod extension;
pub mod frequency;
pub mod model;
pub mod time;
