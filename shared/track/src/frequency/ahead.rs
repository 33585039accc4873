//! Receptances of the rail between two places at a fixed distance, for two wheels at any position.

use super::lane::{LANES, Lane, omega};
use super::rail::Partition;
use crate::model::TrackModel;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

/// Receptances in m/N between every rail node and the place `distance_m` ahead of the node (negative:
/// behind), as `[frequency][node]`. The value is zero where that place is not on the rail. Between nodes
/// the function interpolates.
pub fn receptances_ahead(
    model: &TrackModel,
    frequencies_hz: &[f64],
    distance_m: f64,
) -> Vec<Vec<Complex64>> {
    let partition = Partition::new(model);
    let nodes_m = model.layout().rail_nodes_m();
    let dof = |node: usize| model.layout().rail_node_dofs(node)[0];
    let pairs: Vec<Vec<_>> = (0..nodes_m.len())
        .map(|node| {
            let there = shares(nodes_m, nodes_m[node] + distance_m);
            let held = |(other, share)| Some((dof(node)?, dof(other)?, share));
            there.into_iter().filter_map(held).collect()
        })
        .collect();
    let chunks = frequencies_hz.par_chunks(LANES).flat_map_iter(|chunk| {
        let lanes = pulp::Arch::new().dispatch(|| partition.between(omega(chunk), &pairs));
        (0..chunk.len()).map(move |lane| lanes.iter().map(|value| value.get(lane)).collect())
    });
    chunks.collect()
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

impl Partition<'_> {
    /// Sums of the inverse's entries of these rows and columns, by their shares.
    #[inline(always)]
    fn between(
        &self,
        omega: impl Fn(usize) -> f64,
        pairs: &[Vec<(usize, usize, f64)>],
    ) -> Vec<Lane> {
        let inverse = self.inverted(omega);
        let mut work = vec![Lane::default(); self.rail_dofs];
        let mut sums = vec![Lane::default(); pairs.len()];
        for (sum, pairs) in sums.iter_mut().zip(pairs) {
            for &(one, other, share) in pairs {
                let (row, column) = (one.min(other), one.max(other));
                inverse.column_above(column, row, &mut work);
                *sum = *sum + work[row] * Lane::real(share);
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::super::rail::tests::track;
    use super::*;
    use crate::frequency::{ReceptancePoint, receptance};

    #[test]
    fn receptances_ahead_are_those_of_the_general_solver() {
        let track = track();
        let frequencies: Vec<f64> = (0..11).map(|k| 60.0 * 1.5_f64.powi(k)).collect();
        let nodes_m = track.layout().rail_nodes_m();
        let spacing_m = nodes_m[1] - nodes_m[0];
        for distance_m in [1.0, 9.0, -6.0].map(|nodes| nodes * spacing_m) {
            // Half a node further: the mean of two.
            let ahead = [0.0, 0.5 * spacing_m]
                .map(|more_m| receptances_ahead(&track, &frequencies, distance_m + more_m));
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
