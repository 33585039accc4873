//! Any track: all degrees of freedom eliminated in one sparse factor.
//!
//! Cases on one pattern share the order of elimination; one forward elimination serves both the
//! past and the contact force.

mod elimination;
mod factor;
mod inertia;
mod motion;
mod runs;

use super::block::{Block, LANES};
use crate::model::TrackModel;
use crate::time::{Pass, PassError};
use elimination::Elimination;
use motion::{LaneState, Station};

/// What cases on one pattern have in common.
pub(super) struct Solver {
    elimination: Elimination,
    /// Where the wheel stands at the start and at the end of every step.
    stations: Vec<Station>,
}

impl Solver {
    pub(super) fn new(model: &TrackModel, pass: &Pass) -> Self {
        let elimination = Elimination::new(model.layout(), model.matrices());
        let station = |step| Station::new(model, pass, &elimination, pass.position_m(step));
        let stations = (0..=pass.steps()).map(station).collect();
        Self { elimination, stations }
    }

    /// Contact forces at the start and after every step, over surfaces of these heights in m.
    pub(super) fn run(
        &self,
        models: [&TrackModel; LANES],
        pass: &Pass,
        heights_m: &[Block],
    ) -> Result<Vec<Block>, PassError> {
        let motion =
            LaneState::start(&self.elimination, &self.stations[0], models, pass, heights_m[0])?;
        Ok(motion.run(&self.stations[1..], &heights_m[1..]))
    }
}
