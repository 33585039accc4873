//! Simulator of recordings with known truth: passes over a track with hidden physics.
//!
//! This simulator is independent: it shares neither code nor discretisation with the track model. It
//! uses sine modes of the rail and Ritz modes of the sleepers instead of finite elements, time steps
//! that are exact for the modes instead of Newmark's method, and its own synthesis of the irregularity.
//! Method and tests: `docs/reference-simulator.md`.

mod assumptions;
mod chain;
mod contact;
mod error;
mod filter;
mod hidden;
mod nuisances;
mod pass;
mod pass_state;
mod port;
mod ports;
mod rail;
mod rail_state;
mod receptance;
mod record;
mod rest;
mod rough_rail;
mod scene;
mod seats;
mod sleeper;
mod surface;
mod system;
mod track;
mod typical;
mod typical_line;
mod vehicle;
mod vtrack;

pub use assumptions::{Assumptions, JointDip, SquatHollow, Void, Waves};
pub use error::TruthError;
pub use hidden::Hidden;
pub use nuisances::{Nuisances, Response, WheelOrder};
pub use pass::{Drive, Driven, drive};
pub use receptance::receptance;
pub use record::{record, simulate};
pub use scene::{Chain, PassPlan, RoughRail, Scene, SleeperTruth};
pub use surface::WheelAngle;
pub use vtrack::SPACING_M;
