//! State of all substructures, in all lanes.

use super::rail::Node;
use super::substructure::{Hanging, SecondOrderSection};
use super::table::{Bits, Table};
use crate::time::lanes::block::{Block, LANES};
use std::array;

/// A [`SecondOrderSection`] a lane.
#[derive(Clone, Copy, Debug)]
struct Sections {
    keep: Block,
    pull: Block,
    velocity: Block,
    displacement: Block,
}

/// A substructure's place on the rail.
#[derive(Clone, Copy, Debug)]
struct Seat {
    node: usize,
    /// 0 for the node's deflection, 1 for its rotation.
    motion: usize,
    /// How many sections it has.
    sections: usize,
}

/// Substructures under the rail: coefficients, and the state of every section.
pub(super) struct Supports {
    seats: Vec<Seat>,
    /// The sections of every seat, one seat after the other.
    sections: Table<Vec<Sections>>,
    /// Velocity and displacement of the sections, seat after seat.
    states: Vec<[Block; 2]>,
}

impl Supports {
    /// Substructures at rest on a rail with these displacements. `place` returns the node of a degree of
    /// freedom of the rail, and its motion at this node (0 deflection, 1 rotation).
    pub(super) fn at_rest(
        hanging: [&Hanging; LANES],
        place: impl Fn(usize) -> (usize, usize),
        rail: &[Node],
    ) -> Self {
        let (mut seats, mut sections, mut states) = (Vec::new(), Vec::new(), Vec::new());
        for &rail_dof in hanging[0].keys() {
            let (node, motion) = place(rail_dof);
            let own = hanging.map(|hanging| &hanging[&rail_dof].sections);
            let own: Vec<_> =
                (0..own[0].len()).map(|index| Sections::new(|lane| own[lane][index])).collect();
            let deflection = rail[node][motion];
            states.extend(own.iter().map(|of| [Block::default(), deflection * of.pull.recip()]));
            seats.push(Seat { node, motion, sections: own.len() });
            sections.push(own);
        }
        Self { seats, sections: sections.into_iter().collect(), states }
    }

    /// Moves all sections on under a rail of these displacements; `pushed` gets what they push its
    /// nodes with in the next step.
    ///
    /// Sums in the loop keep the compiler from taking eight sections of one case at a time
    /// instead of eight cases.
    #[inline(always)]
    pub(super) fn advance(&mut self, rail: &[Node], pushed: &mut [Node]) {
        let mut states = self.states.as_mut_slice();
        for (index, seat) in self.seats.iter().enumerate() {
            let (own, rest) = states.split_at_mut(seat.sections);
            let moved = rail[seat.node][seat.motion];
            let mut sums = [Block::default(); 2];
            for (section, state) in self.sections.at(index).iter().zip(own) {
                *state = section.advance(*state, moved);
                sums = section.add_force(*state, sums);
            }
            pushed[seat.node][seat.motion] = sums[0] + sums[1];
            states = rest;
        }
    }
}

impl Sections {
    fn new(lane: impl Fn(usize) -> SecondOrderSection) -> Self {
        let sections: [SecondOrderSection; LANES] = array::from_fn(lane);
        let of =
            |pick: fn(&SecondOrderSection) -> f64| Block::from_fn(|lane| pick(&sections[lane]));
        Self {
            keep: of(|section| section.keep),
            pull: of(|section| section.pull),
            velocity: of(|section| section.velocity),
            displacement: of(|section| section.displacement),
        }
    }

    /// The next velocity and displacement under a motion of the rail.
    #[inline(always)]
    fn advance(&self, [v, w]: [Block; 2], moved: Block) -> [Block; 2] {
        [self.keep.mul_add(v, self.pull.subtracted_from(w, moved)), w + v]
    }

    /// Adds the force in a state to two sums, neither of which has to wait for the other.
    #[inline(always)]
    fn add_force(&self, [v, w]: [Block; 2], [first, second]: [Block; 2]) -> [Block; 2] {
        [self.velocity.mul_add(v, first), self.displacement.mul_add(w, second)]
    }
}

impl Bits for Vec<Sections> {
    fn bits(&self) -> Vec<u64> {
        let blocks = self.iter().flat_map(|of| [of.keep, of.pull, of.velocity, of.displacement]);
        blocks.flat_map(|block| block.0).map(f64::to_bits).collect()
    }
}
