//! Wheels and their contact forces in all lanes.

use super::block::{Block, LANES};
use crate::model::{HertzContact, TrackModel};
use std::array;

/// As in the scalar solver ([`HertzContact::solve`]); fewer steps suffice, and a lane that is not
/// a number does not hold the others up for long.
const NEWTON_STEPS_MAX: usize = 20;
/// Change of the approach, relative to the overlap, at which a lane stands still.
const NEWTON_TOLERANCE: f64 = 1e-14;

/// The wheels of eight vehicles.
#[derive(Clone, Copy)]
pub(super) struct Wheels {
    /// Hertzian coefficients in N/m^1.5.
    coefficient: Block,
    /// Loads in N.
    pub(super) load_n: Block,
    /// Approaches in m under the loads.
    pub(super) approach_m: Block,
    /// Deflection of the wheel alone under a unit force in a step in m/N, `dt² / 4 m`.
    pub(super) compliance: Block,
}

impl Wheels {
    pub(super) fn new(models: &[&TrackModel; LANES], dt: f64) -> Self {
        let wheels = models.map(|model| &model.vehicle().wheel);
        let contacts = models.map(|model| HertzContact::new(model.design()));
        Self {
            coefficient: Block::from_fn(|lane| contacts[lane].coefficient),
            load_n: Block::from_fn(|lane| wheels[lane].load_n),
            approach_m: Block::from_fn(|lane| contacts[lane].approach(wheels[lane].load_n)),
            compliance: Block::from_fn(|lane| dt * dt / (4.0 * wheels[lane].mass_kg)),
        }
    }
}

/// Contact forces in N for overlaps in m and compliances in m/N: [`HertzContact::solve`], lane by
/// lane. A lane stops where it would stop alone. Not-a-number stays not-a-number.
#[inline(always)]
pub(super) fn forces(wheels: &Wheels, overlap: Block, compliance: Block) -> Block {
    let overlap = Block(overlap.0.map(|value| if value <= 0.0 { 0.0 } else { value }));
    let coefficient = wheels.coefficient;
    let compliance = compliance * coefficient;
    let (mut approach, mut moving) = (overlap, [true; LANES]);
    for _ in 0..NEWTON_STEPS_MAX {
        let stiffness = compliance * approach.sqrt();
        let residual = stiffness.mul_add(approach, approach - overlap);
        let slope = Block::splat(1.5).mul_add(stiffness, Block::splat(1.0));
        let change = Block::from_fn(|lane| residual.0[lane] / slope.0[lane]);
        approach = Block::from_fn(|lane| {
            let next = approach.0[lane] - change.0[lane];
            if moving[lane] { next } else { approach.0[lane] }
        });
        let far = |lane: usize| change.0[lane].abs() > NEWTON_TOLERANCE * overlap.0[lane];
        moving = array::from_fn(|lane| moving[lane] & far(lane));
        if moving == [false; LANES] {
            break;
        }
    }
    coefficient * approach * approach.sqrt()
}
