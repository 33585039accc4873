//! The rail's receptances in each state of a track with force laws.
//!
//! The states differ at the few places of the rail that the laws' sleepers hang on. So one of them is
//! solved, and the others follow from it.

use super::lane::{LANES, Lane, omega};
use super::rail::{Near, Partition, Solved, deflections, near_seats};
use super::receptances::{RailReceptances, SeatReceptances};
use super::states::{Hold, States};
use super::varied::{CHANGED_MAX, Columns, Difference, resisted};
use crate::model::TrackModel;
use nalgebra::DMatrix;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use std::ops::Range;
use std::sync::Arc;

/// Direct receptances of the rail in each state that the place of the wheel gives a track.
#[derive(Clone, Debug)]
pub struct StateReceptances {
    tracks: Vec<TrackModel>,
    holds: Vec<Hold>,
    /// The nodes at which the states are known.
    nodes: Range<usize>,
    /// Those in the first state in m/N, `[frequency][node]`.
    first: Vec<Vec<Complex64>>,
    /// By how much those of each further state are less at these nodes: `[frequency][state - 1][node]`.
    less: Vec<Vec<Vec<Complex64>>>,
}

/// At one frequency by how much receptances are less in a state than in the first.
struct Less {
    /// Receptances from the places that change to the nodes from the first of the columns' on, a row
    /// a node.
    at_nodes: DMatrix<Complex64>,
    /// The same times the dynamic stiffness that resists there.
    resisted: DMatrix<Complex64>,
    from: usize,
}

impl Less {
    fn between(&self, one: usize, other: usize) -> Complex64 {
        let (resisted, at) = (self.resisted.row(one - self.from), other - self.from);
        resisted.iter().zip(self.at_nodes.row(at).iter()).map(|(a, b)| a * b).sum()
    }
}

impl States {
    /// Receptances at each node of the track in the state that it has while the wheel is there, with those
    /// from the rail seats to so many nodes on either side where `reach` says it.
    pub(super) fn receptances(
        self,
        frequencies_hz: &[f64],
        reach: Option<usize>,
    ) -> RailReceptances {
        match self.differences() {
            Some(differences) => {
                let (mixed, first, less) =
                    self.beside_the_first(&differences, frequencies_hz, reach);
                let Self { tracks, holds, near: nodes, .. } = self;
                let by_state = StateReceptances { tracks, holds, nodes, first, less };
                RailReceptances { by_state: Some(Arc::new(by_state)), ..mixed }
            }
            None => self.mix(|track| RailReceptances::of_matrices(track, frequencies_hz, reach)),
        }
    }

    /// How each further state differs from the first, at the same degrees of freedom; none where that is not
    /// quicker than to solve each state.
    fn differences(&self) -> Option<Vec<Difference<'_>>> {
        let first = &self.tracks[0];
        let others = self.tracks[1..].iter();
        let mut differences: Vec<_> =
            others.map(|track| Difference::new(first, track)).collect::<Option<_>>()?;
        let mut dofs: Vec<usize> = differences.iter().flat_map(|it| it.dofs.clone()).collect();
        dofs.sort_unstable();
        dofs.dedup();
        for difference in &mut differences {
            difference.dofs.clone_from(&dofs);
        }
        let is_first = |node: usize| self.shares[node][0] == 1.0;
        let mut beyond = (0..self.near.start).chain(self.near.end..self.shares.len());
        let is_small = !dofs.is_empty() && dofs.len() <= CHANGED_MAX;
        (is_small && beyond.all(is_first)).then_some(differences)
    }

    /// Receptances in the states mixed, direct ones in the first state, and by how much those of the others
    /// are less.
    #[expect(clippy::type_complexity, reason = "taken apart where it is called")]
    fn beside_the_first(
        &self,
        differences: &[Difference<'_>],
        frequencies_hz: &[f64],
        reach: Option<usize>,
    ) -> (RailReceptances, Vec<Vec<Complex64>>, Vec<Vec<Vec<Complex64>>>) {
        let track = &self.tracks[0];
        let (partition, dofs) = (Partition::new(track), deflections(track));
        let near = reach.map_or(Vec::new(), |reach| near_seats(track, reach));
        let reach = reach.unwrap_or(0);
        let columns_at =
            self.near.start.saturating_sub(reach)..(self.near.end + reach).min(dofs.len());
        let solved = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
            let (solved, columns, changes) = pulp::Arch::new().dispatch(|| {
                let omega = omega(chunk);
                let inverses = partition.inverted_both(&omega);
                let solved = Solved::new(&inverses[0], Some(&inverses[1]), &dofs, &near);
                let columns = differences[0].columns(&inverses, &dofs, columns_at.clone());
                let changes: Vec<_> = differences.iter().map(|it| it.changes(&omega)).collect();
                (solved, columns, changes)
            });
            let of_lane = |lane: usize| {
                let (direct, from_seats) = solved.unpack(lane, &near);
                let less: Vec<Less> =
                    changes.iter().map(|it| less(&columns, it, lane, columns_at.start)).collect();
                self.mixed(direct, from_seats, &near, &less)
            };
            (0..chunk.len()).map(of_lane).collect::<Vec<_>>()
        });
        let mut mixed =
            RailReceptances { direct: Vec::new(), from_seats: Vec::new(), by_state: None };
        let (mut first, mut all_less) = (Vec::new(), Vec::new());
        for Mixed { direct, from_seats, first_direct, less } in solved.collect::<Vec<_>>() {
            mixed.direct.push(direct);
            mixed.from_seats.push(from_seats);
            first.push(first_direct);
            all_less.push(less);
        }
        (mixed, first, all_less)
    }

    /// Receptances at one frequency, from those in the first state.
    fn mixed(
        &self,
        first: Vec<Complex64>,
        mut from_seats: Vec<SeatReceptances>,
        near: &[Near],
        less: &[Less],
    ) -> Mixed {
        let mut direct = first.clone();
        let mut all = Vec::with_capacity(less.len());
        for (state, less) in (1..).zip(less) {
            let of_nodes: Vec<Complex64> =
                self.near.clone().map(|node| less.between(node, node)).collect();
            for (node, of_node) in self.near.clone().zip(&of_nodes) {
                direct[node] -= self.shares[node][state] * of_node;
            }
            for (seat, values) in near.iter().zip(&mut from_seats) {
                let both = seat.nodes.start.max(self.near.start)..seat.nodes.end.min(self.near.end);
                for node in both.filter(|node| self.shares[*node][state] > 0.0) {
                    values.values[node - seat.nodes.start] -=
                        self.shares[node][state] * less.between(seat.seat, node);
                }
            }
            all.push(of_nodes);
        }
        Mixed { direct, from_seats, first_direct: first, less: all }
    }
}

/// Receptances at one frequency.
struct Mixed {
    direct: Vec<Complex64>,
    from_seats: Vec<SeatReceptances>,
    first_direct: Vec<Complex64>,
    less: Vec<Vec<Complex64>>,
}

fn less(columns: &Columns, changes: &DMatrix<Lane>, lane: usize, from: usize) -> Less {
    let unpack = |matrix: &DMatrix<Lane>| matrix.map(|value| value.get(lane));
    let at_nodes = unpack(&columns.at_nodes);
    let resisted = &at_nodes * resisted(&unpack(changes), &unpack(&columns.at_dofs));
    Less { at_nodes, resisted, from }
}

impl StateReceptances {
    /// Direct receptances in m/N, `[frequency][node]`, where the laws take hold as they do on another track
    /// on the same mesh, which differs little. None where it has a state that this track does not have.
    pub fn direct_where(&self, other: &TrackModel) -> Option<Vec<Vec<Complex64>>> {
        let other = States::new(other)?;
        let state = |hold: &Hold| self.holds.iter().position(|own| own == hold);
        let states: Vec<usize> = other.holds.iter().map(state).collect::<Option<_>>()?;
        let beyond = (0..self.nodes.start).chain(self.nodes.end..other.shares.len());
        let shares = |node: usize| states.iter().copied().zip(other.shares[node].iter().copied());
        let in_first = |node: usize| shares(node).all(|(state, share)| state == 0 || share == 0.0);
        if !{ beyond }.all(in_first) {
            return None;
        }
        let of_frequency = |(first, less): (&Vec<Complex64>, &Vec<Vec<Complex64>>)| {
            let mut direct = first.clone();
            for node in self.nodes.clone() {
                for (state, share) in shares(node).filter(|(state, _)| *state > 0) {
                    direct[node] -= share * less[state - 1][node - self.nodes.start];
                }
            }
            direct
        };
        Some(self.first.iter().zip(&self.less).map(of_frequency).collect())
    }

    /// Whether another track on the same mesh is the same in each of its states: it may be in them
    /// elsewhere.
    pub fn has_states_of(&self, other: &TrackModel) -> bool {
        let Some(other) = States::new(other) else { return false };
        other.holds.iter().zip(&other.tracks).all(|(hold, track)| {
            let own = self.holds.iter().position(|own| own == hold);
            own.is_some_and(|own| self.tracks[own].matrices() == track.matrices())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::ExtensionInstance;
    use crate::model::{Mesh, Support};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPANS: usize = 20;
    const FREQUENCIES_HZ: [f64; 9] = [90.0, 200.0, 350.0, 400.0, 700.0, 1e3, 1.6e3, 2.4e3, 3.1e3];

    /// A track with two hanging sleepers and ballast of this stiffness in parts of the nominal one.
    fn track(gap_m: f64, ballast: f64) -> TrackModel {
        let design = TrackDesign::v_track();
        let nominal = Support::from(&ParameterSet::nominal());
        let mut supports = vec![nominal; SPANS - 1];
        supports[8].ballast_stiffness *= ballast;
        let hanging = ExtensionInstance::new("hanging_sleeper").on([9, 10]).with("gap_m", gap_m);
        let extensions = [hanging.build(&design, SPANS).unwrap()];
        TrackModel::build(&design, &Mesh::uniform(SPANS, 8, 8), &supports, &extensions).unwrap()
    }

    #[test]
    fn receptances_are_those_of_each_state_solved_alone() {
        let track = track(1.2e-4, 1.0);
        let states = || States::new(&track).unwrap();
        assert!(states().tracks.len() > 3);
        let reach = Some(40);
        let plain =
            states().mix(|track| RailReceptances::of_matrices(track, &FREQUENCIES_HZ, reach));
        let quick = states().receptances(&FREQUENCIES_HZ, reach);
        assert!(quick.by_state.is_some());
        for line in 0..FREQUENCIES_HZ.len() {
            for (node, expected) in plain.direct[line].iter().enumerate() {
                let error = (quick.direct[line][node] - expected).norm();
                assert!(error <= 1e-8 * expected.norm(), "{line} {node}: {error}");
            }
            for (quick, plain) in quick.from_seats[line].iter().zip(&plain.from_seats[line]) {
                let largest = plain.values.iter().map(|it| it.norm()).fold(0.0, f64::max);
                for (quick, plain) in quick.values.iter().zip(&plain.values) {
                    assert!((quick - plain).norm() <= 1e-8 * largest);
                }
            }
        }
    }

    #[test]
    fn a_law_that_takes_hold_elsewhere_changes_what_a_whole_solution_does() {
        let known = States::new(&track(1.2e-4, 1.0)).unwrap().receptances(&FREQUENCIES_HZ, None);
        let by_state = known.by_state.unwrap();
        // Another gap changes nothing but where it closes.
        let other = track(1.21e-4, 1.0);
        assert!(by_state.has_states_of(&other));
        let whole = RailReceptances::new(&other, &FREQUENCIES_HZ, None).direct;
        let moved = by_state.direct_where(&other).unwrap();
        let mut furthest = 0.0_f64;
        for line in 0..FREQUENCIES_HZ.len() {
            for node in 0..whole[line].len() {
                let expected = whole[line][node];
                assert!((moved[line][node] - expected).norm() <= 1e-8 * expected.norm());
                let change = (expected - known.direct[line][node]).norm() / expected.norm();
                furthest = furthest.max(change);
            }
        }
        assert!(furthest > 1e-3, "{furthest}");
        assert!(!by_state.has_states_of(&track(1.2e-4, 1.1)));
    }
}
