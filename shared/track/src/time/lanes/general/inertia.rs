//! Forces from the previous state: the right-hand side of a time step.

use super::elimination::Elimination;
use super::runs::Runs;
use crate::model::{Matrices, TrackModel};
use crate::time::lanes::block::{Block, LANES};
use crate::time::lanes::state::State;

/// The states of all degrees of freedom, part by part.
#[derive(Clone, Debug)]
pub(super) struct States {
    inertial: Vec<Block>,
    viscous: Vec<Block>,
}

impl States {
    pub(super) fn at_rest(displacement: &[Block]) -> Self {
        Self { inertial: displacement.to_vec(), viscous: displacement.to_vec() }
    }

    /// [`State::advance`] of one degree of freedom.
    #[inline(always)]
    pub(super) fn advance(&mut self, row: usize, displacement: Block) {
        let mut state = State { inertial: self.inertial[row], viscous: self.viscous[row] };
        state.advance(displacement);
        self.inertial[row] = state.inertial;
        self.viscous[row] = state.viscous;
    }
}

/// `4 M / dt² p + 2 C / dt q`, row by row in elimination order.
#[derive(Clone, Debug)]
pub(super) struct Inertia {
    masses: Product,
    dampings: Product,
}

impl Inertia {
    pub(super) fn new(elimination: &Elimination, models: &[&TrackModel; LANES], dt: f64) -> Self {
        let (m, c) = (4.0 / (dt * dt), 2.0 / dt);
        let mut inertia = Self { masses: Product::new(), dampings: Product::new() };
        for row in 0..elimination.order.len() {
            inertia.masses.push_row(&terms(elimination, models, row, |matrices, place| {
                m * matrices.mass()[place]
            }));
            inertia.dampings.push_row(&terms(elimination, models, row, |matrices, place| {
                c * matrices.damping()[place]
            }));
        }
        inertia
    }

    /// One row of the sum.
    #[inline(always)]
    pub(super) fn row(&self, row: usize, states: &States) -> Block {
        let inertia = self.masses.add_row(row, &states.inertial, Block::default());
        self.dampings.add_row(row, &states.viscous, inertia)
    }
}

/// A sparse matrix whose rows are kept as scalars where they are equal in all lanes.
///
/// Which rows these are changes no bit of a product: the order of the sum stays.
#[derive(Clone, Debug)]
struct Product {
    common: Runs<f64>,
    varied: Runs<Block>,
}

impl Product {
    fn new() -> Self {
        Self { common: Runs::new(), varied: Runs::new() }
    }

    /// Appends a row of columns, ascending, and values.
    fn push_row(&mut self, entries: &[(usize, Block)]) {
        let common = |&(column, value): &(usize, Block)| Some((column, value.uniform()?));
        if let Some(row) = entries.iter().map(common).collect::<Option<Vec<_>>>() {
            self.common.push_row(&row);
            self.varied.push_row(&[]);
        } else {
            self.common.push_row(&[]);
            self.varied.push_row(entries);
        }
    }

    /// `sum` plus the product of a row with a vector.
    #[inline(always)]
    fn add_row(&self, row: usize, vector: &[Block], sum: Block) -> Block {
        self.varied.add_row(row, vector, self.common.add_row(row, vector, sum))
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
