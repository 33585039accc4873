//! A half sleeper: rigid bars, hinges and shear between lumps, ballast at some or all of their ends.
//!
//! This module builds the matrices of the body under a rail seat: sleeper, railpad, clamp, bolt, ballast
//! and subgrade layer.

use crate::seat::Seat;
use crate::system::Matrices;
use nalgebra::DMatrix;
use tracktwin_parameters::SleeperDesign;

/// Bars of a half sleeper.
const BARS: usize = 8;
/// Viscous damping in s of a sleeper of steel, and of concrete or wood: a loss factor of 0.6 % at 700 Hz.
const STEEL_DAMPING_S: f64 = 5e-7;
const LINE_DAMPING_S: f64 = 1.5e-6;
/// Share of a line's half sleeper, from the middle on, under which the ballast is softer.
const MIDDLE: f64 = 0.25;
/// Damping per stiffness in s of clamps and bolts: a loss factor of 5 % at 1 kHz.
pub(crate) const FASTENER_DAMPING_S: f64 = 8e-6;
/// Mass in kg between spring and damper of a relaxing branch, for a motion to integrate.
const BRANCH_KG: f64 = 1e-3;
/// Length of a crack in m on the rig, the middle under the rail, and on a line.
const RIG_CRACK_M: f64 = 0.02;
const LINE_CRACK_M: f64 = 0.05;

/// Coordinate of the layer under the ballast, where there is one.
pub(crate) const LAYER: usize = BARS + 1;

/// Bars, rail seat and ballast of a half sleeper. Node 0 lies in the middle of the sleeper, which has no slope.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    /// Lengths of the bars in m.
    bars_m: [f64; BARS],
    /// Node under the rail.
    pub(crate) seat: usize,
    /// Nodes that stand on the ballast, with the share of its stiffness.
    pub(crate) ballast: Vec<(usize, f64)>,
    damping_s: f64,
    /// Whether bars have rotary inertia. The rig's sleepers are slender: theirs lowers the second mode by 0.5 %.
    is_thick: bool,
    /// Length of a crack in m on the modelled side of its middle.
    crack_m: f64,
}

impl Layout {
    /// Of a design; `middle_bed` is the stiffness of the ballast under the middle over that beside the rails.
    pub(crate) fn new(design: &SleeperDesign, middle_bed: f64) -> Self {
        let SleeperDesign { half_length_m, rail_seat_m, .. } = *design;
        if rail_seat_m == 0.0 {
            return Self {
                bars_m: [half_length_m / BARS as f64; BARS],
                seat: 0,
                ballast: [1, 3, 5, 7].map(|node| (node, 0.25)).into(),
                damping_s: STEEL_DAMPING_S,
                is_thick: false,
                crack_m: RIG_CRACK_M / 2.0,
            };
        }
        // The rail seat is a node.
        let share = rail_seat_m / half_length_m;
        let seat = ((share * BARS as f64).round() as usize).clamp(1, BARS - 1);
        let inner_m = rail_seat_m / seat as f64;
        let outer_m = (half_length_m - rail_seat_m) / (BARS - seat) as f64;
        let bars_m = std::array::from_fn(|bar| if bar < seat { inner_m } else { outer_m });
        let ballast = bed(&bars_m, middle_bed);
        let damping_s = LINE_DAMPING_S;
        Self { bars_m, seat, ballast, damping_s, is_thick: true, crack_m: LINE_CRACK_M }
    }
}

/// Shares of the ballast by node: every bar stands with each half on the node there.
fn bed(bars_m: &[f64; BARS], middle_bed: f64) -> Vec<(usize, f64)> {
    let middle_m = MIDDLE * bars_m.iter().sum::<f64>();
    let mut weights = [0.0; BARS + 1];
    let mut from_m = 0.0;
    for (bar, length) in bars_m.iter().enumerate() {
        for (node, begin_m) in [(bar, from_m), (bar + 1, from_m + length / 2.0)] {
            let soft_m = (middle_m - begin_m).clamp(0.0, length / 2.0);
            weights[node] += middle_bed * soft_m + (length / 2.0 - soft_m);
        }
        from_m += length;
    }
    let whole: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / whole).enumerate().collect()
}

/// Matrices of all that is under a rail seat; the rail's displacement is the last coordinate.
pub(crate) fn matrices(seat: &Seat, design: &SleeperDesign, layout: &Layout) -> Matrices {
    let first_branch = LAYER + usize::from(seat.layer.is_some());
    let rail = first_branch + seat.branches.len();
    let under = layout.seat;
    let mut matrices = beam(seat, design, layout, rail + 1);
    let [stiffness, damping] = seat.pad;
    matrices.connect(under, Some(rail), stiffness, damping);
    matrices.connect(under, Some(rail), seat.clamp[0], FASTENER_DAMPING_S * seat.clamp[0]);
    for (index, &[stiffness, time_s]) in seat.branches.iter().enumerate() {
        let branch = first_branch + index;
        matrices.mass[(branch, branch)] = BRANCH_KG;
        matrices.connect(branch, Some(rail), stiffness, 0.0);
        matrices.connect(branch, Some(under), 0.0, stiffness * time_s);
    }
    for node in [BARS - 1, BARS] {
        matrices.connect(node, None, seat.bolt / 2.0, FASTENER_DAMPING_S * seat.bolt / 2.0);
    }
    if let Some([mass, stiffness, damping]) = seat.layer {
        matrices.mass[(LAYER, LAYER)] = mass;
        matrices.connect(LAYER, None, stiffness, damping);
    }
    if seat.gap_m.is_none() {
        for &(node, share) in &layout.ballast {
            let [stiffness, damping] = seat.ballast.map(|whole| whole * share);
            matrices.connect(node, seat.layer.map(|_| LAYER), stiffness, damping);
        }
    }
    matrices
}

/// The sleeper alone, as the first of `size` coordinates: its rotation is held in the middle, its end is free.
fn beam(seat: &Seat, design: &SleeperDesign, layout: &Layout, size: usize) -> Matrices {
    let section = &design.section;
    let bars_m = &layout.bars_m;
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
    for (i, bar) in bars_m.iter().enumerate() {
        add(&[(i, -1.0 / bar), (nodes + i, -1.0), (i + 1, 1.0 / bar)], shear * bar);
    }
    let softened = |node: usize| {
        let is_here = node == layout.seat;
        if is_here { layout.crack_m * (1.0 / seat.crack - 1.0) } else { 0.0 }
    };
    add(&[(nodes, 1.0)], seat.ei / (bars_m[0] / 2.0 + softened(0)));
    for i in 1..BARS {
        let between = f64::midpoint(bars_m[i - 1], bars_m[i]);
        add(&[(nodes + i - 1, -1.0), (nodes + i, 1.0)], seat.ei / (between + softened(i)));
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
    matrices.damping.view_mut((0, 0), (nodes, nodes)).copy_from(&(bending * layout.damping_s));
    // Masses shared between neighbours take away the error of second order that hinges make.
    for (i, bar) in bars_m.iter().enumerate() {
        let mass = section.mass_per_length() * bar;
        for (a, b) in [(i, i), (i + 1, i + 1), (i, i + 1), (i + 1, i)] {
            matrices.mass[(a, b)] += mass / if a == b { 3.0 } else { 6.0 };
        }
        if layout.is_thick {
            // A bar turns with its ends.
            let inertia = section.rotary_inertia_per_length() / bar;
            for (a, b) in [(i, i), (i + 1, i + 1), (i, i + 1), (i + 1, i)] {
                matrices.mass[(a, b)] += if a == b { inertia } else { -inertia };
            }
        }
    }
    matrices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seat::testing::seat;
    use std::f64::consts::TAU;
    use tracktwin_parameters::{Preset, TrackDesign};

    /// Frequencies in Hz of the rig's sleeper alone, ascending.
    fn frequencies(seat: &Seat) -> Vec<f64> {
        frequencies_of(seat, &TrackDesign::v_track().sleeper)
    }

    fn frequencies_of(seat: &Seat, design: &SleeperDesign) -> Vec<f64> {
        let free = beam(seat, design, &Layout::new(design, 1.0), BARS + 1);
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
    /// Frequency in Hz, between two, of a free Timoshenko beam without slope in its middle: its differential
    /// equation from the middle to the free end, where moment and shear force are zero.
    fn exact_hz(design: &SleeperDesign, ei: f64, [mut low, mut high]: [f64; 2]) -> f64 {
        let section = &design.section;
        let shear = section.shear_stiffness() * ei / section.bending_stiffness();
        let (mass, inertia) = (section.mass_per_length(), section.rotary_inertia_per_length());
        let steps = 4000;
        let step = design.half_length_m / f64::from(steps);
        let at_end = |square: f64, mut y: [f64; 4]| {
            // Displacement, slope, moment, shear force; the midpoint rule.
            let change = |[w, slope, moment, force]: [f64; 4]| {
                let turning = -force - square * inertia * slope;
                [slope + force / shear, moment / ei, turning, -square * mass * w]
            };
            let moved =
                |y: [f64; 4], by: [f64; 4], step: f64| std::array::from_fn(|i| y[i] + step * by[i]);
            for _ in 0..steps {
                let middle = moved(y, change(y), step / 2.0);
                y = moved(y, change(middle), step);
            }
            y
        };
        let determinant = |hz: f64| {
            let square = (TAU * hz).powi(2);
            let [a, b] = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1e6, 0.0]].map(|y| at_end(square, y));
            a[2] * b[3] - a[3] * b[2]
        };
        let is_positive = determinant(low) > 0.0;
        assert_ne!(is_positive, determinant(high) > 0.0);
        for _ in 0..30 {
            let middle = f64::midpoint(low, high);
            if (determinant(middle) > 0.0) == is_positive { low = middle } else { high = middle }
        }
        low
    }

    #[test]
    fn bending_modes_of_a_line_are_those_of_a_free_beam_and_its_ballast_is_whole() {
        let design = Preset::Concrete60E1.design().sleeper;
        let seat = Seat { ei: 6.1e6, ..seat() };
        let found = frequencies_of(&seat, &design);
        for (mode, range_hz) in [(1, [60.0, 200.0]), (2, [450.0, 800.0])] {
            let exact = exact_hz(&design, seat.ei, range_hz);
            let deviation = found[mode] / exact - 1.0;
            // Bars turn with their ends, without the angle of shear.
            assert!(deviation.abs() < 0.01, "mode {mode}: {} and {exact} Hz", found[mode]);
        }
        let layout = Layout::new(&design, 0.5);
        assert!((layout.ballast.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-12);
        let seat_m: f64 = layout.bars_m[..layout.seat].iter().sum();
        assert!((seat_m - 0.758).abs() < 1e-12, "{seat_m}");
    }
}
