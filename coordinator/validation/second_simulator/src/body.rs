//! A body connected to the rail at one place: a sleeper with its support, or an absorber.
//!
//! This module eliminates the coordinates of the body, so that the matrix of the rail keeps its small
//! bandwidth.

use crate::scheme::Weights;
use crate::system::{Matrices, System};
use nalgebra::{DMatrix, DVector};

/// A small system whose last coordinate is the rail's displacement at a node.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// The rail's node.
    pub(crate) node: usize,
    /// With the rail's displacement as the last coordinate.
    pub(crate) system: System,
    /// Own coordinates.
    size: usize,
    elimination: Elimination,
    at_rest: Elimination,
    /// Own accelerations while the rail's is zero.
    free: Vec<f64>,
}

/// Own coordinates as functions of the rail's.
#[derive(Clone, Debug)]
struct Elimination {
    /// Inverse of the own part, row by row.
    inverse: Vec<f64>,
    /// The part between own coordinates and the rail.
    coupling: Vec<f64>,
    /// Own coordinates per coordinate of the rail, with the sign changed.
    follow: Vec<f64>,
    /// Coefficient of the reduced system at the coordinate of the rail.
    stiffness: f64,
}

impl Elimination {
    fn new(matrix: &DMatrix<f64>) -> Self {
        let size = matrix.nrows() - 1;
        let coupling: DVector<f64> = matrix.view((0, size), (size, 1)).column(0).into_owned();
        let own = matrix.view((0, 0), (size, size)).into_owned();
        let inverse = own.try_inverse().expect("a body is held by springs or has mass");
        let follow = &inverse * &coupling;
        Self {
            stiffness: matrix[(size, size)] - coupling.dot(&follow),
            inverse: inverse.transpose().as_slice().to_vec(),
            coupling: coupling.as_slice().to_vec(),
            follow: follow.as_slice().to_vec(),
        }
    }
}

impl Body {
    /// At rest under the rail's node.
    pub(crate) fn new(node: usize, matrices: &Matrices) -> Self {
        let size = matrices.mass.nrows() - 1;
        Self {
            node,
            system: System::new(matrices),
            size,
            elimination: Elimination::new(&matrices.combined(Weights::STEP)),
            at_rest: Elimination::new(&matrices.combined(Weights::REST)),
            free: vec![0.0; size],
        }
    }

    /// What the rail's equation gains: of a time step, and at rest.
    pub(crate) fn on_rail(&self) -> [f64; 2] {
        [self.elimination.stiffness, self.at_rest.stiffness]
    }

    /// Moves to rest under a rail that stands at this displacement.
    pub(crate) fn rest_under(&mut self, rail_m: f64) {
        for (displacement, follow) in
            self.system.motion.displacement.iter_mut().zip(&self.at_rest.follow)
        {
            *displacement = -follow * rail_m;
        }
        self.system.motion.displacement[self.size] = rail_m;
    }

    /// Solves for the own accelerations under `system.force`; returns the force on the rail.
    pub(crate) fn release(&mut self) -> f64 {
        let force = &self.system.force;
        let rows = self.elimination.inverse.chunks_exact(self.size.max(1));
        for (free, row) in self.free.iter_mut().zip(rows) {
            *free = dot(row, force);
        }
        force[self.size] - dot(&self.elimination.coupling, &self.free)
    }

    /// Ends the step with the rail's acceleration.
    pub(crate) fn advance(&mut self, rail: f64) {
        for (i, (free, follow)) in self.free.iter().zip(&self.elimination.follow).enumerate() {
            self.system.motion.advance(i, free - follow * rail);
        }
        self.system.motion.advance(self.size, rail);
    }
}

/// Product over the shorter of the two.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
