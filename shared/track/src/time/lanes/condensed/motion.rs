//! Motion of wheel, rail and substructures, in all lanes.

use super::pair;
use super::rail::{Eliminated, Factor, Node, NodeRows};
use super::supports::Supports;
use super::table::Table;
use crate::model::TrackModel;
use crate::time::Pass;
use crate::time::lanes::block::Block;
use crate::time::lanes::contact::{self, Wheels};
use crate::time::lanes::state::State;
use pulp::{Arch, Simd, WithSimd};
use std::array;

/// The wheel's place on the rail at the end of a step, the same in all lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    /// The node left of the wheel, counted from 1.
    pub(super) element: usize,
    /// The load's share of deflection and rotation, left and right; zero where held.
    pub(super) shape: [f64; 4],
    /// Flexibility in m/N that the shape functions leave out; zero if the pass does.
    pub(super) local_flexibility: f64,
}

impl Station {
    pub(super) fn new(model: &TrackModel, pass: &Pass, x_m: f64) -> Self {
        let point = model.layout().rail_point(x_m);
        // What is held takes its share of the load to the ground.
        let share = |index: usize| point.dofs[index].map_or(0.0, |_| point.shape[index]);
        let local_flexibility = if pass.local_flexibility { point.local_flexibility } else { 0.0 };
        Self { element: point.element + 1, shape: array::from_fn(share), local_flexibility }
    }

    /// Deflection of the rail under the wheel, but for the local one.
    pub(super) fn deflection(&self, rail: &[Node]) -> Block {
        under_wheel(self.shape.map(Block::splat), [rail[self.element], rail[self.element + 1]])
    }
}

/// The states of a node's deflection and rotation, [`State`] part by part.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NodeState {
    pub(super) inertial: Node,
    pub(super) viscous: Node,
}

/// Eight wheels on eight tracks.
///
/// Nodes of the rail count from 1; the places before and behind them stand for nothing.
pub(super) struct CondensedState {
    pub(super) wheels: Wheels,
    pub(super) wheel: State,
    /// `4 M / dt²` and `2 C / dt` of the rail.
    pub(super) inertia: Table<[NodeRows; 2]>,
    /// `4 M / dt² + 2 C / dt + K` of the rail on its supports.
    pub(super) factor: Factor,
    pub(super) rail: Vec<NodeState>,
    pub(super) supports: Supports,
    /// Forces on the nodes from the previous state of the supports.
    pub(super) pushed: Vec<Node>,
    /// What the displacement of an eliminated node would be but for the next node's; after
    /// substitution the displacements.
    pub(super) solution: Vec<Node>,
    pub(super) further: Vec<FurtherWheel>,
}

/// A further wheel, so far from the others that within a step no wheel moves the rail under another
/// ([`super::apart`]). Its contact force therefore follows from the motion without contact forces.
pub(super) struct FurtherWheel {
    pub(super) wheel: State,
    /// Its places at the start and at the end of every step.
    pub(super) stations: Vec<Station>,
    /// Heights of the surface in m under it, at the same times.
    pub(super) heights_m: Vec<Block>,
}

impl CondensedState {
    /// Contact forces at the start and at every following station, over surfaces of the given
    /// heights in m; with the widest vectors that the machine has.
    pub(super) fn run(self, stations: &[Station], heights_m: &[Block]) -> Vec<Block> {
        Arch::new().dispatch(Run { motion: self, stations, heights_m })
    }

    /// The step `number`, counted from 1; the contact forces at its end.
    #[inline(always)]
    fn advance(&mut self, number: usize, station: &Station, height_m: Block) -> Block {
        let element = station.element;
        let mut arrived = self.eliminate(element);
        for wheel in 0..self.further.len() {
            self.roll_further(wheel, number, element, &mut arrived);
        }
        let free = self.factor.meet(element, arrived);
        let shape = station.shape.map(Block::splat);
        let unit = self.factor.meet(element, [[shape[0], shape[1]], [shape[2], shape[3]]]);
        let wheel_free = self.wheels.compliance.mul_add(self.wheels.load_n, self.wheel.inertial());
        let overlap = wheel_free - under_wheel(shape, free) - height_m;
        let compliance = under_wheel(shape, unit) + self.wheels.compliance;
        let local = Block::splat(station.local_flexibility);
        let force = contact::forces(&self.wheels, overlap, compliance + local);
        self.substitute(element, loaded(free, unit, force));
        self.supports.advance(&self.solution, &mut self.pushed);
        self.wheel.advance(self.wheels.compliance.subtracted_from(force, wheel_free));
        force
    }

    /// Moves a further wheel on, and adds its contact force to the loads that arrive at the element where
    /// both eliminations meet.
    #[inline(always)]
    fn roll_further(&mut self, index: usize, step: usize, element: usize, arrived: &mut [Node; 2]) {
        let FurtherWheel { stations, heights_m, .. } = &self.further[index];
        let (station, height_m) = (stations[step], heights_m[step]);
        let shape = station.shape.map(Block::splat);
        let met = self.factor.meet(element, *arrived);
        let free = self.displacements_at(station.element, element, met);
        let unit = self.factor.meet(station.element, [[shape[0], shape[1]], [shape[2], shape[3]]]);
        let wheel = &mut self.further[index].wheel;
        let wheel_free = self.wheels.compliance.mul_add(self.wheels.load_n, wheel.inertial());
        let overlap = wheel_free - under_wheel(shape, free) - height_m;
        let compliance = under_wheel(shape, unit) + self.wheels.compliance;
        let local = Block::splat(station.local_flexibility);
        let force = contact::forces(&self.wheels, overlap, compliance + local);
        wheel.advance(self.wheels.compliance.subtracted_from(force, wheel_free));
        let load = shape.map(|share| share * force);
        self.load([[load[0], load[1]], [load[2], load[3]]], station.element, element, arrived);
    }

    /// Displacements of the nodes of the element `at`, from those of the element where both eliminations
    /// meet.
    #[inline(always)]
    fn displacements_at(&self, at: usize, element: usize, met: [Node; 2]) -> [Node; 2] {
        let [mut left, mut right] = met;
        for node in (at + 1..=element).rev() {
            let passed = self.factor.from_left.at(node).passed;
            right = left;
            left = pair::subtract_transposed(passed, left, self.solution[node - 1]);
        }
        for node in element + 1..=at {
            let passed = self.factor.from_right.at(node).passed;
            left = right;
            right = pair::subtract_transposed(passed, right, self.solution[node + 1]);
        }
        [left, right]
    }

    /// Adds loads on the nodes of the element `at`, which are already eliminated, to the elimination.
    #[inline(always)]
    fn load(&mut self, loads: [Node; 2], at: usize, element: usize, arrived: &mut [Node; 2]) {
        let [left, right] = loads;
        if at < element {
            let mut load = left;
            let mut next = right;
            for node in at..element {
                let inverse = self.factor.from_left.at(node).inverse;
                self.solution[node] = pair::add_symmetric(inverse, load, self.solution[node]);
                load = pair::subtract(self.factor.from_left.at(node + 1).passed, load, next);
                next = Node::default();
            }
            arrived[0] = sum(arrived[0], load);
        } else {
            let mut load = right;
            let mut next = left;
            for node in (element + 2..=at + 1).rev() {
                let inverse = self.factor.from_right.at(node).inverse;
                self.solution[node] = pair::add_symmetric(inverse, load, self.solution[node]);
                load = pair::subtract(self.factor.from_right.at(node - 1).passed, load, next);
                next = Node::default();
            }
            arrived[1] = sum(arrived[1], load);
        }
    }

    /// Elimination from both ends up to the wheel's element; the loads that arrive at its nodes.
    ///
    /// Left and right go side by side: neither has to wait for the other.
    #[inline(always)]
    fn eliminate(&mut self, element: usize) -> [Node; 2] {
        let last = self.solution.len() - 2;
        let (to_left, to_right) = (element - 1, last - element - 1);
        let (mut left, mut right) = (Node::default(), Node::default());
        for step in 0..to_left.max(to_right) {
            if step < to_left {
                left = self.eliminate_node(1 + step, left, *self.factor.from_left.at(1 + step));
            }
            if step < to_right {
                let node = last - step;
                right = self.eliminate_node(node, right, *self.factor.from_right.at(node));
            }
        }
        let from_left = self.factor.from_left.at(element).passed;
        let from_right = self.factor.from_right.at(element + 1).passed;
        [
            pair::subtract(from_left, left, self.past(element)),
            pair::subtract(from_right, right, self.past(element + 1)),
        ]
    }

    /// Eliminates a node, given the load on the one before it; the load on this one.
    #[inline(always)]
    fn eliminate_node(
        &mut self,
        node: usize,
        before: Node,
        Eliminated { passed, inverse }: Eliminated,
    ) -> Node {
        let load = pair::subtract(passed, before, self.past(node));
        self.solution[node] = pair::times_vector(inverse, load);
        load
    }

    /// Force on a node from the previous state: inertia and dampers of the rail, and the supports.
    #[inline(always)]
    fn past(&self, node: usize) -> Node {
        let [before, own, after] = [node - 1, node, node + 1].map(|node| &self.rail[node]);
        let [mass, damping] = self.inertia.at(node);
        let [mass_before, damping_before] = self.inertia.at(node - 1);
        let sum = pair::add_symmetric(mass.own, own.inertial, self.pushed[node]);
        let sum = pair::add(mass.next, after.inertial, sum);
        let sum = pair::add_transposed(mass_before.next, before.inertial, sum);
        let sum = pair::add_symmetric(damping.own, own.viscous, sum);
        let sum = pair::add(damping.next, after.viscous, sum);
        pair::add_transposed(damping_before.next, before.viscous, sum)
    }

    /// Substitution from the wheel's element to both ends; moves the rail on.
    #[inline(always)]
    fn substitute(&mut self, element: usize, [left, right]: [Node; 2]) {
        let last = self.solution.len() - 2;
        self.displace(element, left);
        self.displace(element + 1, right);
        let (to_left, to_right) = (element - 1, last - element - 1);
        let (mut left, mut right) = (left, right);
        for step in 0..to_left.max(to_right) {
            if step < to_left {
                let node = element - step;
                let passed = self.factor.from_left.at(node).passed;
                left = pair::subtract_transposed(passed, left, self.solution[node - 1]);
                self.displace(node - 1, left);
            }
            if step < to_right {
                let node = element + 1 + step;
                let passed = self.factor.from_right.at(node).passed;
                right = pair::subtract_transposed(passed, right, self.solution[node + 1]);
                self.displace(node + 1, right);
            }
        }
    }

    /// Moves a node on to its displacement.
    #[inline(always)]
    fn displace(&mut self, node: usize, displacement: Node) {
        self.solution[node] = displacement;
        self.rail[node].advance(displacement);
    }
}

impl NodeState {
    #[inline(always)]
    fn advance(&mut self, [deflection, rotation]: Node) {
        let mut states = [0, 1]
            .map(|motion| State { inertial: self.inertial[motion], viscous: self.viscous[motion] });
        states[0].advance(deflection);
        states[1].advance(rotation);
        self.inertial = states.map(|state| state.inertial);
        self.viscous = states.map(|state| state.viscous);
    }
}

/// Deflection of the rail under the wheel, but for the local one.
#[inline(always)]
fn under_wheel(shape: [Block; 4], [[a, b], [c, d]]: [Node; 2]) -> Block {
    let left = shape[1].mul_add(b, shape[0] * a);
    shape[3].mul_add(d, shape[2].mul_add(c, left))
}

#[inline(always)]
fn sum([a, b]: Node, [c, d]: Node) -> Node {
    [a + c, b + d]
}

/// Displacements without contact and those of a unit force, put together.
#[inline(always)]
fn loaded(free: [Node; 2], unit: [Node; 2], force: Block) -> [Node; 2] {
    [0, 1].map(|node| [0, 1].map(|motion| unit[node][motion].mul_add(force, free[node][motion])))
}

/// A whole pass, compiled once for every instruction set.
struct Run<'a> {
    motion: CondensedState,
    stations: &'a [Station],
    heights_m: &'a [Block],
}

impl WithSimd for Run<'_> {
    type Output = Vec<Block>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<Block> {
        let mut motion = self.motion;
        let mut forces = vec![motion.wheels.load_n];
        for (before, (station, &height_m)) in self.stations.iter().zip(self.heights_m).enumerate() {
            forces.push(motion.advance(before + 1, station, height_m));
        }
        forces
    }
}
