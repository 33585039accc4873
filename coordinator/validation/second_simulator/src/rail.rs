//! The rail: a Timoshenko beam by finite differences on a staggered grid.
//!
//! This module contains the grid, the matrix of the beam and its internal forces. Displacements are at
//! the nodes, rotations in the cells between the nodes. Rail seats are nodes. Coordinates alternate:
//! node, cell, node, and so on.

use crate::band::Band;
use crate::scheme::{Motion, Weights};
use tracktwin_parameters::BeamSection;

/// A joint, a crack: a stretch of rail that bends more easily.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SoftRail {
    /// Middle in m.
    pub(crate) x_m: f64,
    /// Length in m.
    pub(crate) length_m: f64,
    /// What remains of the bending stiffness.
    pub(crate) factor: f64,
}

/// Weights of the displacement at a place: a node and its next, and the cells before and after these two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Row of the cell before the first node.
    row: usize,
    /// Of rows `row`, `row + 1`, `row + 3` and `row + 4`.
    weights: [f64; 4],
    /// Local flexibility in m/N that the grid does not have: a cell under shear.
    pub(crate) flexibility: f64,
}

impl Place {
    const ROWS: [usize; 4] = [0, 1, 3, 4];

    /// Displacement there, of values by row.
    pub(crate) fn of(&self, value: impl Fn(usize) -> f64) -> f64 {
        let terms = Self::ROWS.iter().zip(self.weights);
        terms.map(|(row, weight)| weight * value(self.row + row)).sum()
    }

    /// The row halfway to another place.
    pub(crate) fn middle(&self, other: &Self) -> usize {
        usize::midpoint(self.row, other.row) + 2
    }

    /// The rows with their weights.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let row = self.row;
        Self::ROWS.iter().zip(self.weights).map(move |(offset, weight)| (row + offset, weight))
    }
}

/// The beam in motion.
#[derive(Clone, Debug)]
pub(crate) struct Rail {
    /// Places of the nodes in m.
    nodes_m: Vec<f64>,
    /// Lengths of the cells in m.
    cells_m: Vec<f64>,
    /// `kappa G A` in N.
    shear: f64,
    /// Viscous damping of bending in s.
    damping_s: f64,
    /// Stiffness in N m/rad of every node's hinge; none at the ends.
    hinges: Vec<f64>,
    /// Springs between ground and rotation at nodes, in N m/rad and N m s/rad.
    clamps: Vec<(usize, f64, f64)>,
    /// Mass in kg, rotary inertia in kg m2, by row.
    mass: Vec<f64>,
    /// Damper to the ground in N s/m by node: the ends swallow a part of each wave.
    absorber: Vec<f64>,
    /// By row.
    pub(crate) motion: Motion,
    /// Displacement that stiffness sees, and velocity that damping sees, by row.
    known: Vec<[f64; 2]>,
}

impl Rail {
    /// A beam with these nodes; `absorber` gives the decay rate in 1/s at a place.
    pub(crate) fn new(
        section: &BeamSection,
        damping_s: f64,
        nodes_m: Vec<f64>,
        soft: &[SoftRail],
        absorber: impl Fn(f64) -> f64,
    ) -> Self {
        let cells_m: Vec<f64> = nodes_m.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let size = nodes_m.len() + cells_m.len();
        let tributary = |node: usize| {
            let before = node.checked_sub(1).map_or(0.0, |cell| cells_m[cell]);
            let after = cells_m.get(node).copied().unwrap_or(0.0);
            [before / 2.0, after / 2.0]
        };
        let mass_of = |node: usize| section.mass_per_length() * tributary(node).iter().sum::<f64>();
        let hinge = |node: usize| {
            let [before, after] = tributary(node);
            let range = [nodes_m[node] - before, nodes_m[node] + after];
            let softened: f64 = soft.iter().map(|soft| soft.excess_length_m(range)).sum();
            section.bending_stiffness() / (before + after + softened)
        };
        let last = nodes_m.len() - 1;
        let mass_by_row = |row: usize| match row % 2 {
            0 => mass_of(row / 2),
            _ => section.rotary_inertia_per_length() * cells_m[row / 2],
        };
        Self {
            shear: section.shear_stiffness(),
            damping_s,
            hinges: (0..=last).map(|n| if n == 0 || n == last { 0.0 } else { hinge(n) }).collect(),
            clamps: Vec::new(),
            mass: (0..size).map(mass_by_row).collect(),
            absorber: (0..=last).map(|n| mass_of(n) * absorber(nodes_m[n])).collect(),
            motion: Motion::rest(size),
            known: vec![[0.0; 2]; size],
            nodes_m,
            cells_m,
        }
    }

    /// Holds the rotation at a node by a spring and a damper.
    pub(crate) fn clamp(&mut self, node: usize, stiffness: f64, damping: f64) {
        self.clamps.push((node, stiffness, damping));
    }

    /// Number of rows.
    pub(crate) fn size(&self) -> usize {
        self.mass.len()
    }

    /// The node nearest to a place.
    pub(crate) fn nearest(&self, x_m: f64) -> usize {
        let above = self.nodes_m.partition_point(|&node| node < x_m).clamp(1, self.cells_m.len());
        let is_below = x_m - self.nodes_m[above - 1] < self.nodes_m[above] - x_m;
        if is_below { above - 1 } else { above }
    }

    /// Row of a node's displacement.
    pub(crate) const fn row(node: usize) -> usize {
        2 * node
    }

    /// Displacement and velocity of a node at the end of the step with the old acceleration.
    pub(crate) fn extrapolated(&self, node: usize) -> [f64; 2] {
        self.motion.extrapolated(Self::row(node))
    }

    /// Weights of the displacement at `x_m`, at least a cell away from both ends: a parabola whose
    /// curvature is that of the cells around.
    pub(crate) fn place(&self, x_m: f64) -> Place {
        let above = self.nodes_m.partition_point(|&node| node <= x_m);
        let cell = (above - 1).clamp(1, self.cells_m.len() - 2);
        let length = self.cells_m[cell];
        let share = (x_m - self.nodes_m[cell]) / length;
        let bulge = share * (1.0 - share);
        let around = length + f64::midpoint(self.cells_m[cell - 1], self.cells_m[cell + 1]);
        let curve = bulge * length * length / 2.0 / around;
        Place {
            row: 2 * cell - 1,
            weights: [curve, 1.0 - share, share, -curve],
            flexibility: bulge * length / self.shear,
        }
    }

    /// Weighted sum of mass, damping and stiffness.
    pub(crate) fn matrix(&self, weights: Weights) -> Band {
        let mut band = Band::zero(self.size());
        for (row, mass) in self.mass.iter().enumerate() {
            band.add(row, weights.mass * mass);
        }
        for (node, damper) in self.absorber.iter().enumerate() {
            band.add(Self::row(node), weights.damping * damper);
        }
        for (cell, length) in self.cells_m.iter().enumerate() {
            let strain = [-1.0 / length, -1.0, 1.0 / length];
            band.add_square(2 * cell, strain, weights.stiffness * self.shear * length);
        }
        let bending = weights.stiffness + weights.damping * self.damping_s;
        for node in 1..self.nodes_m.len() - 1 {
            band.add_square(2 * node - 1, [-1.0, 0.0, 1.0], bending * self.hinges[node]);
        }
        for &(node, stiffness, damping) in &self.clamps {
            let factor = weights.stiffness * stiffness + weights.damping * damping;
            band.add_square(2 * node - 1, [0.5, 0.0, 0.5], factor);
        }
        band
    }

    /// Sets the first of each pair of `sides` to what acts without the new accelerations.
    pub(crate) fn begin(&mut self, sides: &mut [[f64; 2]]) {
        for (row, known) in self.known.iter_mut().enumerate() {
            *known = [self.motion.known_displacement(row), self.motion.known_velocity(row)];
            sides[row][0] = -self.mass[row] * self.motion.known_acceleration(row);
        }
        for (cell, length) in self.cells_m.iter().enumerate() {
            let row = 2 * cell;
            let slope = (self.known[row + 2][0] - self.known[row][0]) / length;
            let force = self.shear * (slope - self.known[row + 1][0]);
            sides[row][0] += force - self.absorber[cell] * self.known[row][1];
            sides[row + 1][0] += force * length;
            sides[row + 2][0] -= force;
        }
        for node in 1..self.nodes_m.len() - 1 {
            let [before, after] = [self.known[2 * node - 1], self.known[2 * node + 1]];
            let bend = after[0] - before[0] + self.damping_s * (after[1] - before[1]);
            let moment = self.hinges[node] * bend;
            sides[2 * node - 1][0] += moment;
            sides[2 * node + 1][0] -= moment;
        }
        for &(node, stiffness, damping) in &self.clamps {
            let [before, after] = [self.known[2 * node - 1], self.known[2 * node + 1]];
            let moment =
                0.25 * (stiffness * (before[0] + after[0]) + damping * (before[1] + after[1]));
            sides[2 * node - 1][0] -= moment;
            sides[2 * node + 1][0] -= moment;
        }
    }
}

impl SoftRail {
    /// By how much longer a part of the rail would be if it were not softened and bent as easily.
    fn excess_length_m(&self, [from_m, to_m]: [f64; 2]) -> f64 {
        let half = self.length_m / 2.0;
        let overlap = to_m.min(self.x_m + half) - from_m.max(self.x_m - half);
        overlap.max(0.0) * (1.0 / self.factor - 1.0)
    }
}
