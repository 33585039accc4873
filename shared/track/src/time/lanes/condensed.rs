//! A track condensed to its rail: the parts under the rail are a sum of second-order sections.
//!
//! The condensation is exact: the rail has the same displacements as in the complete track.

mod motion;
mod pair;
mod rail;
mod substructure;
mod supports;
mod table;

use super::block::{Block, LANES};
use super::state::State;
use crate::model::{HertzContact, Layout, TrackModel};
use crate::time::{Pass, PassError};
use motion::{CondensedState, NodeState, Station};
use rail::{Factor, Node, NodeRows, node_dofs, node_rows};
use std::ops::Range;
pub(in crate::time::lanes) use substructure::Hanging;
use supports::Supports;
use table::Table;

/// The substructures under the rail, if the track can be condensed to the rail.
pub(super) fn hanging(model: &TrackModel, dt: f64) -> Option<Hanging> {
    let (layout, matrices) = (model.layout(), model.matrices());
    if rail::is_chain(layout, matrices) {
        substructure::hanging(matrices, layout.rail_dofs(), dt)
    } else {
        None
    }
}

/// What cases on one pattern have in common.
pub(super) struct Solver {
    /// Where the wheel stands at the start and at the end of every step.
    stations: Vec<Station>,
    /// The elements it passes.
    elements: Range<usize>,
}

impl Solver {
    pub(super) fn new(model: &TrackModel, pass: &Pass) -> Self {
        let station = |step| Station::new(model, pass, pass.position_m(step));
        let stations: Vec<_> = (0..=pass.steps()).map(station).collect();
        // The wheel goes forward.
        let elements = stations[0].element..stations[stations.len() - 1].element + 1;
        Self { stations, elements }
    }

    /// Contact forces at the start and after every step, over surfaces of these heights in m.
    pub(super) fn run(
        &self,
        models: [&TrackModel; LANES],
        hanging: [&Hanging; LANES],
        pass: &Pass,
        heights_m: &[Block],
    ) -> Result<Vec<Block>, PassError> {
        let motion = self.start(models, hanging, pass, heights_m[0])?;
        Ok(motion.run(&self.stations[1..], &heights_m[1..]))
    }

    /// The wheels at rest at the first station, over surfaces of these heights.
    fn start(
        &self,
        models: [&TrackModel; LANES],
        hanging: [&Hanging; LANES],
        pass: &Pass,
        height_m: Block,
    ) -> Result<CondensedState, PassError> {
        let (dt, station) = (pass.time_step_s, &self.stations[0]);
        let wheel = &models[0].vehicle().wheel;
        let contact = HertzContact::new(models[0].design());
        let condensed = Condensed { models, hanging };
        let rest = condensed.at_rest(station, wheel.load_n)?;
        let given = contact.approach(wheel.load_n) + station.local_flexibility * wheel.load_n;
        let rail_m = station.deflection(&rest) + height_m;
        let place = |dof| place(models[0].layout(), dof);
        let mut supports = Supports::at_rest(hanging, place, &rest);
        // At rest a step changes nothing; it says what the supports push with.
        let mut pushed = vec![Node::default(); rest.len()];
        supports.advance(&rest, &mut pushed);
        Ok(CondensedState {
            contact,
            load: Block::splat(wheel.load_n),
            wheel_compliance: Block::splat(dt * dt / (4.0 * wheel.mass_kg)),
            wheel: State::at_rest(rail_m + Block::splat(given)),
            inertia: condensed.inertia(dt),
            factor: condensed.step_stiffness(dt, self.elements.clone())?,
            rail: rest.iter().map(|&node| NodeState { inertial: node, viscous: node }).collect(),
            supports,
            pushed,
            solution: rest,
        })
    }
}

/// Node and motion (0 deflection, 1 rotation) of a degree of freedom of the rail.
fn place(layout: &Layout, dof: usize) -> (usize, usize) {
    (1..=layout.rail_nodes_m().len())
        .find_map(|node| {
            let motion = node_dofs(layout, node).iter().position(|own| *own == Some(dof))?;
            Some((node, motion))
        })
        .expect("a degree of freedom of the rail belongs to a node")
}

/// Eight tracks and their substructures under the rail.
struct Condensed<'a> {
    models: [&'a TrackModel; LANES],
    hanging: [&'a Hanging; LANES],
}

impl Condensed<'_> {
    /// `m M + c C + k K` of the rails by nodes. A held degree of freedom gets `held` on the diagonal.
    fn rows(&self, [m, c, k]: [f64; 3], held: f64) -> Vec<NodeRows> {
        let pattern = self.models[0].matrices();
        node_rows(self.models[0].layout(), held, |row, column| {
            let Some(place) = pattern.place(row, column) else { return Block::default() };
            Block::from_fn(|lane| {
                let matrices = self.models[lane].matrices();
                m * matrices.mass()[place]
                    + c * matrices.damping()[place]
                    + k * matrices.stiffness()[place]
            })
        })
    }

    /// Subtracts the relief of the substructures from the diagonal.
    fn relieve(&self, rows: &mut [NodeRows], relief: impl Fn(&Hanging, usize) -> f64) {
        for &dof in self.hanging[0].keys() {
            let (node, motion) = place(self.models[0].layout(), dof);
            let own = &mut rows[node].own[2 * motion];
            *own = *own - Block::from_fn(|lane| relief(self.hanging[lane], dof));
        }
    }

    /// Displacements of the rail under the standing wheel.
    fn at_rest(&self, station: &Station, load_n: f64) -> Result<Vec<Node>, PassError> {
        let mut rows = self.rows([0.0, 0.0, 1.0], 1.0);
        self.relieve(&mut rows, |hanging, dof| hanging[&dof].static_relief);
        let mut loads = vec![Node::default(); rows.len()];
        let shares = station.shape.map(|share| Block::splat(share * load_n));
        loads[station.element] = [shares[0], shares[1]];
        loads[station.element + 1] = [shares[2], shares[3]];
        Factor::new(&rows, station.element..station.element + 1)?.solve(&mut loads);
        Ok(loads)
    }

    fn step_stiffness(&self, dt: f64, elements: Range<usize>) -> Result<Factor, PassError> {
        let mut rows = self.rows([4.0 / (dt * dt), 2.0 / dt, 1.0], 1.0);
        self.relieve(&mut rows, |hanging, dof| hanging[&dof].step_relief);
        Factor::new(&rows, elements)
    }

    fn inertia(&self, dt: f64) -> Table<[NodeRows; 2]> {
        let masses = self.rows([4.0 / (dt * dt), 0.0, 0.0], 0.0);
        let dampings = self.rows([0.0, 2.0 / dt, 0.0], 0.0);
        masses.into_iter().zip(dampings).map(|(mass, damping)| [mass, damping]).collect()
    }
}
