//! Motion of wheel and track, in all lanes.

use super::elimination::Elimination;
use super::factor::Factor;
use super::inertia::{Inertia, States, row_entries};
use crate::model::TrackModel;
use crate::time::lanes::block::{Block, LANES};
use crate::time::lanes::contact::{self, Wheels};
use crate::time::lanes::state::State;
use crate::time::{Pass, PassError};
use pulp::{Arch, Simd, WithSimd};

/// The wheel's place on the rail at the end of a step, the same in all lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    /// Place of the first degree of freedom that the load acts on; the others follow it.
    first: usize,
    /// The load's share of each.
    shape: [f64; 4],
    /// Flexibility in m/N that the shape functions leave out; zero if the pass does.
    local_flexibility: f64,
}

impl Station {
    pub(super) fn new(
        model: &TrackModel,
        pass: &Pass,
        elimination: &Elimination,
        x_m: f64,
    ) -> Self {
        let point = model.layout().rail_point(x_m);
        let mut entries = point.entries().map(|(dof, shape)| (elimination.place[dof], shape));
        let mut shape = [0.0; 4];
        let mut first = elimination.order.len();
        for (slot, (place, value)) in shape.iter_mut().zip(&mut entries) {
            first = first.min(place);
            *slot = value;
        }
        let local_flexibility = if pass.local_flexibility { point.local_flexibility } else { 0.0 };
        Self { first, shape, local_flexibility }
    }

    /// The load's share at a place.
    #[inline(always)]
    fn load(&self, place: usize) -> f64 {
        self.shape.get(place - self.first).copied().unwrap_or(0.0)
    }
}

/// Eight wheels on eight tracks.
pub(super) struct LaneState {
    wheels: Wheels,
    factor: Factor,
    inertia: Inertia,
    track: States,
    wheel: State,
    /// The right-hand side after forward elimination; after back substitution the displacements.
    solution: Vec<Block>,
    /// A unit contact force after forward elimination; zero before the wheel.
    unit: Vec<Block>,
}

impl LaneState {
    /// The wheels at rest at the first station, over surfaces of the given heights.
    pub(super) fn start(
        elimination: &Elimination,
        station: &Station,
        models: [&TrackModel; LANES],
        pass: &Pass,
        height_m: Block,
    ) -> Result<Self, PassError> {
        let size = elimination.order.len();
        let dt = pass.time_step_s;
        let wheels = Wheels::new(&models, dt);
        let stiffness = Factor::new(elimination, |row| {
            row_entries(elimination, &models, row, |matrices, place| matrices.stiffness()[place])
        })?;
        let mut rest = vec![Block::default(); size];
        for (slot, shape) in rest[station.first..].iter_mut().zip(station.shape) {
            *slot = Block::splat(shape) * wheels.load_n;
        }
        stiffness.solve(&mut rest);
        let given = wheels.approach_m + Block::splat(station.local_flexibility) * wheels.load_n;
        let rail = (rest[station.first..].iter().zip(station.shape))
            .fold(height_m, |sum, (u, shape)| u.mul_add(Block::splat(shape), sum));
        Ok(Self {
            wheels,
            factor: dynamic_stiffness(elimination, &models, dt)?,
            inertia: Inertia::new(elimination, &models, dt),
            track: States::at_rest(&rest),
            wheel: State::at_rest(rail + given),
            solution: rest,
            unit: vec![Block::default(); size],
        })
    }

    /// Contact forces at the start and at every following station, over surfaces of the given
    /// heights in m; with the widest vectors that the machine has.
    pub(super) fn run(self, stations: &[Station], heights_m: &[Block]) -> Vec<Block> {
        Arch::new().dispatch(Run { motion: self, stations, heights_m })
    }

    /// One time step; the contact forces at its end.
    #[inline(always)]
    fn advance(&mut self, station: &Station, height_m: Block) -> Block {
        self.eliminate_past();
        let (compliance, deflection) = self.eliminate_unit_force(station);
        let wheel_free = self.wheels.compliance.mul_add(self.wheels.load_n, self.wheel.inertial());
        let overlap = wheel_free - deflection - height_m;
        let local = Block::splat(station.local_flexibility);
        let force =
            contact::forces(&self.wheels, overlap, compliance + self.wheels.compliance + local);
        self.substitute(station.first, force);
        self.wheel.advance(self.wheels.compliance.subtracted_from(force, wheel_free));
        force
    }

    /// Forward elimination of the forces from the previous state.
    #[inline(always)]
    fn eliminate_past(&mut self) {
        for row in 0..self.solution.len() {
            let past = self.inertia.row(row, &self.track);
            self.solution[row] = self.factor.lower.add_row(row, &self.solution, past);
        }
    }

    /// Forward elimination of a unit contact force.
    ///
    /// Returns the rail's compliance under the wheel in m/N and its deflection there without
    /// contact in m: products of both eliminated vectors, so that no second back substitution
    /// is needed.
    #[inline(always)]
    fn eliminate_unit_force(&mut self, station: &Station) -> (Block, Block) {
        let (mut compliance, mut deflection) = (Block::default(), Block::default());
        for row in station.first..self.unit.len() {
            let load = Block::splat(station.load(row));
            let unit = self.factor.lower.add_row(row, &self.unit, load);
            self.unit[row] = unit;
            let scaled = unit * self.factor.inverse_pivots[row];
            compliance = scaled.mul_add(unit, compliance);
            deflection = scaled.mul_add(self.solution[row], deflection);
        }
        (compliance, deflection)
    }

    /// Back substitution of the past and the contact force; moves the track on.
    #[inline(always)]
    fn substitute(&mut self, first: usize, force: Block) {
        for row in (0..self.solution.len()).rev() {
            let mut pushed = self.solution[row];
            if row >= first {
                pushed = self.unit[row].mul_add(force, pushed);
            }
            let scaled = pushed * self.factor.inverse_pivots[row];
            let displacement = self.factor.upper.add_row_back(row, &self.solution, scaled);
            self.solution[row] = displacement;
            self.track.advance(row, displacement);
        }
    }
}

/// Factors of `4 M / dt² + 2 C / dt + K`.
fn dynamic_stiffness(
    elimination: &Elimination,
    models: &[&TrackModel; LANES],
    dt: f64,
) -> Result<Factor, PassError> {
    let (m, c) = (4.0 / (dt * dt), 2.0 / dt);
    Factor::new(elimination, |row| {
        row_entries(elimination, models, row, |matrices, place| {
            m * matrices.mass()[place] + c * matrices.damping()[place] + matrices.stiffness()[place]
        })
    })
}

/// A whole pass, compiled once for every instruction set.
struct Run<'a> {
    motion: LaneState,
    stations: &'a [Station],
    heights_m: &'a [Block],
}

impl WithSimd for Run<'_> {
    type Output = Vec<Block>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<Block> {
        let mut motion = self.motion;
        let mut first = self.stations.first().map_or(0, |station| station.first);
        let mut forces = vec![motion.wheels.load_n];
        for (station, &height_m) in self.stations.iter().zip(self.heights_m) {
            // The wheel has left these places behind.
            motion.unit[first..station.first].fill(Block::default());
            first = station.first;
            forces.push(motion.advance(station, height_m));
        }
        forces
    }
}
