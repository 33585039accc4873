//! The rail's receptances everywhere at once, for a wheel that may stand at any node.
//!
//! Whatever hangs on the rail is condensed onto it, piece by piece: what is left is a narrow band,
//! whose inverse is taken only where it is asked for. A hundred times faster than solving for one
//! place after the other, on the same matrices.

use super::lane::{Banded, LANES, Lane};
use super::receptances::RailReceptances;
use super::states::States;
use crate::model::{Matrices, TrackModel};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;

/// Degrees of freedom off the rail that hang together, such as a sleeper's.
struct Piece {
    /// Its degrees of freedom, the last ones next to the rail.
    dofs: Vec<usize>,
    width: usize,
    /// Places in the matrices, with local row and column, of the lower triangle.
    inner: Vec<(usize, usize, usize)>,
    /// Rail degrees of freedom that it touches, each with local rows and places.
    touched: Vec<(usize, Vec<(usize, usize)>)>,
}

/// How the matrices of a track come apart into the rail and what hangs on it.
pub(super) struct Partition<'a> {
    matrices: &'a Matrices,
    pub(super) rail_dofs: usize,
    width: usize,
    rail: Vec<(usize, usize, usize)>,
    pieces: Vec<Piece>,
}

impl RailReceptances {
    /// Works them out, with those from every rail seat if `from_seats`: at each node those of the
    /// track as it is while the wheel stands there.
    ///
    /// Solves `K + i w C - w^2 M` on the model's own matrices, in the convention `exp(+i w t)`.
    pub fn new(model: &TrackModel, frequencies_hz: &[f64], from_seats: bool) -> Self {
        let of = |track: &TrackModel| Self::of_matrices(track, frequencies_hz, from_seats);
        match States::new(model) {
            Some(states) => states.mix(of),
            None => of(model),
        }
    }

    fn of_matrices(model: &TrackModel, frequencies_hz: &[f64], from_seats: bool) -> Self {
        let partition = Partition::new(model);
        let layout = model.layout();
        let nodes: Vec<_> =
            (0..layout.rail_nodes_m().len()).map(|node| layout.rail_node_dofs(node)[0]).collect();
        let sleepers = if from_seats { layout.sleepers() } else { &[] };
        let seats: Vec<_> = sleepers.iter().map(|sleeper| nodes[sleeper.rail_node]).collect();
        let solved: Vec<_> = frequencies_hz
            .par_chunks(LANES)
            .map(|chunk| {
                let omega = |lane: usize| TAU * chunk[lane.min(chunk.len() - 1)];
                let lanes = pulp::Arch::new().dispatch(|| partition.solve(omega, &nodes, &seats));
                (0..chunk.len()).map(|lane| lanes.unpack(lane)).collect::<Vec<_>>()
            })
            .collect();
        let (direct, from_seats) = solved.into_iter().flatten().unzip();
        Self { direct, from_seats }
    }
}

/// Dynamic stiffness in N/m that acts on the rail's deflection at each rail seat, rail elements and
/// whatever hangs on the rail together: `[frequency][sleeper]`, zero where the rail is held.
///
/// Of two tracks that differ in nothing but supports, the difference is that of the supports'
/// dynamic stiffness.
pub fn seat_stiffness(model: &TrackModel, frequencies_hz: &[f64]) -> Vec<Vec<Complex64>> {
    let partition = Partition::new(model);
    let layout = model.layout();
    let sleepers = layout.sleepers().iter();
    let seats: Vec<_> =
        sleepers.map(|sleeper| layout.rail_node_dofs(sleeper.rail_node)[0]).collect();
    let chunks = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
        let omega = |lane: usize| TAU * chunk[lane.min(chunk.len() - 1)];
        let rail =
            pulp::Arch::new().dispatch(|| partition.rail(&partition.dynamic_stiffness(omega)));
        let at = |seat: &Option<usize>| seat.map_or(Lane::default(), |seat| rail.diagonal(seat));
        let lanes: Vec<Lane> = seats.iter().map(at).collect();
        (0..chunk.len()).map(move |lane| lanes.iter().map(|value| value.get(lane)).collect())
    });
    chunks.collect()
}

/// What is known at [`LANES`] frequencies.
struct Solved {
    direct: Vec<Lane>,
    from_seats: Vec<Vec<Lane>>,
}

impl Solved {
    fn unpack(&self, lane: usize) -> (Vec<Complex64>, Vec<Vec<Complex64>>) {
        let values = |lanes: &Vec<Lane>| lanes.iter().map(|value| value.get(lane)).collect();
        (values(&self.direct), self.from_seats.iter().map(values).collect())
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
    fn dynamic_stiffness(&self, omega: impl Fn(usize) -> f64) -> impl Fn(usize) -> Lane {
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

    /// The rail with all that hangs on it.
    #[inline(always)]
    fn rail(&self, value: &impl Fn(usize) -> Lane) -> Banded {
        let mut rail = Banded::zeros(self.rail_dofs, self.width);
        for &(row, column, place) in &self.rail {
            rail.add(row, column, value(place));
        }
        for piece in &self.pieces {
            piece.condense(value, &mut rail);
        }
        rail
    }

    /// The rail's factor, and its inverse in the band.
    #[inline(always)]
    pub(super) fn inverted(&self, omega: impl Fn(usize) -> f64) -> (Banded, Banded) {
        let mut rail = self.rail(&self.dynamic_stiffness(omega));
        rail.factor();
        let mut inverse = Banded::zeros(self.rail_dofs, self.width);
        rail.selected_inverse(&mut inverse);
        (rail, inverse)
    }

    #[inline(always)]
    fn solve(
        &self,
        omega: impl Fn(usize) -> f64,
        nodes: &[Option<usize>],
        seats: &[Option<usize>],
    ) -> Solved {
        let (rail, inverse) = self.inverted(omega);
        let free = |dof: &Option<usize>| dof.map_or(Lane::default(), |dof| inverse.diagonal(dof));
        let direct = nodes.iter().map(free).collect();
        let column = |seat: &Option<usize>| {
            let mut column = vec![Lane::default(); self.rail_dofs];
            if let Some(seat) = *seat {
                column[seat] = Lane::real(1.0);
                rail.forward(&mut column, seat);
                rail.backward(&mut column);
            }
            nodes.iter().map(|dof| dof.map_or(Lane::default(), |dof| column[dof])).collect()
        };
        Solved { direct, from_seats: seats.iter().map(column).collect() }
    }
}

impl Piece {
    fn touch(&mut self, rail_dof: usize, local_row: usize, place: usize) {
        match self.touched.iter_mut().find(|(dof, _)| *dof == rail_dof) {
            Some((_, entries)) => entries.push((local_row, place)),
            None => self.touched.push((rail_dof, vec![(local_row, place)])),
        }
    }

    /// How far apart the rail's degrees of freedom are that it joins.
    fn reach(&self) -> usize {
        let dofs = self.touched.iter().map(|(dof, _)| *dof);
        dofs.clone().max().unwrap_or(0) - dofs.min().unwrap_or(0)
    }

    /// Adds `-A_rp A_pp⁻¹ A_pr` to the rail.
    #[inline(always)]
    fn condense(&self, value: &impl Fn(usize) -> Lane, rail: &mut Banded) {
        let mut own = Banded::zeros(self.dofs.len(), self.width);
        for &(row, column, place) in &self.inner {
            own.add(row, column, value(place));
        }
        own.factor();
        let solved = self.touched.iter().map(|(_, entries)| {
            let mut column = vec![Lane::default(); self.dofs.len()];
            for &(row, place) in entries {
                column[row] = column[row] + value(place);
            }
            let first = entries.iter().map(|&(row, _)| row).min().unwrap_or(0);
            own.forward(&mut column, first);
            column
        });
        let solved: Vec<Vec<Lane>> = solved.collect();
        for (a, left) in solved.iter().enumerate() {
            for (b, right) in solved.iter().enumerate().take(a + 1) {
                let mut sum = Lane::default();
                for (row, (x, y)) in left.iter().zip(right).enumerate() {
                    sum = sum - *x * *y * own.inverse_pivot(row);
                }
                let (row, column) = (self.touched[a].0, self.touched[b].0);
                rail.add(row.max(column), row.min(column), sum);
            }
        }
    }
}

/// Groups of degrees of freedom off the rail that hang together, those next to the rail last.
fn pieces(matrices: &Matrices, rail_dofs: usize) -> Vec<Piece> {
    let mut seen = vec![false; matrices.size()];
    let mut pieces = Vec::new();
    for start in rail_dofs..matrices.size() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut dofs = vec![start];
        let mut next = 0;
        while next < dofs.len() {
            let row = dofs[next];
            next += 1;
            for place in matrices.row_starts()[row]..matrices.row_starts()[row + 1] {
                let column = matrices.columns()[place];
                if column >= rail_dofs && !seen[column] {
                    seen[column] = true;
                    dofs.push(column);
                }
            }
        }
        // Sleepers count from the rail seat outwards, so that descending numbers end next to it.
        dofs.sort_unstable_by(|a, b| b.cmp(a));
        pieces.push(Piece { dofs, width: 0, inner: Vec::new(), touched: Vec::new() });
    }
    pieces
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::extension::ExtensionInstance;
    use crate::frequency::{Place, receptance};
    use crate::model::{Mesh, Support};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPANS: usize = 9;

    pub(in crate::frequency) fn track() -> TrackModel {
        let supports = (1..SPANS)
            .map(|sleeper| {
                let nominal = Support::from(&ParameterSet::nominal());
                let scale = 1.0 + 0.1 * sleeper as f64;
                Support { railpad_stiffness: nominal.railpad_stiffness * scale, ..nominal }
            })
            .collect::<Vec<_>>();
        let (design, mesh) = (TrackDesign::v_track(), Mesh::uniform(SPANS, 4, 4));
        let bolts = ExtensionInstance::new("sleeper_bolt").with("stiffness_N_per_m", 3e7);
        let bolts = bolts.on([2, 5]).build(&design, SPANS).unwrap();
        TrackModel::build(&design, &mesh, &supports, &[bolts]).unwrap()
    }

    #[test]
    fn receptances_are_those_of_the_general_solver() {
        let track = track();
        // More than one group of lanes, and one that is not full.
        let frequencies: Vec<f64> = (0..11).map(|k| 60.0 * 1.5_f64.powi(k)).collect();
        let fast = RailReceptances::new(&track, &frequencies, true);
        let layout = track.layout();
        let seat = layout.sleepers()[3].position_m;
        for node in [5, 16, 30] {
            let place = Place::Rail(layout.rail_nodes_m()[node]);
            let direct = receptance(&track, place, place, &frequencies).unwrap();
            let cross = receptance(&track, Place::Rail(seat), place, &frequencies).unwrap();
            for index in 0..frequencies.len() {
                let errors = [
                    fast.direct[index][node] - direct[index],
                    fast.from_seats[index][3][node] - cross[index],
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
            let direct = RailReceptances::new(&track, &frequencies, false).direct;
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
