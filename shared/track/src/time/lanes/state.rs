//! State of one degree of freedom at the end of a time step, in all lanes.

use super::block::Block;

/// The two combinations of displacement `u`, velocity `v` and acceleration `a` that the next step
/// needs of a degree of freedom.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// `p = u + dt v + dt² a / 4`.
    pub(super) inertial: Block,
    /// `q = u + dt v / 2`.
    pub(super) viscous: Block,
}

impl State {
    pub(super) fn at_rest(displacement: Block) -> Self {
        Self { inertial: displacement, viscous: displacement }
    }

    /// Updates the state to a new displacement `u`: `q` becomes `2 u - q`, and `p` becomes twice the new
    /// `q` minus `p`.
    #[inline(always)]
    pub(super) fn advance(&mut self, displacement: Block) {
        let two = Block::splat(2.0);
        self.viscous = two.mul_sub(displacement, self.viscous);
        self.inertial = two.mul_sub(self.viscous, self.inertial);
    }

    #[inline(always)]
    pub(super) fn inertial(&self) -> Block {
        self.inertial
    }
}
