//! Force laws that are active or inactive, depending on the position of the wheel.

use super::receptances::RailReceptances;
use crate::model::{ForceLaw, TrackModel};
use crate::time::StaticSolution;
use num_complex::Complex64;
use std::ops::Range;

/// Number of bisections between two nodes that locate the position where a law becomes active: to a
/// millionth of the distance.
const HALVINGS: usize = 20;

/// Number of spans on either side of a force law within which a standing wheel can change its state. Further wheels are
/// elsewhere.
const REACH_SPANS: f64 = 4.0;

/// Which force laws are active.
pub(super) type Hold = Vec<bool>;

/// The track linearised for small motions, with the wheel at each node of the rail.
///
/// Ballast under a gap supports the sleeper only if the wheel is near enough to close the gap. An active law
/// has the linearisation that it has under a wheel directly above it.
pub(super) struct States {
    /// The track in each of its states. The first state is the one with the wheel far away.
    pub(super) tracks: Vec<TrackModel>,
    /// Which laws are active in each state.
    pub(super) holds: Vec<Hold>,
    /// Share of each state in the halves of the rail elements next to each node: `[node][state]`.
    pub(super) shares: Vec<Vec<f64>>,
    /// The nodes near the laws. Beyond these nodes the track has the state of the nearest of them.
    pub(super) near: Range<usize>,
}

impl States {
    /// `None` if the track is the same for every position of the wheel.
    pub(super) fn new(model: &TrackModel) -> Option<Self> {
        if model.force_laws().is_empty() {
            return None;
        }
        let solution = StaticSolution::new(model)?;
        let hold_at = |x_m: f64| -> Option<Hold> {
            Some(solution.tangents(x_m)?.iter().map(|tangent| tangent.stiffness > 0.0).collect())
        };
        let nodes_m = model.layout().rail_nodes_m();
        let near = near(model);
        let at_nodes = at_nodes(nodes_m, &near, &hold_at)?;
        let above: Hold = model.force_laws().iter().map(holds_above).collect();
        if at_nodes.iter().all(|hold| *hold == above) {
            return None;
        }
        let (holds, stretches) = stretches(nodes_m, &at_nodes, &hold_at);
        let tracks = holds.iter().map(|hold| in_state(model, hold, &solution, nodes_m, &at_nodes));
        let tracks = tracks.collect::<Option<Vec<_>>>()?;
        let shares = shares(nodes_m, &stretches, tracks.len());
        Some(Self { tracks, holds: holds.into_iter().cloned().collect(), shares, near })
    }

    /// Receptances at each node, with the track in the state that it has while the wheel is at this
    /// node.
    pub(super) fn mix(&self, of: impl Fn(&TrackModel) -> RailReceptances) -> RailReceptances {
        let states: Vec<RailReceptances> = self.tracks.iter().map(of).collect();
        let mut mixed = states[0].clone();
        let mix = |node: usize, value: &dyn Fn(&RailReceptances) -> Complex64| -> Complex64 {
            self.shares[node].iter().zip(&states).map(|(share, state)| share * value(state)).sum()
        };
        for (line, nodes) in mixed.direct.iter_mut().enumerate() {
            for (node, receptance) in nodes.iter_mut().enumerate() {
                *receptance = mix(node, &|state| state.direct[line][node]);
            }
        }
        for (line, seats) in mixed.from_seats.iter_mut().enumerate() {
            for (seat, near) in seats.iter_mut().enumerate() {
                for (index, receptance) in near.values.iter_mut().enumerate() {
                    let value =
                        |state: &RailReceptances| state.from_seats[line][seat].values[index];
                    *receptance = mix(near.first + index, &value);
                }
            }
        }
        mixed
    }
}

/// The nodes within the reach of a law.
fn near(model: &TrackModel) -> Range<usize> {
    let reach_m = REACH_SPANS * model.design().sleeper.spacing_m;
    let laws_m = || model.force_laws().iter().map(|law| law.place_m);
    let further_m = || model.vehicle().further_wheels_m.iter().copied();
    // A wheel behind meets a law when the first one is past it.
    let from_m = laws_m().fold(f64::INFINITY, f64::min) - reach_m - further_m().fold(0.0, f64::max);
    let to_m =
        laws_m().fold(f64::NEG_INFINITY, f64::max) + reach_m - further_m().fold(0.0, f64::min);
    let nodes_m = model.layout().rail_nodes_m();
    let first = nodes_m.partition_point(|x_m| *x_m < from_m);
    first..nodes_m.partition_point(|x_m| *x_m <= to_m).max(first + 1)
}

/// Which laws are active with the wheel at each node. Beyond the nodes near the laws: the same as at the
/// nearest of these nodes.
fn at_nodes(
    nodes_m: &[f64],
    near: &Range<usize>,
    hold_at: &impl Fn(f64) -> Option<Hold>,
) -> Option<Vec<Hold>> {
    let within: Vec<Hold> =
        nodes_m[near.clone()].iter().map(|&x_m| hold_at(x_m)).collect::<Option<_>>()?;
    let node = |node: usize| within[node.clamp(near.start, near.end - 1) - near.start].clone();
    Some((0..nodes_m.len()).map(node).collect())
}

/// The states that occur, and the stretches of the rail that have them: the number of the state and
/// the place in m where it ends.
fn stretches<'h>(
    nodes_m: &[f64],
    at_nodes: &'h [Hold],
    hold_at: &impl Fn(f64) -> Option<Hold>,
) -> (Vec<&'h Hold>, Vec<(usize, f64)>) {
    let mut holds: Vec<&Hold> = Vec::new();
    let mut stretches: Vec<(usize, f64)> = Vec::new();
    for (&x_m, hold) in nodes_m.iter().zip(at_nodes) {
        let state = holds.iter().position(|known| *known == hold).unwrap_or_else(|| {
            holds.push(hold);
            holds.len() - 1
        });
        match stretches.last_mut() {
            Some((last, to_m)) if *last == state => *to_m = x_m,
            Some((last, to_m)) => {
                let is_so = |x_m| hold_at(x_m).as_ref() == Some(holds[*last]);
                *to_m = change_m([*to_m, x_m], is_so);
                stretches.push((state, x_m));
            }
            None => stretches.push((state, x_m)),
        }
    }
    (holds, stretches)
}

fn holds_above(law: &ForceLaw) -> bool {
    law.linear.stiffness > 0.0
}

/// The track with exactly these laws active, linearised with the wheel at a node where they are.
fn in_state(
    model: &TrackModel,
    hold: &Hold,
    solution: &StaticSolution<'_>,
    nodes_m: &[f64],
    at_nodes: &[Hold],
) -> Option<TrackModel> {
    let node = at_nodes.iter().position(|at_node| at_node == hold)?;
    let mut tangents = solution.tangents(nodes_m[node])?;
    for ((tangent, law), &holds) in tangents.iter_mut().zip(model.force_laws()).zip(hold) {
        if holds == holds_above(law) {
            *tangent = law.linear;
        }
    }
    Some(model.clone().with_tangents(&tangents))
}

/// The position in m between two places at which a condition that is true at the first place becomes
/// false.
fn change_m([mut from_m, mut to_m]: [f64; 2], is_so: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle_m = 0.5 * (from_m + to_m);
        if is_so(middle_m) {
            from_m = middle_m;
        } else {
            to_m = middle_m;
        }
    }
    0.5 * (from_m + to_m)
}

/// Share of each state in the halves of the rail elements next to each node, from consecutive stretches.
fn shares(nodes_m: &[f64], stretches: &[(usize, f64)], states: usize) -> Vec<Vec<f64>> {
    let last = nodes_m.len() - 1;
    let middle_m = |node: usize| 0.5 * (nodes_m[node] + nodes_m[node + 1]);
    let of_node = |node: usize| {
        let from_m = if node == 0 { nodes_m[0] } else { middle_m(node - 1) };
        let to_m = if node == last { nodes_m[last] } else { middle_m(node) };
        let mut shares = vec![0.0; states];
        let mut begin_m = from_m;
        for &(state, end_m) in stretches {
            let end_m = end_m.clamp(begin_m, to_m);
            shares[state] += (end_m - begin_m) / (to_m - from_m);
            begin_m = end_m;
        }
        shares
    };
    (0..=last).map(of_node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::ExtensionInstance;
    use crate::model::{Mesh, Support};
    use std::sync::Arc;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPANS: usize = 20;
    const ELEMENTS: usize = 8;

    fn track(gap_m: Option<f64>) -> TrackModel {
        track_of(&TrackDesign::v_track(), gap_m)
    }

    fn track_of(design: &TrackDesign, gap_m: Option<f64>) -> TrackModel {
        let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
        let extension = gap_m.map(|gap_m| {
            let hanging = ExtensionInstance::new("hanging_sleeper").on([9]).with("gap_m", gap_m);
            hanging.build(design, SPANS).unwrap()
        });
        let extensions: Vec<Arc<_>> = Vec::from_iter(extension);
        let mesh = Mesh::uniform(SPANS, ELEMENTS, ELEMENTS);
        TrackModel::build(design, &mesh, &supports, &extensions).unwrap()
    }

    fn direct(model: &TrackModel) -> Vec<Complex64> {
        RailReceptances::new(model, &[400.0], None).direct.remove(0)
    }

    #[test]
    fn a_gap_is_closed_under_the_wheel_and_open_while_it_is_far_away() {
        let [closing, plain, open] = [Some(1.6e-4), None, Some(4e-3)].map(track);
        let [closing, plain, open] = [&closing, &plain, &open].map(direct);
        let seat = 10 * ELEMENTS;
        // In parts of what the gap changes: ends of the sleeper may stay open.
        let distance = |node: usize, other: &[Complex64]| {
            (closing[node] - other[node]).norm() / (plain[node] - open[node]).norm()
        };
        assert!((plain[seat] - open[seat]).norm() > 0.1 * plain[seat].norm());
        assert!(distance(seat, &plain) < 0.05, "{}", distance(seat, &plain));
        for node in [seat - 2 * ELEMENTS, seat + 2 * ELEMENTS] {
            assert!(distance(node, &open) < 1e-6, "{}", distance(node, &open));
        }
    }

    #[test]
    fn the_place_where_a_gap_closes_moves_with_the_gap_from_node_to_node() {
        let open_shares = |gap_m: f64| {
            let states = States::new(&track(Some(gap_m))).unwrap();
            let sums: Vec<f64> = states.shares.iter().map(|shares| shares.iter().sum()).collect();
            assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 1e-9));
            // The first state is that of a wheel at the rail's end.
            states.shares.iter().map(|shares| shares[0]).sum::<f64>()
        };
        let shares: Vec<f64> = (0..20).map(|k| open_shares(1.2e-4 + 2e-6 * f64::from(k))).collect();
        let steps: Vec<f64> = shares.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| *step > 0.0 && *step < 1.0), "{steps:?}");
    }

    /// Every wheel of the vehicle presses a hanging sleeper down, not only the first.
    #[test]
    fn a_gap_is_closed_under_each_wheel() {
        let behind_m = -0.8;
        let mut design = TrackDesign::v_track();
        design.wheel.further_wheels_m = vec![behind_m];
        let states = States::new(&track_of(&design, Some(1.6e-4))).unwrap();
        let is_closed = |node: usize| states.shares[node][0] < 1.0;
        let seat = 10 * ELEMENTS;
        let spacing_m = design.sleeper.spacing_m;
        let later = seat + (-behind_m / spacing_m * ELEMENTS as f64).round() as usize;
        assert!(is_closed(seat) && is_closed(later));
        assert!(!is_closed(usize::midpoint(seat, later)));
        assert!(states.near.contains(&later));
    }

    #[test]
    fn a_track_without_force_laws_has_no_states() {
        assert!(States::new(&track(None)).is_none());
        assert!(States::new(&track(Some(4e-3))).is_none());
    }
}
