//! What the past pushes with: the right-hand side of a time step.

use super::block::{Block, LANES};
use super::elimination::Elimination;
use super::factor::index;
use crate::model::{Matrices, TrackModel};

/// The two combinations of displacement `u`, velocity `v` and acceleration `a` that the next step
/// needs of a degree of freedom.
///
/// With the displacement `u'` after the step, both come anew as `4 u' - 2 q - p` and `2 u' - q`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct State {
    /// `u + dt v + dt² a / 4`.
    inertial: Block,
    /// `u + dt v / 2`.
    viscous: Block,
}

impl State {
    #[inline(always)]
    pub(super) fn at_rest(displacement: Block) -> Self {
        Self { inertial: displacement, viscous: displacement }
    }

    #[inline(always)]
    pub(super) fn advance(&mut self, displacement: Block) {
        let moved = displacement - self.viscous;
        self.viscous = displacement + moved;
        self.inertial = self.viscous + moved + (displacement - self.inertial);
    }

    #[inline(always)]
    pub(super) fn inertial(&self) -> Block {
        self.inertial
    }
}

/// One factor of the sum: which half of which state it multiplies.
#[derive(Clone, Copy, Debug)]
struct Term<T> {
    source: u32,
    factor: T,
}

/// `4 M / dt² p + 2 C / dt q`, row by row in elimination order.
///
/// Rows that are equal in all lanes keep scalars; which ones these are changes no bit, because
/// the order of the sum stays.
#[derive(Clone, Debug)]
pub(super) struct Inertia {
    /// Where the terms of each row end in the four lists below.
    ends: Vec<[u32; 4]>,
    masses: Vec<Term<f64>>,
    dampings: Vec<Term<f64>>,
    varied_masses: Vec<Term<Block>>,
    varied_dampings: Vec<Term<Block>>,
}

impl Inertia {
    pub(super) fn new(elimination: &Elimination, models: &[&TrackModel; LANES], dt: f64) -> Self {
        let mut inertia = Self {
            ends: vec![[0; 4]],
            masses: Vec::new(),
            dampings: Vec::new(),
            varied_masses: Vec::new(),
            varied_dampings: Vec::new(),
        };
        let (m, c) = (4.0 / (dt * dt), 2.0 / dt);
        for row in 0..elimination.order.len() {
            let masses =
                terms(elimination, models, row, |matrices, place| m * matrices.mass()[place]);
            let dampings =
                terms(elimination, models, row, |matrices, place| c * matrices.damping()[place]);
            store(&masses, &mut inertia.masses, &mut inertia.varied_masses);
            store(&dampings, &mut inertia.dampings, &mut inertia.varied_dampings);
            inertia.ends.push([
                index(inertia.masses.len()),
                index(inertia.dampings.len()),
                index(inertia.varied_masses.len()),
                index(inertia.varied_dampings.len()),
            ]);
        }
        inertia
    }

    /// One row of the sum.
    #[inline(always)]
    pub(super) fn row(&self, row: usize, states: &[State]) -> Block {
        let [from, to] = [self.ends[row], self.ends[row + 1]];
        let part = |kind: usize| from[kind] as usize..to[kind] as usize;
        let mut sum = Block::default();
        for term in &self.masses[part(0)] {
            let state = &states[term.source as usize];
            sum = Block::splat(term.factor).mul_add(state.inertial, sum);
        }
        for term in &self.varied_masses[part(2)] {
            sum = term.factor.mul_add(states[term.source as usize].inertial, sum);
        }
        for term in &self.dampings[part(1)] {
            let state = &states[term.source as usize];
            sum = Block::splat(term.factor).mul_add(state.viscous, sum);
        }
        for term in &self.varied_dampings[part(3)] {
            sum = term.factor.mul_add(states[term.source as usize].viscous, sum);
        }
        sum
    }
}

/// Non-zero entries of a row of a matrix, in elimination order.
fn terms(
    elimination: &Elimination,
    models: &[&TrackModel; LANES],
    row: usize,
    value: impl Fn(&Matrices, usize) -> f64,
) -> Vec<(usize, Block)> {
    let mut entries = row_entries(elimination, models, row, value);
    entries.retain(|(_, block)| block.0.iter().any(|&value| value != 0.0));
    entries
}

/// Entries of a row of a matrix, by columns in elimination order.
pub(super) fn row_entries(
    elimination: &Elimination,
    models: &[&TrackModel; LANES],
    row: usize,
    value: impl Fn(&Matrices, usize) -> f64,
) -> Vec<(usize, Block)> {
    let dof = elimination.order[row];
    let pattern = models[0].matrices();
    let places = pattern.row_starts()[dof]..pattern.row_starts()[dof + 1];
    let mut entries: Vec<_> = places
        .map(|place| {
            let column = elimination.place[pattern.columns()[place]];
            (column, Block::from_fn(|lane| value(models[lane].matrices(), place)))
        })
        .collect();
    entries.sort_unstable_by_key(|&(column, _)| column);
    entries
}

/// Stores a row as scalars if it is the same in all lanes, else as it is.
fn store(
    entries: &[(usize, Block)],
    uniform: &mut Vec<Term<f64>>,
    varied: &mut Vec<Term<Block>>,
) {
    let common: Option<Vec<f64>> = entries.iter().map(|(_, block)| block.uniform()).collect();
    let sources = entries.iter().map(|&(column, _)| index(column));
    if let Some(factors) = common {
        uniform.extend(sources.zip(factors).map(|(source, factor)| Term { source, factor }));
    } else {
        let blocks = entries.iter().map(|&(_, factor)| factor);
        varied.extend(sources.zip(blocks).map(|(source, factor)| Term { source, factor }));
    }
}
