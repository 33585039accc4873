//! Receptances of the rail between two places at a fixed distance, for two wheels at any position.

use super::banded::Inverse;
use super::lane::{LANES, Lane, omega};
use super::rail::{Partition, deflections};
use super::vectorized::vectorized;
use crate::model::TrackModel;
use num_complex::Complex64;
use rayon::prelude::*;
use std::ops::Range;

/// Receptances in m/N between every rail node and the place `distance_m` ahead of the node (negative:
/// behind), as `[frequency][node]`. The value is zero where that place is not on the rail. Between nodes
/// the function interpolates.
pub fn receptances_ahead(
    model: &TrackModel,
    frequencies_hz: &[f64],
    distance_m: f64,
) -> Vec<Vec<Complex64>> {
    let partition = Partition::new(model);
    let pairs = Pairs::ahead(model, distance_m);
    let chunks = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
        let lanes = vectorized(
            #[inline(always)]
            || pairs.values(&partition.inverted(omega(chunk))),
        );
        (0..chunk.len()).map(move |lane| lanes.iter().map(|value| value.get(lane)).collect())
    });
    let values = chunks.collect();
    Between { pairs, values }.ahead(model, distance_m)
}

/// Receptances in m/N between nodes of the rail.
pub(super) struct Between {
    pairs: Pairs,
    /// `[frequency][pair]`.
    values: Vec<Vec<Complex64>>,
}

impl Between {
    /// Between all nodes of a model with these inverses, one for each group of frequencies.
    ///
    /// It runs on one thread. With parallel work in it, its thread could begin another task that waits for
    /// the same result.
    pub(super) fn all<'a>(
        model: &TrackModel,
        frequencies_hz: &[f64],
        inverses: impl Iterator<Item = &'a Inverse>,
    ) -> Self {
        let pairs = Pairs::all(model);
        let mut values = Vec::with_capacity(frequencies_hz.len());
        for (chunk, inverse) in frequencies_hz.chunks(LANES).zip(inverses) {
            let lanes = vectorized(
                #[inline(always)]
                || pairs.values(inverse),
            );
            let of_lane = |lane: usize| lanes.iter().map(|value| value.get(lane)).collect();
            values.extend((0..chunk.len()).map(of_lane));
        }
        Self { pairs, values }
    }

    /// As [`receptances_ahead`]. The pairs include those at this distance.
    pub(super) fn ahead(&self, model: &TrackModel, distance_m: f64) -> Vec<Vec<Complex64>> {
        let nodes_m = model.layout().rail_nodes_m();
        let of_node = |(node, x_m): (usize, &f64)| {
            let there = shares(nodes_m, x_m + distance_m).into_iter();
            there.map(|(other, share)| (self.pairs.place(node, other), share)).collect()
        };
        let there: Vec<Vec<(usize, f64)>> = nodes_m.iter().enumerate().map(of_node).collect();
        let of_line = |values: &Vec<Complex64>| {
            let sum = |there: &Vec<(usize, f64)>| {
                there.iter().map(|&(place, share)| share * values[place]).sum()
            };
            there.iter().map(sum).collect()
        };
        self.values.iter().map(of_line).collect()
    }
}

/// Pairs of rail nodes: each node with a range of nodes that are not before it.
struct Pairs {
    /// For each node: number of its first pair, and the other nodes.
    others: Vec<(usize, Range<usize>)>,
    /// Degree of freedom of the deflection of every node; `None` for held nodes.
    dofs: Vec<Option<usize>>,
}

impl Pairs {
    fn new(model: &TrackModel, others: Vec<Range<usize>>) -> Self {
        let mut count = 0;
        let numbered = others.into_iter().map(|others| {
            let first = count;
            count += others.len();
            (first, others)
        });
        Self { others: numbered.collect(), dofs: deflections(model) }
    }

    fn all(model: &TrackModel) -> Self {
        let count = model.layout().rail_nodes_m().len();
        Self::new(model, (0..count).map(|node| node..count).collect())
    }

    /// The pairs that [`Between::ahead`] needs at this distance.
    fn ahead(model: &TrackModel, distance_m: f64) -> Self {
        let nodes_m = model.layout().rail_nodes_m();
        let mut others: Vec<Option<Range<usize>>> = vec![None; nodes_m.len()];
        for (node, x_m) in nodes_m.iter().enumerate() {
            for (other, _) in shares(nodes_m, x_m + distance_m) {
                let (one, other) = (node.min(other), node.max(other));
                let known = others[one].take().unwrap_or(other..other + 1);
                others[one] = Some(known.start.min(other)..known.end.max(other + 1));
            }
        }
        Self::new(model, others.into_iter().map(Option::unwrap_or_default).collect())
    }

    fn place(&self, node: usize, other: usize) -> usize {
        let (first, others) = &self.others[node.min(other)];
        first + node.max(other) - others.start
    }

    /// Entries of the inverse for all pairs, zero for held nodes. Every column is computed once, from its
    /// diagonal to the farthest required row.
    #[inline(always)]
    fn values(&self, inverse: &Inverse) -> Vec<Lane> {
        let mut by_column = vec![Vec::new(); inverse.size()];
        for ((first, others), row) in self.others.iter().zip(&self.dofs) {
            for (place, other) in (*first..).zip(others.clone()) {
                if let (Some(row), Some(column)) = (*row, self.dofs[other]) {
                    by_column[column].push((row, place));
                }
            }
        }
        let count = self.others.last().map_or(0, |(first, others)| first + others.len());
        let mut values = vec![Lane::default(); count];
        let mut work = vec![Lane::default(); inverse.size()];
        for (column, rows) in by_column.iter().enumerate() {
            // Nodes are in order.
            let Some(&(first, _)) = rows.first() else { continue };
            inverse.column_above(column, first, &mut work);
            for &(row, place) in rows {
                values[place] = work[row];
            }
        }
        values
    }
}

/// The two nodes next to the place `x_m`, each with its weight for linear interpolation. Empty if the
/// place is not on the rail.
pub fn shares(nodes_m: &[f64], x_m: f64) -> Vec<(usize, f64)> {
    let after = nodes_m.partition_point(|node_m| *node_m <= x_m);
    if after == 0 || after == nodes_m.len() {
        return Vec::new();
    }
    let (from_m, to_m) = (nodes_m[after - 1], nodes_m[after]);
    let share = (x_m - from_m) / (to_m - from_m);
    vec![(after - 1, 1.0 - share), (after, share)]
}

#[cfg(test)]
mod tests {
    use super::super::rail::tests::track;
    use super::*;
    use crate::frequency::{KnownRail, ReceptancePoint, receptance};

    #[test]
    fn receptances_ahead_are_those_of_the_general_solver() {
        let track = track();
        let frequencies: Vec<f64> = (0..11).map(|k| 60.0 * 1.5_f64.powi(k)).collect();
        let known = KnownRail::new(&track, &frequencies);
        let nodes_m = track.layout().rail_nodes_m();
        let spacing_m = nodes_m[1] - nodes_m[0];
        for distance_m in [1.0, 9.0, -6.0].map(|nodes| nodes * spacing_m) {
            // Half a node further: the mean of two.
            let ahead = [0.0, 0.5 * spacing_m]
                .map(|more_m| receptances_ahead(&track, &frequencies, distance_m + more_m));
            assert_eq!(ahead[0], known.ahead(distance_m));
            for node in [7, 16, 20] {
                let at = |x_m: f64| {
                    let from = ReceptancePoint::Rail(nodes_m[node]);
                    receptance(&track, from, ReceptancePoint::Rail(x_m), &frequencies).unwrap()
                };
                let there_m = nodes_m[node] + distance_m;
                let [cross, next] = [there_m, there_m + spacing_m].map(at);
                for index in 0..frequencies.len() {
                    let scale = cross[index].norm();
                    let error = ahead[0][index][node] - cross[index];
                    assert!(error.norm() < 1e-8 * scale, "{node} {index} {error}");
                    let error = ahead[1][index][node] - 0.5 * (cross[index] + next[index]);
                    assert!(error.norm() < 1e-8 * scale, "{node} {index} {error}");
                }
            }
            let off = if distance_m > 0.0 { nodes_m.len() - 2 } else { 1 };
            assert_eq!(ahead[1][0][off], Complex64::ZERO);
        }
    }
}
