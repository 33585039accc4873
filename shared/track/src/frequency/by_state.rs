//! The rail's receptances in each state of a track with force laws.
//!
//! The states differ only at the few places of the rail above sleepers with force laws. The solver
//! therefore solves one state and derives the others.

use super::lane::{LANES, Lane, omega};
use super::rail::{Near, Partition, Solved, deflections, near_seats};
use super::receptances::{RailReceptances, SeatReceptances};
use super::states::{Hold, States};
use super::varied::{CHANGED_MAX, Columns, Difference, resisted};
use super::vectorized::vectorized;
use crate::model::TrackModel;
use nalgebra::DMatrix;
use num_complex::Complex64;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Direct receptances of the rail in each state of the track. The state depends on the position of the
/// wheel.
#[derive(Clone, Debug)]
pub struct StateReceptances {
    tracks: Vec<TrackModel>,
    holds: Vec<Hold>,
    /// The nodes at which the states are known.
    nodes: Range<usize>,
    /// Direct receptances in the first state in m/N, `[frequency][node]`.
    first: Vec<Vec<Complex64>>,
    /// Reduction of each further state at these nodes: `[frequency][state - 1][node]`.
    reductions: Vec<Vec<Vec<Complex64>>>,
}

/// Reduction of receptances at one frequency: value in the first state minus value in another state.
struct Reduction {
    /// Receptances from the places that change to the nodes from the first of the columns' on, a row
    /// a node.
    at_nodes: DMatrix<Complex64>,
    /// The same times the dynamic stiffness that resists there.
    resisted: DMatrix<Complex64>,
    from: usize,
}

/// Receptances at one frequency.
struct Mixed {
    direct: Vec<Complex64>,
    from_seats: Vec<SeatReceptances>,
    /// Direct receptances in the first state.
    first: Vec<Complex64>,
    /// Reduction of each further state at the nodes near the laws.
    reductions: Vec<Vec<Complex64>>,
}

impl Reduction {
    fn new(columns: &Columns, changes: &DMatrix<Lane>, lane: usize, from: usize) -> Self {
        let unpack = |matrix: &DMatrix<Lane>| matrix.map(|value| value.get(lane));
        let at_nodes = unpack(&columns.at_nodes);
        let resisted = &at_nodes * resisted(&unpack(changes), &unpack(&columns.at_dofs));
        Self { at_nodes, resisted, from }
    }

    fn between(&self, one: usize, other: usize) -> Complex64 {
        let (resisted, at) = (self.resisted.row(one - self.from), other - self.from);
        resisted.iter().zip(self.at_nodes.row(at).iter()).map(|(a, b)| a * b).sum()
    }
}

impl States {
    /// Receptances at each node, with the track in the state that it has while the wheel is at this
    /// node. With `reach`, the result also contains the receptances from each rail seat to `reach` nodes
    /// on either side.
    pub(super) fn receptances(
        self,
        frequencies_hz: &[f64],
        reach: Option<usize>,
    ) -> RailReceptances {
        let solved =
            self.differences().map(|them| self.beside_the_first(&them, frequencies_hz, reach));
        let Some(solved) = solved else {
            return self.mix(|track| RailReceptances::of_matrices(track, frequencies_hz, reach));
        };
        let (mut direct, mut from_seats) = (Vec::new(), Vec::new());
        let (mut first, mut reductions) = (Vec::new(), Vec::new());
        for mixed in solved {
            direct.push(mixed.direct);
            from_seats.push(mixed.from_seats);
            first.push(mixed.first);
            reductions.push(mixed.reductions);
        }
        let Self { tracks, holds, near: nodes, .. } = self;
        let by_state = StateReceptances { tracks, holds, nodes, first, reductions };
        RailReceptances { direct, from_seats, by_state: Some(Arc::new(by_state)) }
    }

    /// Differences of each further state from the first, at the same degrees of freedom. `None` if a
    /// separate solution of each state is as fast.
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

    /// Receptances at each frequency. The function solves the first state and derives the others.
    fn beside_the_first(
        &self,
        differences: &[Difference<'_>],
        frequencies_hz: &[f64],
        reach: Option<usize>,
    ) -> Vec<Mixed> {
        let track = &self.tracks[0];
        let (partition, dofs) = (Partition::new(track), deflections(track));
        let near = reach.map_or(Vec::new(), |reach| near_seats(track, reach));
        let reach = reach.unwrap_or(0);
        let columns_at =
            self.near.start.saturating_sub(reach)..(self.near.end + reach).min(dofs.len());
        let solved = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
            let (solved, columns, changes) = vectorized(
                #[inline(always)]
                || {
                    let omega = omega(chunk);
                    let inverses = partition.inverted_both(&omega);
                    let solved = Solved::new(&inverses[0], Some(&inverses[1]), &dofs, &near);
                    let columns = differences[0].columns(&inverses, &dofs, columns_at.clone());
                    let changes: Vec<_> = differences.iter().map(|it| it.changes(&omega)).collect();
                    (solved, columns, changes)
                },
            );
            let of_lane = |lane: usize| {
                let (first, from_seats) = solved.unpack(lane, &near);
                let of_state = |changes| Reduction::new(&columns, changes, lane, columns_at.start);
                let reductions: Vec<Reduction> = changes.iter().map(of_state).collect();
                self.mixed(first, from_seats, &near, &reductions)
            };
            (0..chunk.len()).map(of_lane).collect::<Vec<_>>()
        });
        solved.collect()
    }

    /// Receptances at one frequency, from those in the first state.
    fn mixed(
        &self,
        first: Vec<Complex64>,
        mut from_seats: Vec<SeatReceptances>,
        near: &[Near],
        by_state: &[Reduction],
    ) -> Mixed {
        let mut direct = first.clone();
        let mut reductions = Vec::with_capacity(by_state.len());
        for (state, reduction) in (1..).zip(by_state) {
            let of_nodes: Vec<Complex64> =
                self.near.clone().map(|node| reduction.between(node, node)).collect();
            for (node, of_node) in self.near.clone().zip(&of_nodes) {
                direct[node] -= self.shares[node][state] * of_node;
            }
            for (seat, values) in near.iter().zip(&mut from_seats) {
                let both = seat.nodes.start.max(self.near.start)..seat.nodes.end.min(self.near.end);
                for node in both.filter(|node| self.shares[*node][state] > 0.0) {
                    values.values[node - seat.nodes.start] -=
                        self.shares[node][state] * reduction.between(seat.seat, node);
                }
            }
            reductions.push(of_nodes);
        }
        Mixed { direct, from_seats, first, reductions }
    }
}

impl StateReceptances {
    /// Direct receptances in m/N, `[frequency][node]`, with the force laws active at the same positions
    /// of the wheel as on the track `other`. `other` must have the same mesh and nearly the same values.
    /// `None` if `other` has a state that this track does not have or, with `alike`, a state whose
    /// matrices differ.
    pub fn direct_where(&self, other: &TrackModel, alike: bool) -> Option<Vec<Vec<Complex64>>> {
        let other = States::new(other)?;
        let state = |hold: &Hold| self.holds.iter().position(|own| own == hold);
        let states: Vec<usize> = other.holds.iter().map(state).collect::<Option<_>>()?;
        let is_alike = |(&state, track): (&usize, &TrackModel)| {
            self.tracks[state].matrices() == track.matrices()
        };
        if alike && !states.iter().zip(&other.tracks).all(is_alike) {
            return None;
        }
        let shares = |node: usize| states.iter().copied().zip(other.shares[node].iter().copied());
        let in_first = |node: usize| shares(node).all(|(state, share)| state == 0 || share == 0.0);
        let mut beyond = (0..self.nodes.start).chain(self.nodes.end..other.shares.len());
        if !beyond.all(in_first) {
            return None;
        }
        let of_frequency = |(first, reductions): (&Vec<Complex64>, &Vec<Vec<Complex64>>)| {
            let mut direct = first.clone();
            for node in self.nodes.clone() {
                for (state, share) in shares(node).filter(|(state, _)| *state > 0) {
                    direct[node] -= share * reductions[state - 1][node - self.nodes.start];
                }
            }
            direct
        };
        Some(self.first.iter().zip(&self.reductions).map(of_frequency).collect())
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
        let whole = RailReceptances::new(&other, &FREQUENCIES_HZ, None).direct;
        let moved = by_state.direct_where(&other, true).unwrap();
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
        let stiffer = track(1.2e-4, 1.1);
        assert!(by_state.direct_where(&stiffer, true).is_none());
        assert!(by_state.direct_where(&stiffer, false).is_some());
    }
}
