//! Receptances of tracks that differ from a solved track at a few places of the rail.
//!
//! The differences change the dynamic stiffness of the rail at a few degrees of freedom only. The
//! receptances follow from those of the solved track by a low-rank update.

use super::ahead::Between;
use super::banded::Inverse;
use super::lane::{LANES, Lane, omega};
use super::piece::Piece;
use super::rail::{Partition, deflections};
use super::receptances::RailReceptances;
use super::states::States;
use super::vectorized::vectorized;
use crate::model::{Matrices, TrackModel};
use nalgebra::DMatrix;
use num_complex::Complex64;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::OnceLock;

/// Largest number of changed degrees of freedom of the rail. With more of them, a complete solution is
/// as fast.
pub(super) const CHANGED_MAX: usize = 12;

/// A solved track, from which the receptances of similar tracks follow.
pub struct KnownRail {
    model: TrackModel,
    frequencies_hz: Vec<f64>,
    /// For each group of frequencies, the inverse of the rail and that of the mirrored rail.
    inverses: Vec<[Inverse; 2]>,
    direct: Vec<Vec<Complex64>>,
    /// Receptances between all nodes, computed when they are first needed.
    between: OnceLock<Between>,
}

/// Differences between another track and the known track.
pub(super) struct Difference<'a> {
    known: Partition<'a>,
    other: Partition<'a>,
    /// Indices of the pieces that only the known track has, and of those that only the other track has.
    pieces: [Vec<usize>; 2],
    /// Numbers of the rail's own entries that differ.
    rail: Vec<usize>,
    /// Degrees of freedom of the rail that change, in order.
    pub(super) dofs: Vec<usize>,
}

impl KnownRail {
    /// Solves a track with the matrices of `model`. Force laws are linearised under a wheel above them.
    pub fn new(model: &TrackModel, frequencies_hz: &[f64]) -> Self {
        let (partition, nodes) = (Partition::new(model), deflections(model));
        let solved = frequencies_hz.par_chunks(LANES).map(|chunk| {
            let inverses = vectorized(
                #[inline(always)]
                || partition.inverted_both(omega(chunk)),
            );
            let direct = inverses[0].direct(&nodes);
            let of_lane = |lane: usize| direct.iter().map(|value| value.get(lane)).collect();
            let direct: Vec<Vec<Complex64>> = (0..chunk.len()).map(of_lane).collect();
            (inverses, direct)
        });
        let (inverses, direct): (Vec<_>, Vec<_>) = solved.unzip();
        Self {
            inverses,
            direct: direct.into_iter().flatten().collect(),
            frequencies_hz: frequencies_hz.to_vec(),
            model: model.clone(),
            between: OnceLock::new(),
        }
    }

    /// As [`receptances_ahead`](super::receptances_ahead) of the known track. The first call takes longer.
    pub fn ahead(&self, distance_m: f64) -> Vec<Vec<Complex64>> {
        let compute = || {
            let inverses = self.inverses.iter().map(|[inverse, _]| inverse);
            Between::all(&self.model, &self.frequencies_hz, inverses)
        };
        self.between.get_or_init(compute).ahead(&self.model, distance_m)
    }

    /// Direct receptances of every rail node in m/N, `[frequency][node]`, of a track on the same mesh.
    /// The function computes the nodes within `reach` nodes of a difference. Farther nodes keep the
    /// values of the known track.
    pub fn direct_of(&self, model: &TrackModel, reach: usize) -> Vec<Vec<Complex64>> {
        let of = |track: &TrackModel| RailReceptances {
            direct: self.of_matrices(track, reach),
            from_seats: Vec::new(),
            by_state: None,
        };
        match States::new(model) {
            Some(states) => states.mix(of).direct,
            None => of(model).direct,
        }
    }

    fn of_matrices(&self, model: &TrackModel, reach: usize) -> Vec<Vec<Complex64>> {
        let difference = Difference::new(&self.model, model);
        let Some(difference) = difference.filter(|it| it.dofs.len() <= CHANGED_MAX) else {
            return RailReceptances::of_matrices(model, &self.frequencies_hz, None).direct;
        };
        if difference.dofs.is_empty() {
            return self.direct.clone();
        }
        let dofs = deflections(model);
        let near = difference.near(&dofs, reach);
        let chunks = self.frequencies_hz.par_chunks(LANES).zip(&self.inverses).enumerate();
        let changed = chunks.flat_map_iter(|(index, (chunk, inverses))| {
            let known = &self.direct[index * LANES..][..chunk.len()];
            let lowered = vectorized(
                #[inline(always)]
                || difference.direct(chunk, known, inverses, (&dofs, near.clone())),
            );
            let near = near.clone();
            known.iter().enumerate().map(move |(lane, known)| {
                let mut direct = known.clone();
                for (direct, lowered) in direct[near.clone()].iter_mut().zip(&lowered) {
                    *direct = lowered.get(lane);
                }
                direct
            })
        });
        changed.collect()
    }
}

/// `(1 + Z A)^-1 Z` of changes `Z` of the dynamic stiffness at some degrees of freedom and the receptances
/// `A` between them.
pub(super) fn resisted(
    changes: &DMatrix<Complex64>,
    at_dofs: &DMatrix<Complex64>,
) -> DMatrix<Complex64> {
    let count = changes.nrows();
    let resisting = DMatrix::identity(count, count) + changes * at_dofs;
    // A track that gives way without bound makes no receptances: so they are said to be none.
    let none = || DMatrix::from_element(count, count, Complex64::new(f64::NAN, 0.0));
    resisting.lu().solve(changes).unwrap_or_else(none)
}

/// Direct receptance at a node after the dynamic stiffness changes at some degrees of freedom: lower by the
/// node's entry on the diagonal of `B (1 + Z A)^-1 Z B'`, with the changes `Z`, the receptances `A` between
/// these degrees of freedom, and the receptances `B` from these degrees of freedom to each node.
#[inline(always)]
fn lowered(direct: Lane, resisted: &DMatrix<Lane>, at_nodes: &DMatrix<Lane>, node: usize) -> Lane {
    let count = resisted.nrows();
    let mut lowered = direct;
    for a in 0..count {
        for b in 0..count {
            lowered = lowered - at_nodes[(node, a)] * resisted[(a, b)] * at_nodes[(node, b)];
        }
    }
    lowered
}

/// The matrices of some lanes as one.
fn packed(lanes: usize, of_lane: impl Fn(usize) -> DMatrix<Complex64>) -> DMatrix<Lane> {
    let matrices: Vec<_> = (0..lanes).map(of_lane).collect();
    let (rows, columns) = matrices[0].shape();
    DMatrix::from_fn(rows, columns, |a, b| Lane::from_values(lanes, |lane| matrices[lane][(a, b)]))
}

/// Columns of the inverse of the known rail, one per changed degree of freedom.
pub(super) struct Columns {
    /// Between these degrees of freedom.
    pub(super) at_dofs: DMatrix<Lane>,
    /// At the nodes near these degrees of freedom, one row per node.
    pub(super) at_nodes: DMatrix<Lane>,
}

impl<'a> Difference<'a> {
    /// `None` if the matrices of the two rails have different sparsity patterns.
    pub(super) fn new(known: &'a TrackModel, other: &'a TrackModel) -> Option<Self> {
        let [known, other] = [known, other].map(Partition::new);
        let places = |it: &Partition<'_>| -> Vec<(usize, usize)> {
            it.rail.iter().map(|&(row, column, _)| (row, column)).collect()
        };
        if known.rail_dofs != other.rail_dofs || places(&known) != places(&other) {
            return None;
        }
        let by_first = |pieces: &[Piece]| -> BTreeMap<usize, usize> {
            // The last degree of freedom has the lowest number, and is next to the rail.
            pieces.iter().enumerate().filter_map(|(n, it)| Some((*it.dofs.last()?, n))).collect()
        };
        let (known_at, other_at) = (by_first(&known.pieces), by_first(&other.pieces));
        let is_same = |a: usize, b: usize| {
            known.pieces[a].is_as(&other.pieces[b], [known.matrices, other.matrices])
        };
        let lacks = |(first, &a): (&usize, &usize)| {
            (!other_at.get(first).is_some_and(|&b| is_same(a, b))).then_some(a)
        };
        let has = |(first, &b): (&usize, &usize)| {
            (!known_at.get(first).is_some_and(|&a| is_same(a, b))).then_some(b)
        };
        let pieces = [
            known_at.iter().filter_map(lacks).collect::<Vec<_>>(),
            other_at.iter().filter_map(has).collect::<Vec<_>>(),
        ];
        let differs = |&index: &usize| {
            let [a, b] = [&known, &other].map(|it| values(it.matrices, it.rail[index].2));
            a != b
        };
        let rail: Vec<usize> = (0..known.rail.len()).filter(differs).collect();
        let mut dofs = BTreeSet::new();
        for &index in &rail {
            dofs.extend([known.rail[index].0, known.rail[index].1]);
        }
        for (partition, numbers) in [&known, &other].into_iter().zip(&pieces) {
            let touched = numbers.iter().flat_map(|&number| &partition.pieces[number].touched);
            dofs.extend(touched.map(|(dof, _)| *dof));
        }
        Some(Self { known, other, pieces, rail, dofs: dofs.into_iter().collect() })
    }

    /// The nodes at most `reach` nodes from a changed degree of freedom.
    fn near(&self, dofs: &[Option<usize>], reach: usize) -> Range<usize> {
        let (from, to) = (self.dofs[0], self.dofs[self.dofs.len() - 1]);
        let first = dofs.iter().position(|dof| dof.is_some_and(|dof| dof >= from)).unwrap_or(0);
        let last = dofs.iter().rposition(|dof| dof.is_some_and(|dof| dof <= to));
        let last = last.unwrap_or(dofs.len() - 1);
        first.min(last).saturating_sub(reach)..(first.max(last) + reach + 1).min(dofs.len())
    }

    /// Direct receptances of the other track at the nodes near the differences, from those of the known track at each
    /// of these frequencies and the inverse of its rail. `dofs` are the [`deflections`].
    #[inline(always)]
    fn direct(
        &self,
        frequencies_hz: &[f64],
        known: &[Vec<Complex64>],
        inverses: &[Inverse; 2],
        (dofs, near): (&[Option<usize>], Range<usize>),
    ) -> Vec<Lane> {
        let lanes = frequencies_hz.len();
        let changes = self.changes(&omega(frequencies_hz));
        let columns = self.columns(inverses, dofs, near.clone());
        let resisted = packed(lanes, |lane| {
            let [changes, at_dofs] =
                [&changes, &columns.at_dofs].map(|matrix| matrix.map(|value| value.get(lane)));
            resisted(&changes, &at_dofs)
        });
        let mut direct = Vec::with_capacity(near.len());
        // No iterator adaptor collects here: its loop would not be compiled for the instruction set.
        for (row, node) in near.enumerate() {
            let known = Lane::from_values(lanes, |lane| known[lane][node]);
            direct.push(lowered(known, &resisted, &columns.at_nodes, row));
        }
        direct
    }

    /// Changes of the dynamic stiffness between the changed degrees of freedom.
    #[inline(always)]
    pub(super) fn changes(&self, omega: &impl Fn(usize) -> f64) -> DMatrix<Lane> {
        let count = self.dofs.len();
        let mut changes = DMatrix::from_element(count, count, Lane::default());
        let place = |dof: usize| self.dofs.binary_search(&dof).expect("it is touched");
        let mut add = |row: usize, column: usize, value: Lane| {
            let (row, column) = (place(row), place(column));
            changes[(row, column)] = changes[(row, column)] + value;
            if row != column {
                changes[(column, row)] = changes[(column, row)] + value;
            }
        };
        let [less, more] = [&self.known, &self.other].map(|it| it.dynamic_stiffness(omega));
        for &index in &self.rail {
            let (row, column, known) = self.known.rail[index];
            add(row, column, more(self.other.rail[index].2) - less(known));
        }
        for &number in &self.pieces[0] {
            let subtract = |row, column, value| add(row, column, Lane::default() - value);
            self.known.pieces[number].condense(&less, subtract);
        }
        for &number in &self.pieces[1] {
            self.other.pieces[number].condense(&more, &mut add);
        }
        changes
    }

    /// Columns of the inverse of the known rail. `inverses` has the inverse of the rail and that of the
    /// mirrored rail.
    #[inline(always)]
    pub(super) fn columns(
        &self,
        [inverse, mirrored]: &[Inverse; 2],
        dofs: &[Option<usize>],
        near: Range<usize>,
    ) -> Columns {
        let last = self.known.rail_dofs - 1;
        let (mut above, mut below) =
            (vec![Lane::default(); last + 1], vec![Lane::default(); last + 1]);
        let count = self.dofs.len();
        let mut columns = Columns {
            at_dofs: DMatrix::from_element(count, count, Lane::default()),
            at_nodes: DMatrix::from_element(near.len(), count, Lane::default()),
        };
        let in_near = dofs[near.clone()].iter().flatten();
        let touched = self.dofs.iter();
        let from = in_near.clone().chain(touched.clone()).min().copied().unwrap_or(0);
        let to = in_near.chain(touched).max().copied().unwrap_or(last);
        for (number, &dof) in self.dofs.iter().enumerate() {
            inverse.column_above(dof, from, &mut above);
            mirrored.column_above(last - dof, last - to, &mut below);
            let at = |row: usize| if row <= dof { above[row] } else { below[last - row] };
            for (row, &other) in self.dofs.iter().enumerate() {
                columns.at_dofs[(row, number)] = at(other);
            }
            for (row, node) in near.clone().enumerate() {
                columns.at_nodes[(row, number)] = dofs[node].map_or(Lane::default(), at);
            }
        }
        columns
    }
}

/// Mass, damping and stiffness at a place of the matrices.
fn values(matrices: &Matrices, place: usize) -> [f64; 3] {
    [matrices.mass()[place], matrices.damping()[place], matrices.stiffness()[place]]
}

impl Piece {
    /// Whether a piece has the same values as a piece of another track.
    fn is_as(&self, other: &Self, [own, others]: [&Matrices; 2]) -> bool {
        let is_as = |one: usize, other: usize| values(own, one) == values(others, other);
        let inner = self.inner.iter().zip(&other.inner);
        let touched = self.touched.iter().zip(&other.touched);
        self.dofs == other.dofs
            && self.inner.len() == other.inner.len()
            && self.touched.len() == other.touched.len()
            && inner.into_iter().all(|(a, b)| (a.0, a.1) == (b.0, b.1) && is_as(a.2, b.2))
            && touched.into_iter().all(|((a, entries), (b, others))| {
                a == b
                    && entries.len() == others.len()
                    && entries.iter().zip(others).all(|(a, b)| a.0 == b.0 && is_as(a.1, b.1))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::super::rail::tests::{SPANS, track, track_with};
    use super::*;
    use crate::extension::ExtensionInstance;

    #[test]
    fn receptances_of_a_track_that_differs_are_those_of_its_own_solution() {
        let frequencies: Vec<f64> = (0..11).map(|k| 60.0 * 1.5_f64.powi(k)).collect();
        let known = KnownRail::new(&track(), &frequencies);
        let at = |physics: &'static str| ExtensionInstance::new(physics);
        for extension in [
            at("missing_railpad").on([3]).with("stiffness_N_per_m", 1e6),
            at("fastening_clamp")
                .on([3, 4])
                .with("vertical_N_per_m", 1e8)
                .with("rotational_N_m_per_rad", 1e5),
            at("subgrade_layer")
                .on([4])
                .with("mass_kg", 20.0)
                .with("stiffness_N_per_m", 2e7)
                .with("damping_N_s_per_m", 2e3),
            at("rail_joint")
                .at([0.5, 0.5])
                .with("dip_m", 1e-5)
                .with("length_m", 0.02)
                .with("bending_factor", 0.2),
            at("cracked_sleeper")
                .on([4])
                .with("bending_factor", 0.05)
                .with("bending_length_m", 0.02),
            at("hanging_sleeper").on([4]).with("gap_m", 1.2e-4),
            at("hanging_sleeper").on([4]).with("gap_m", 4e-3),
            at("squat").at([0.5, 0.5]).with("length_m", 0.02).with("depth_m", 1e-5),
        ] {
            let other = track_with(std::slice::from_ref(&extension));
            let plain = RailReceptances::new(&other, &frequencies, None).direct;
            let found = known.direct_of(&other, 8 * SPANS);
            for (found, plain) in found.iter().flatten().zip(plain.iter().flatten()) {
                // Rounding of a low rank change, amplified by the condition.
                let error = (found - plain).norm();
                assert!(error <= 1e-8 * plain.norm(), "{extension:?} {found} {plain}");
            }
        }
    }
}
