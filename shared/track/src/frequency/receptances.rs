//! The rail's receptances as values.

use super::by_state::StateReceptances;
use num_complex::Complex64;
use std::ops::Range;
use std::sync::Arc;

/// Receptances of the rail at a set of frequencies, in m/N.
#[derive(Clone, Debug)]
pub struct RailReceptances {
    /// Direct receptance of every rail node: `[frequency][node]`, zero where the rail is held.
    pub direct: Vec<Vec<Complex64>>,
    /// Receptances from a force at each rail seat to the nodes near it: `[frequency][sleeper]`. Empty if
    /// they were not requested.
    pub from_seats: Vec<Vec<SeatReceptances>>,
    /// Direct receptances in each state of a track with force laws. `None` if the track has only one
    /// state.
    pub by_state: Option<Arc<StateReceptances>>,
}

/// Receptances from a rail seat to the rail nodes near it, in m/N.
#[derive(Clone, Debug)]
pub struct SeatReceptances {
    /// The first of these nodes.
    pub first: usize,
    /// Receptance of the first node and of the nodes after it, zero where the rail is held.
    pub values: Vec<Complex64>,
}

impl SeatReceptances {
    /// The receptances at these nodes.
    pub fn at(&self, nodes: Range<usize>) -> &[Complex64] {
        &self.values[nodes.start - self.first..nodes.end - self.first]
    }
}
