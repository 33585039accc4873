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
use super::contact::Wheels;
use super::state::State;
use crate::model::{Layout, TrackModel};
use crate::time::{Pass, PassError};
use motion::{CondensedState, FurtherWheel, NodeState, Station};
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

/// Smallest distance of two wheels, in lengths over which the motion of the rail falls by `e` within a step:
/// `exp(-25)` is 1e-11.
const APART: f64 = 25.0;

/// Whether the wheels of a vehicle are so far from each other that within a time step of `dt` no wheel moves
/// the rail under another.
///
/// In a step a beam resists as one on a foundation of its own inertia, `4 m / dt²`. Its deflection under a
/// load falls by `e` over the length `(EI dt² / m)^(1/4)`.
pub(super) fn apart(model: &TrackModel, dt: f64) -> bool {
    let (rail, vehicle) = (&model.design().rail, model.vehicle());
    let bending = rail.bending_stiffness() / rail.mass_per_length();
    let length_m = (bending * dt * dt).powf(0.25);
    let mut places_m: Vec<f64> =
        [0.0].into_iter().chain(vehicle.further_wheels_m.iter().copied()).collect();
    places_m.sort_by(f64::total_cmp);
    places_m.windows(2).all(|pair| pair[1] - pair[0] >= APART * length_m)
}

/// What cases on one pattern have in common.
pub(super) struct Solver {
    /// Where each wheel stands at the start and at the end of every step, the first wheel first.
    stations: Vec<Vec<Station>>,
    /// The elements they pass.
    elements: Range<usize>,
}

impl Solver {
    pub(super) fn new(model: &TrackModel, pass: &Pass) -> Self {
        let stations = |ahead_m: f64| -> Vec<Station> {
            let station = |step| Station::new(model, pass, pass.position_m(step) + ahead_m);
            (0..=pass.steps()).map(station).collect()
        };
        let further = model.vehicle().further_wheels_m.iter().copied();
        let stations: Vec<_> = [0.0].into_iter().chain(further).map(stations).collect();
        // The wheels go forward.
        let first = stations.iter().map(|of| of[0].element).fold(usize::MAX, usize::min);
        let last = stations.iter().map(|of| of[of.len() - 1].element).fold(0, usize::max);
        Self { stations, elements: first..last + 1 }
    }

    /// Contact forces of the first wheel at the start and after every step. `heights_m` are those of the
    /// surface under each wheel.
    pub(super) fn run(
        &self,
        models: [&TrackModel; LANES],
        hanging: [&Hanging; LANES],
        pass: &Pass,
        heights_m: &[Vec<Block>],
    ) -> Result<Vec<Block>, PassError> {
        let motion = self.start(models, hanging, pass, heights_m)?;
        Ok(motion.run(&self.stations[0][1..], &heights_m[0][1..]))
    }

    /// The wheels at rest at their first stations, over surfaces of these heights.
    fn start(
        &self,
        models: [&TrackModel; LANES],
        hanging: [&Hanging; LANES],
        pass: &Pass,
        heights_m: &[Vec<Block>],
    ) -> Result<CondensedState, PassError> {
        let dt = pass.time_step_s;
        let wheels = Wheels::new(&models, dt);
        let condensed = Condensed { models, hanging };
        let first: Vec<&Station> = self.stations.iter().map(|of| &of[0]).collect();
        let rest = condensed.at_rest(&first, wheels.load_n)?;
        let at_rest = |station: &Station, height_m: Block| {
            let given = wheels.approach_m + Block::splat(station.local_flexibility) * wheels.load_n;
            State::at_rest(station.deflection(&rest) + height_m + given)
        };
        let further = self.stations.iter().zip(heights_m).skip(1);
        let further = further.map(|(stations, heights_m)| FurtherWheel {
            wheel: at_rest(&stations[0], heights_m[0]),
            stations: stations.clone(),
            heights_m: heights_m.clone(),
        });
        let place = |dof| place(models[0].layout(), dof);
        let mut supports = Supports::at_rest(hanging, place, &rest);
        // At rest a step changes nothing; it says what the supports push with.
        let mut pushed = vec![Node::default(); rest.len()];
        supports.advance(&rest, &mut pushed);
        Ok(CondensedState {
            wheels,
            wheel: at_rest(first[0], heights_m[0][0]),
            further: further.collect(),
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

    /// Displacements of the rail under the standing wheels.
    fn at_rest(&self, stations: &[&Station], load_n: Block) -> Result<Vec<Node>, PassError> {
        let mut rows = self.rows([0.0, 0.0, 1.0], 1.0);
        self.relieve(&mut rows, |hanging, dof| hanging[&dof].static_relief);
        let mut loads = vec![Node::default(); rows.len()];
        for station in stations {
            let [a, b, c, d] = station.shape.map(|share| Block::splat(share) * load_n);
            loads[station.element] = [a, b];
            loads[station.element + 1] = [c, d];
        }
        let met = stations[0].element;
        Factor::new(&rows, met..met + 1)?.solve(&mut loads);
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
