//! A half sleeper: rigid bars, hinges and shear between lumps, ballast at four points.
//!
//! This module builds the matrices of the body under a rail seat: sleeper, railpad, clamp, bolt, ballast
//! and subgrade layer.

use crate::seat::Seat;
use crate::system::Matrices;
use nalgebra::DMatrix;
use tracktwin_parameters::SleeperDesign;

/// Bars of a half sleeper.
const BARS: usize = 8;
/// Nodes that stand on the ballast, each on a quarter of it.
pub(crate) const BALLAST_NODES: [usize; 4] = [1, 3, 5, 7];
/// Viscous damping of the sleeper's steel in s.
const STEEL_DAMPING_S: f64 = 5e-7;
/// Damping per stiffness in s of clamps and bolts: a loss factor of 5 % at 1 kHz.
pub(crate) const FASTENER_DAMPING_S: f64 = 8e-6;
/// Mass in kg between spring and damper of a relaxing branch, for a motion to integrate.
const BRANCH_KG: f64 = 1e-3;
/// Length of a cracked sleeper in m, the middle under the rail.
const CRACK_M: f64 = 0.02;

/// Coordinate under the rail.
pub(crate) const SEAT: usize = 0;
/// Coordinate of the layer under the ballast, where there is one.
pub(crate) const LAYER: usize = BARS + 1;

/// Matrices of all that is under a rail seat; the rail's displacement is the last coordinate.
pub(crate) fn matrices(seat: &Seat, design: &SleeperDesign) -> Matrices {
    let first_branch = LAYER + usize::from(seat.layer.is_some());
    let rail = first_branch + seat.branches.len();
    let mut matrices = beam(seat, design, rail + 1);
    let [stiffness, damping] = seat.pad;
    matrices.connect(SEAT, Some(rail), stiffness, damping);
    matrices.connect(SEAT, Some(rail), seat.clamp[0], FASTENER_DAMPING_S * seat.clamp[0]);
    for (index, &[stiffness, time_s]) in seat.branches.iter().enumerate() {
        let branch = first_branch + index;
        matrices.mass[(branch, branch)] = BRANCH_KG;
        matrices.connect(branch, Some(rail), stiffness, 0.0);
        matrices.connect(branch, Some(SEAT), 0.0, stiffness * time_s);
    }
    for node in [BARS - 1, BARS] {
        matrices.connect(node, None, seat.bolt / 2.0, FASTENER_DAMPING_S * seat.bolt / 2.0);
    }
    if let Some([mass, stiffness, damping]) = seat.layer {
        matrices.mass[(LAYER, LAYER)] = mass;
        matrices.connect(LAYER, None, stiffness, damping);
    }
    if seat.gap_m.is_none() {
        let [stiffness, damping] = seat.ballast.map(|whole| whole / BALLAST_NODES.len() as f64);
        for node in BALLAST_NODES {
            matrices.connect(node, seat.layer.map(|_| LAYER), stiffness, damping);
        }
    }
    matrices
}

/// The sleeper alone, as the first of `size` coordinates: its rotation is held under the rail, its end is free.
fn beam(seat: &Seat, design: &SleeperDesign, size: usize) -> Matrices {
    let section = &design.section;
    let bar = design.half_length_m / BARS as f64;
    let shear = section.shear_stiffness() * seat.ei / section.bending_stiffness();
    let nodes = BARS + 1;
    // Displacements of the nodes, then rotations of the bars.
    let mut stiffness = DMatrix::zeros(nodes + BARS, nodes + BARS);
    let mut add = |strain: &[(usize, f64)], factor: f64| {
        for &(i, a) in strain {
            for &(j, b) in strain {
                stiffness[(i, j)] += factor * a * b;
            }
        }
    };
    for i in 0..BARS {
        add(&[(i, -1.0 / bar), (nodes + i, -1.0), (i + 1, 1.0 / bar)], shear * bar);
    }
    let cracked = CRACK_M / 2.0 * (1.0 / seat.crack - 1.0);
    add(&[(nodes, 1.0)], seat.ei / (bar / 2.0 + cracked));
    for i in 1..BARS {
        add(&[(nodes + i - 1, -1.0), (nodes + i, 1.0)], seat.ei / bar);
    }
    let part = |row: usize, column: usize, rows: usize, columns: usize| -> DMatrix<f64> {
        stiffness.view((row, column), (rows, columns)).into_owned()
    };
    let coupling = part(0, nodes, nodes, BARS);
    let turning =
        part(nodes, nodes, BARS, BARS).try_inverse().expect("every bar is held by hinges");
    let bending = part(0, 0, nodes, nodes) - &coupling * turning * coupling.transpose();

    let mut matrices = Matrices::zero(size);
    matrices.stiffness.view_mut((0, 0), (nodes, nodes)).copy_from(&bending);
    matrices.damping.view_mut((0, 0), (nodes, nodes)).copy_from(&(bending * STEEL_DAMPING_S));
    // Masses shared between neighbours take away the error of second order that hinges make.
    let mass = section.mass_per_length() * bar;
    for i in 0..BARS {
        for (a, b) in [(i, i), (i + 1, i + 1), (i, i + 1), (i + 1, i)] {
            matrices.mass[(a, b)] += mass / if a == b { 3.0 } else { 6.0 };
        }
    }
    matrices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seat::testing::seat;
    use std::f64::consts::TAU;
    use tracktwin_parameters::TrackDesign;

    /// Frequencies in Hz of the sleeper alone, ascending.
    fn frequencies(seat: &Seat) -> Vec<f64> {
        let design = TrackDesign::v_track().sleeper;
        let free = beam(seat, &design, BARS + 1);
        let lower = free.mass.cholesky().unwrap().l().try_inverse().unwrap();
        let squares = (&lower * free.stiffness * lower.transpose()).symmetric_eigenvalues();
        let mut found: Vec<f64> = squares.iter().map(|v| v.max(0.0).sqrt() / TAU).collect();
        found.sort_by(f64::total_cmp);
        found
    }

    #[test]
    fn bending_modes_are_those_of_a_free_beam() {
        let seat = seat();
        let found = frequencies(&seat);
        let per_length = TrackDesign::v_track().sleeper.section.mass_per_length();
        assert!(found[0] < 1.0, "{found:?}");
        // Half of a free-free beam; shear lowers the modes by 0.3 % and 1.6 %.
        for (mode, root, shear) in [(1, 2.365_020, 0.003), (2, 5.497_804, 0.016)] {
            let closed = (root / 0.24_f64).powi(2) * (seat.ei / per_length).sqrt() / TAU;
            let deviation = found[mode] / closed - 1.0 + shear;
            assert!(deviation.abs() < 0.006, "mode {mode}: {} for {closed} Hz", found[mode]);
        }
    }

    #[test]
    fn a_crack_lowers_the_first_bending_mode() {
        let [whole, cracked] = [1.0, 0.3].map(|crack| frequencies(&Seat { crack, ..seat() })[1]);
        assert!(cracked < 0.97 * whole, "{cracked} and {whole}");
    }
}
