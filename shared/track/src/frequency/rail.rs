//! Receptances of the rail at all nodes, for a wheel at any node.
//!
//! The solver condenses the parts connected to the rail onto the rail, one after the other. A matrix of small
//! bandwidth remains. The solver computes only the required entries of its inverse. This is a hundred times
//! faster than a separate solution for each place with the same matrices.

use super::banded::{Banded, Inverse};
use super::lane::{LANES, Lane, omega};
use super::piece::{Piece, pieces};
use super::receptances::{RailReceptances, SeatReceptances};
use super::states::States;
use super::vectorized::vectorized;
use crate::model::{Matrices, TrackModel};
use num_complex::Complex64;
use rayon::prelude::*;
use std::ops::Range;

/// Partition of the matrices of a track into the rail and the pieces connected to it.
pub(super) struct Partition<'a> {
    pub(super) matrices: &'a Matrices,
    pub(super) rail_dofs: usize,
    width: usize,
    /// Row, column and place in the matrices of the rail's own entries, of the lower triangle.
    pub(super) rail: Vec<(usize, usize, usize)>,
    pub(super) pieces: Vec<Piece>,
}

impl RailReceptances {
    /// Computes the receptances of all rail nodes. With `reach`, the result also contains those from
    /// each rail seat to `reach` nodes on either side. At each node, force laws have the state that they
    /// have with the wheel at this node.
    ///
    /// Solves `K + i w C - w^2 M` on the model's own matrices, in the convention `exp(+i w t)`.
    pub fn new(model: &TrackModel, frequencies_hz: &[f64], reach: Option<usize>) -> Self {
        match States::new(model) {
            Some(states) => states.receptances(frequencies_hz, reach),
            None => Self::of_matrices(model, frequencies_hz, reach),
        }
    }

    /// Computes the receptances from the matrices of the model alone, independent of the position of the
    /// wheel.
    pub(super) fn of_matrices(
        model: &TrackModel,
        frequencies_hz: &[f64],
        reach: Option<usize>,
    ) -> Self {
        let partition = Partition::new(model);
        let nodes = deflections(model);
        let near = reach.map_or(Vec::new(), |reach| near_seats(model, reach));
        let solved: Vec<_> = frequencies_hz
            .par_chunks(LANES)
            .map(|chunk| {
                let lanes = vectorized(
                    #[inline(always)]
                    || partition.solve(omega(chunk), &nodes, &near),
                );
                (0..chunk.len()).map(|lane| lanes.unpack(lane, &near)).collect::<Vec<_>>()
            })
            .collect();
        let (direct, from_seats) = solved.into_iter().flatten().unzip();
        Self { direct, from_seats, by_state: None }
    }
}

/// Every rail seat with the nodes at most `reach` nodes from it.
pub(super) fn near_seats(model: &TrackModel, reach: usize) -> Vec<Near> {
    let layout = model.layout();
    let count = layout.rail_nodes_m().len();
    let near = |seat: usize| Near {
        seat,
        nodes: seat.saturating_sub(reach)..(seat + reach + 1).min(count),
    };
    layout.sleepers().iter().map(|sleeper| near(sleeper.rail_node)).collect()
}

/// Degree of freedom of the deflection of every rail node; `None` for held nodes.
pub(super) fn deflections(model: &TrackModel) -> Vec<Option<usize>> {
    let layout = model.layout();
    (0..layout.rail_nodes_m().len()).map(|node| layout.rail_node_dofs(node)[0]).collect()
}

/// Dynamic stiffness in N/m on the deflection of the rail at each rail seat: the sum of rail elements
/// and all parts connected to the rail. `[frequency][sleeper]`, zero where the rail is held.
///
/// For two tracks that differ only in their supports, the difference of the results is the difference of
/// the dynamic stiffness of the supports.
pub fn seat_stiffness(model: &TrackModel, frequencies_hz: &[f64]) -> Vec<Vec<Complex64>> {
    let partition = Partition::new(model);
    let layout = model.layout();
    let sleepers = layout.sleepers().iter();
    let seats: Vec<_> =
        sleepers.map(|sleeper| layout.rail_node_dofs(sleeper.rail_node)[0]).collect();
    let chunks = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
        let diagonal = vectorized(
            #[inline(always)]
            || partition.diagonal(&partition.dynamic_stiffness(omega(chunk))),
        );
        let at = |seat: &Option<usize>| seat.map_or(Lane::default(), |seat| diagonal[seat]);
        let lanes: Vec<Lane> = seats.iter().map(at).collect();
        (0..chunk.len()).map(move |lane| lanes.iter().map(|value| value.get(lane)).collect())
    });
    chunks.collect()
}

/// A rail seat's node, and the nodes near it.
pub(super) struct Near {
    pub(super) seat: usize,
    pub(super) nodes: Range<usize>,
}

impl Near {
    /// Receptances from the seat to the nodes near it, by the rail's inverse and that of the mirrored
    /// rail.
    #[inline(always)]
    fn receptances(
        &self,
        dofs: &[Option<usize>],
        [inverse, mirrored]: [&Inverse; 2],
        work: &mut [Lane],
    ) -> Vec<Lane> {
        let mut values = vec![Lane::default(); self.nodes.len()];
        let Some(seat) = dofs[self.seat] else { return values };
        let last = work.len() - 1;
        let (before, after) = (self.nodes.start..self.seat + 1, self.seat..self.nodes.end);
        // The seat itself is not held.
        let first = dofs[before.clone()].iter().flatten().next().map_or(seat, |first| *first);
        inverse.column_above(seat, first, work);
        for node in before {
            values[node - self.nodes.start] = dofs[node].map_or(Lane::default(), |dof| work[dof]);
        }
        let end = dofs[after.clone()].iter().flatten().next_back().map_or(seat, |end| *end);
        mirrored.column_above(last - seat, last - end, work);
        for node in after {
            let at = |dof: usize| work[last - dof];
            values[node - self.nodes.start] = dofs[node].map_or(Lane::default(), at);
        }
        values
    }
}

/// Results at [`LANES`] frequencies.
pub(super) struct Solved {
    direct: Vec<Lane>,
    from_seats: Vec<Vec<Lane>>,
}

impl Solved {
    /// From a seat on, a column of the inverse is one of the mirrored matrix, up to its diagonal.
    #[inline(always)]
    pub(super) fn new(
        inverse: &Inverse,
        mirrored: Option<&Inverse>,
        nodes: &[Option<usize>],
        near: &[Near],
    ) -> Self {
        let mut work = vec![Lane::default(); inverse.size()];
        let mut from_seats = Vec::with_capacity(near.len());
        for near in near {
            from_seats.push(match mirrored {
                Some(mirrored) => near.receptances(nodes, [inverse, mirrored], &mut work),
                None => Vec::new(),
            });
        }
        Self { direct: inverse.direct(nodes), from_seats }
    }

    pub(super) fn unpack(
        &self,
        lane: usize,
        near: &[Near],
    ) -> (Vec<Complex64>, Vec<SeatReceptances>) {
        let values = |lanes: &Vec<Lane>| lanes.iter().map(|value| value.get(lane)).collect();
        let of_seat = |(lanes, near): (&Vec<Lane>, &Near)| SeatReceptances {
            first: near.nodes.start,
            values: values(lanes),
        };
        let from_seats = self.from_seats.iter().zip(near).map(of_seat).collect();
        (values(&self.direct), from_seats)
    }
}

impl<'a> Partition<'a> {
    pub(super) fn new(model: &'a TrackModel) -> Self {
        let matrices = model.matrices();
        let rail_dofs = model.layout().rail_dofs();
        let mut pieces = pieces(matrices, rail_dofs);
        let mut rail = Vec::new();
        let mut local = vec![(0, 0); matrices.size()];
        for (number, piece) in pieces.iter().enumerate() {
            for (row, &dof) in piece.dofs.iter().enumerate() {
                local[dof] = (number, row);
            }
        }
        for (row, column, place) in matrices.places() {
            match (row < rail_dofs, column < rail_dofs) {
                (true, true) if column <= row => rail.push((row, column, place)),
                (false, false) => {
                    let ((number, row), (_, column)) = (local[row], local[column]);
                    if column <= row {
                        let piece = &mut pieces[number];
                        piece.width = piece.width.max(row - column);
                        piece.inner.push((row, column, place));
                    }
                }
                (true, false) => {
                    let (number, local_row) = local[column];
                    pieces[number].touch(row, local_row, place);
                }
                _ => {}
            }
        }
        let own = rail.iter().map(|&(row, column, _)| row - column).max().unwrap_or(0);
        let width = pieces.iter().map(Piece::reach).max().unwrap_or(0).max(own);
        Self { matrices, rail_dofs, width, rail, pieces }
    }

    /// The value of `K + i w C - w^2 M` at a place of the matrices.
    #[inline(always)]
    pub(super) fn dynamic_stiffness(&self, omega: impl Fn(usize) -> f64) -> impl Fn(usize) -> Lane {
        #[inline(always)]
        move |place: usize| {
            let (mass, damping, stiffness) = (
                self.matrices.mass()[place],
                self.matrices.damping()[place],
                self.matrices.stiffness()[place],
            );
            Lane::from_parts(
                |lane| stiffness - omega(lane) * omega(lane) * mass,
                |lane| omega(lane) * damping,
            )
        }
    }

    /// The dynamic stiffness of the rail with all connected pieces.
    #[inline(always)]
    fn rail(&self, value: &impl Fn(usize) -> Lane) -> Banded {
        let mut rail = Banded::zeros(self.rail_dofs, self.width);
        for &(row, column, place) in &self.rail {
            rail.add(row, column, value(place));
        }
        for piece in &self.pieces {
            piece.condense(value, |row, column, value| rail.add(row, column, value));
        }
        rail
    }

    /// The diagonal of the dynamic stiffness of the rail with all connected pieces.
    #[inline(always)]
    fn diagonal(&self, value: &impl Fn(usize) -> Lane) -> Vec<Lane> {
        let mut diagonal = vec![Lane::default(); self.rail_dofs];
        let mut add = |row: usize, column: usize, value: Lane| {
            if row == column {
                diagonal[row] = diagonal[row] + value;
            }
        };
        for &(row, column, place) in self.rail.iter().filter(|(row, column, _)| row == column) {
            add(row, column, value(place));
        }
        for piece in &self.pieces {
            piece.condense(value, &mut add);
        }
        diagonal
    }

    /// The inverse of the dynamic stiffness of the rail with all connected pieces.
    #[inline(always)]
    pub(super) fn inverted(&self, omega: impl Fn(usize) -> f64) -> Inverse {
        Inverse::new(self.rail(&self.dynamic_stiffness(omega)))
    }

    /// The inverse of the dynamic stiffness of the rail, and that of the mirrored rail.
    #[inline(always)]
    pub(super) fn inverted_both(&self, omega: impl Fn(usize) -> f64) -> [Inverse; 2] {
        let rail = self.rail(&self.dynamic_stiffness(omega));
        let mirrored = rail.mirrored();
        [Inverse::new(rail), Inverse::new(mirrored)]
    }

    /// `nodes` are the [`deflections`].
    #[inline(always)]
    fn solve(
        &self,
        omega: impl Fn(usize) -> f64,
        nodes: &[Option<usize>],
        near: &[Near],
    ) -> Solved {
        if near.is_empty() {
            return Solved::new(&self.inverted(omega), None, nodes, near);
        }
        let [inverse, mirrored] = self.inverted_both(omega);
        Solved::new(&inverse, Some(&mirrored), nodes, near)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::extension::ExtensionInstance;
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{Mesh, Support};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    pub(in crate::frequency) const SPANS: usize = 9;

    pub(in crate::frequency) fn track() -> TrackModel {
        track_with(&[])
    }

    /// The same with further extensions.
    pub(in crate::frequency) fn track_with(further: &[ExtensionInstance]) -> TrackModel {
        let supports = (1..SPANS)
            .map(|sleeper| {
                let nominal = Support::from(&ParameterSet::nominal());
                let scale = 1.0 + 0.1 * sleeper as f64;
                Support { railpad_stiffness: nominal.railpad_stiffness * scale, ..nominal }
            })
            .collect::<Vec<_>>();
        let (design, mesh) = (TrackDesign::v_track(), Mesh::uniform(SPANS, 4, 4));
        let bolts = ExtensionInstance::new("sleeper_bolt").with("stiffness_N_per_m", 3e7);
        let extensions: Vec<_> = std::iter::once(&bolts.on([2, 5]))
            .chain(further)
            .map(|extension| extension.build(&design, SPANS).unwrap())
            .collect();
        TrackModel::build(&design, &mesh, &supports, &extensions).unwrap()
    }

    #[test]
    fn receptances_are_those_of_the_general_solver() {
        let track = track();
        // More than one group of lanes, and one that is not full.
        let frequencies: Vec<f64> = (0..11).map(|k| 60.0 * 1.5_f64.powi(k)).collect();
        let fast = RailReceptances::new(&track, &frequencies, Some(200));
        let layout = track.layout();
        let seat = layout.sleepers()[3].position_m;
        for node in [5, 16, 30] {
            let place = ReceptancePoint::Rail(layout.rail_nodes_m()[node]);
            let direct = receptance(&track, place, place, &frequencies).unwrap();
            let cross =
                receptance(&track, ReceptancePoint::Rail(seat), place, &frequencies).unwrap();
            for index in 0..frequencies.len() {
                let errors = [
                    fast.direct[index][node] - direct[index],
                    fast.from_seats[index][3].values[node] - cross[index],
                ];
                // Two eliminations without and with pivoting: rounding, amplified by the condition.
                for error in errors {
                    assert!(error.norm() < 1e-9 * direct[index].norm(), "{node} {index} {error}");
                }
            }
        }
    }

    #[test]
    fn supports_act_on_the_rail_as_their_dynamic_stiffness_says() {
        let frequencies = [50.0, 400.0, 1000.0, 3100.0];
        let of = |support: Support| {
            let mesh = Mesh::uniform(2, 4, 8);
            let track = TrackModel::build(&TrackDesign::v_track(), &mesh, &[support], &[]).unwrap();
            let direct = RailReceptances::new(&track, &frequencies, None).direct;
            (direct, seat_stiffness(&track, &frequencies))
        };
        let support = Support::from(&ParameterSet::nominal());
        let bare = Support { railpad_stiffness: 0.0, railpad_damping: 0.0, ..support };
        let ((with, full), (without, rail)) = (of(support), of(bare));
        for index in 0..frequencies.len() {
            let stiffness = full[index][0] - rail[index][0];
            let expected = 1.0 / (1.0 / without[index][4] + stiffness);
            let error = (with[index][4] - expected).norm() / expected.norm();
            // The rail's own stiffness, a hundred times the support's, cancels.
            assert!(error < 1e-9, "{index}: {error}");
        }
    }
}
