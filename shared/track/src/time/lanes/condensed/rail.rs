//! The rail by its nodes: matrices in blocks of two by two, and their elimination from both ends.
//!
//! The two eliminations meet at the element under the wheel, so that the contact force enters
//! where they meet and needs no elimination of its own.

use super::pair;
use super::table::{Bits, Table};
use crate::model::{Layout, Matrices};
use crate::time::PassError;
use crate::time::lanes::block::Block;
use std::ops::Range;

/// Deflection and rotation of a node.
pub(super) type Node = [Block; 2];

/// A node's own block of a symmetric matrix (deflection, mixed, rotation) and its coupling to the
/// next node, row by row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct NodeRows {
    pub(super) own: [Block; 3],
    pub(super) next: [Block; 4],
}

/// Result of the elimination of a node: the coupling to the node before it, and the inverse of its own
/// block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Eliminated {
    pub(super) passed: [Block; 4],
    pub(super) inverse: [Block; 3],
}

/// The inverse of a wheel's element after both eliminations: left node, coupling, right node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Meeting {
    left: [Block; 3],
    mixed: [Block; 4],
    right: [Block; 3],
}

/// A symmetric matrix of the rail, eliminated from both ends.
///
/// Nodes count from 1; places 0 and behind the last stand for nothing.
pub(super) struct Factor {
    pub(super) from_left: Table<Eliminated>,
    pub(super) from_right: Table<Eliminated>,
    first_element: usize,
    meetings: Vec<Meeting>,
}

/// Degrees of freedom of the rail's nodes as the solver counts them, from 1 on.
pub(super) fn node_dofs(layout: &Layout, node: usize) -> [Option<usize>; 2] {
    if (1..=layout.rail_nodes_m().len()).contains(&node) {
        layout.rail_node_dofs(node - 1)
    } else {
        [None, None]
    }
}

/// Whether nodes of the rail are joined to their neighbours only, as beams join them.
pub(super) fn is_chain(layout: &Layout, matrices: &Matrices) -> bool {
    let mut node_of = vec![0; layout.rail_dofs()];
    for node in 0..layout.rail_nodes_m().len() {
        layout.rail_node_dofs(node).into_iter().flatten().for_each(|dof| node_of[dof] = node);
    }
    let near = |row: usize, column: usize| node_of[row].abs_diff(node_of[column]) <= 1;
    let mut places = matrices.places();
    places.all(|(row, column, _)| {
        row >= node_of.len() || column >= node_of.len() || near(row, column)
    })
}

/// Blocks of a matrix by nodes, `value` giving its entries in all lanes; a degree of freedom that
/// is held gets `held` on the diagonal.
pub(super) fn node_rows(
    layout: &Layout,
    held: f64,
    value: impl Fn(usize, usize) -> Block,
) -> Vec<NodeRows> {
    let entry = |row: Option<usize>, column: Option<usize>| match (row, column) {
        (Some(row), Some(column)) => value(row, column),
        _ => Block::default(),
    };
    (0..layout.rail_nodes_m().len() + 2)
        .map(|node| {
            let [w, theta] = node_dofs(layout, node);
            let [w2, theta2] = node_dofs(layout, node + 1);
            let own = |dof: Option<usize>| match dof {
                Some(dof) => value(dof, dof),
                None => Block::splat(held),
            };
            NodeRows {
                own: [own(w), entry(w, theta), own(theta)],
                next: [entry(w, w2), entry(w, theta2), entry(theta, w2), entry(theta, theta2)],
            }
        })
        .collect()
}

impl Factor {
    /// Eliminates a matrix given by its nodes, to be met at these elements (element 1 lies behind
    /// node 1).
    pub(super) fn new(rows: &[NodeRows], elements: Range<usize>) -> Result<Self, PassError> {
        let last = rows.len() - 1;
        let mut from_left = vec![Eliminated::default(); last + 1];
        let mut from_right = from_left.clone();
        for node in 1..last {
            let coupling = pair::transposed(rows[node - 1].next);
            from_left[node] = eliminated(rows[node].own, coupling, &from_left[node - 1])?;
        }
        for node in (1..last).rev() {
            from_right[node] = eliminated(rows[node].own, rows[node].next, &from_right[node + 1])?;
        }
        let meet = |left: usize| {
            let coupling = pair::transposed(rows[left].next);
            let (before, behind) = (&from_left[left], &from_right[left + 2]);
            let (_, own) = passed_on(rows[left + 1].own, rows[left + 1].next, behind);
            let (passed, own) = passed_on(own, coupling, before);
            let right = inverse(own)?;
            let mixed = pair::negated(pair::times_symmetric(pair::transposed(passed), right));
            let left = pair::less_product(before.inverse, mixed, pair::transposed(passed));
            Ok(Meeting { left, mixed, right })
        };
        Ok(Self {
            meetings: elements.clone().map(meet).collect::<Result<_, PassError>>()?,
            from_left: from_left.into_iter().collect(),
            from_right: from_right.into_iter().collect(),
            first_element: elements.start,
        })
    }

    /// Displacements of the wheel's element under loads on its nodes that both eliminations have
    /// reached.
    #[inline(always)]
    pub(super) fn meet(&self, element: usize, [left, right]: [Node; 2]) -> [Node; 2] {
        let meeting = &self.meetings[element - self.first_element];
        [
            pair::add(meeting.mixed, right, pair::times_vector(meeting.left, left)),
            pair::add_transposed(meeting.mixed, left, pair::times_vector(meeting.right, right)),
        ]
    }

    /// Replaces loads on the nodes by displacements.
    pub(super) fn solve(&self, loads: &mut [Node]) {
        let (element, last) = (self.first_element, loads.len() - 2);
        let arrived = [
            eliminate(&self.from_left, 1..=element, loads),
            eliminate(&self.from_right, (element + 1..=last).rev(), loads),
        ];
        [loads[element], loads[element + 1]] = self.meet(element, arrived);
        for node in (1..element).rev() {
            let passed = self.from_left.at(node + 1).passed;
            loads[node] = pair::subtract_transposed(passed, loads[node + 1], loads[node]);
        }
        for node in element + 2..=last {
            let passed = self.from_right.at(node - 1).passed;
            loads[node] = pair::subtract_transposed(passed, loads[node - 1], loads[node]);
        }
    }
}

/// Eliminates the loads on nodes in this order; the load that arrives at the last.
fn eliminate(
    side: &Table<Eliminated>,
    nodes: impl Iterator<Item = usize>,
    loads: &mut [Node],
) -> Node {
    nodes.fold(Node::default(), |before, node| {
        let Eliminated { passed, inverse } = *side.at(node);
        let load = pair::subtract(passed, before, loads[node]);
        loads[node] = pair::times_vector(inverse, load);
        load
    })
}

/// A node after the one before it, to which it is coupled.
fn eliminated(
    own: [Block; 3],
    coupling: [Block; 4],
    before: &Eliminated,
) -> Result<Eliminated, PassError> {
    let (passed, own) = passed_on(own, coupling, before);
    Ok(Eliminated { passed, inverse: inverse(own)? })
}

/// The coupling of a node to the one before it, and its own block after the elimination.
fn passed_on(
    own: [Block; 3],
    coupling: [Block; 4],
    before: &Eliminated,
) -> ([Block; 4], [Block; 3]) {
    let passed = pair::times_symmetric(coupling, before.inverse);
    (passed, pair::less_product(own, passed, coupling))
}

fn inverse(own: [Block; 3]) -> Result<[Block; 3], PassError> {
    let (inverse, pivots) = pair::inverse(own);
    let positive = |block: &Block| block.0.iter().all(|value| *value > 0.0 && value.is_finite());
    if pivots.iter().all(positive) { Ok(inverse) } else { Err(PassError::Unstable) }
}

impl Bits for Eliminated {
    fn bits(&self) -> Vec<u64> {
        [self.passed.bits(), self.inverse.bits()].concat()
    }
}

impl Bits for [NodeRows; 2] {
    fn bits(&self) -> Vec<u64> {
        self.iter().flat_map(|rows| [rows.own.bits(), rows.next.bits()].concat()).collect()
    }
}
