//! Small systems of masses, springs and dampers.
//!
//! This module contains matrices, motion and time step of the systems. Sleepers and vehicle use these
//! systems.

use crate::scheme::{Motion, Weights};
use nalgebra::DMatrix;

/// Masses on springs and dampers, as matrices.
#[derive(Clone, Debug)]
pub(crate) struct Matrices {
    /// In kg.
    pub(crate) mass: DMatrix<f64>,
    /// In N s/m.
    pub(crate) damping: DMatrix<f64>,
    /// In N/m.
    pub(crate) stiffness: DMatrix<f64>,
}

impl Matrices {
    /// Of this many coordinates, without anything on them.
    pub(crate) fn zero(size: usize) -> Self {
        let zero = DMatrix::zeros(size, size);
        Self { mass: zero.clone(), damping: zero.clone(), stiffness: zero }
    }

    /// A spring and a damper between two coordinates, or between one and the ground.
    pub(crate) fn connect(&mut self, a: usize, b: Option<usize>, stiffness: f64, damping: f64) {
        for (matrix, value) in [(&mut self.stiffness, stiffness), (&mut self.damping, damping)] {
            matrix[(a, a)] += value;
            if let Some(b) = b {
                matrix[(b, b)] += value;
                matrix[(a, b)] -= value;
                matrix[(b, a)] -= value;
            }
        }
    }

    /// Weighted sum.
    pub(crate) fn combined(&self, weights: Weights) -> DMatrix<f64> {
        &self.mass * weights.mass
            + &self.damping * weights.damping
            + &self.stiffness * weights.stiffness
    }
}

/// A system in motion.
#[derive(Clone, Debug)]
pub(crate) struct System {
    /// Number of coordinates.
    size: usize,
    /// `[mass, damping, stiffness]` of every pair of coordinates, row by row.
    elements: Vec<[f64; 3]>,
    /// How it moves.
    pub(crate) motion: Motion,
    /// `[acceleration, velocity, displacement]` that count already in a step.
    known: Vec<[f64; 3]>,
    /// Forces that the step starts from.
    pub(crate) force: Vec<f64>,
}

impl System {
    /// At rest.
    pub(crate) fn new(matrices: &Matrices) -> Self {
        let size = matrices.mass.nrows();
        let pairs = (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
        let of = |at| [matrices.mass[at], matrices.damping[at], matrices.stiffness[at]];
        Self {
            size,
            elements: pairs.map(of).collect(),
            motion: Motion::rest(size),
            known: vec![[0.0; 3]; size],
            force: vec![0.0; size],
        }
    }

    /// Sets `force` to what inertia, dampers and springs exert without the new accelerations.
    pub(crate) fn begin(&mut self) {
        for (i, known) in self.known.iter_mut().enumerate() {
            *known = [
                self.motion.known_acceleration(i),
                self.motion.known_velocity(i),
                self.motion.known_displacement(i),
            ];
        }
        for (force, row) in self.force.iter_mut().zip(self.elements.chunks_exact(self.size)) {
            let mut sum = [0.0; 3];
            for (element, known) in row.iter().zip(&self.known) {
                for kind in 0..3 {
                    sum[kind] += element[kind] * known[kind];
                }
            }
            *force = -(sum[0] + sum[1] + sum[2]);
        }
    }
}
