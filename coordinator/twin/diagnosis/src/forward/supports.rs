//! Changes of the power over every window from the supports of the sleepers near it.
//!
//! The sum over a window's nodes and a band's lines runs over lines first, on stretches of the rail. A sum
//! node by node, as in [`Transfer::sensitivity`], takes several times as long.

use super::Forward;
use crate::section::Window;
use crate::transfer::Transfer;
use num_complex::Complex64;
use rayon::prelude::*;
use std::ops::Range;
use tracktwin_track::frequency::vectorized;

/// Number of varied values of a support.
pub(super) const VARIED: usize = 5;

/// Number of sleepers on either side whose supports affect a sleeper's window.
pub(super) const NEIGHBOURS: usize = 9;

/// Change of the dynamic stiffness at the rail seats: `[line][sleeper of the track]`.
pub(super) type Variation = Vec<Vec<Complex64>>;

/// Changes of the power at level one, by sleeper of the track.
pub(super) struct SupportChanges {
    by_sleeper: Vec<FromSleeper>,
    /// Number of powers per window: speeds times bands.
    per_sleeper: usize,
}

/// Changes from the support of one sleeper, over the windows near it.
struct FromSleeper {
    near: Range<usize>,
    /// `[compared sleeper near][speed and band][value]`.
    changes: Vec<[f64; VARIED]>,
}

impl SupportChanges {
    /// Computes the changes from the variations of the stiffness at the seats and the spectrum of the
    /// surface, `[speed][line]`.
    pub(super) fn new(
        forward: &Forward,
        transfer: &Transfer,
        variations: &[Variation; VARIED],
        excitation: &[Vec<f64>],
    ) -> Self {
        let of = |in_track| FromSleeper::new(forward, transfer, variations, excitation, in_track);
        let sleepers = forward.section.spans() - 1;
        let by_sleeper = (0..sleepers).into_par_iter().map(of).collect();
        Self { by_sleeper, per_sleeper: forward.per_sleeper() }
    }

    /// Changes over the window of a compared sleeper from the support of the sleeper `in_track`. `row`
    /// counts speeds and bands.
    pub(super) fn at(&self, in_track: usize, compared: usize, row: usize) -> &[f64; VARIED] {
        let FromSleeper { near, changes } = &self.by_sleeper[in_track];
        &changes[(compared - near.start) * self.per_sleeper + row]
    }
}

impl FromSleeper {
    fn new(
        forward: &Forward,
        transfer: &Transfer,
        variations: &[Variation; VARIED],
        excitation: &[Vec<f64>],
        in_track: usize,
    ) -> Self {
        let section = &forward.section;
        let is_near =
            |&compared: &usize| section.in_track(compared).abs_diff(in_track) <= NEIGHBOURS;
        let first = (0..section.sleepers()).find(is_near).unwrap_or(section.sleepers());
        let near =
            first..(first..section.sleepers()).take_while(is_near).last().map_or(first, |c| c + 1);
        if near.is_empty() {
            return Self { near, changes: Vec::new() };
        }
        let nodes = nodes(forward, near.clone());
        let changes = vectorized(
            #[inline(always)]
            || {
                let by_line = by_line(transfer, variations, in_track, &nodes);
                over_windows(forward, excitation, &by_line, &near, &nodes)
            },
        );
        Self { near, changes }
    }
}

/// Changes of the power at each node from the support of one sleeper: `[line][value][node]`.
#[expect(clippy::inline_always, reason = "must be compiled for each instruction set")]
#[inline(always)]
fn by_line(
    transfer: &Transfer,
    variations: &[Variation; VARIED],
    in_track: usize,
    nodes: &Range<usize>,
) -> Vec<f64> {
    let lines = variations[0].len();
    let mut changes = vec![0.0; lines * VARIED * nodes.len()];
    for (index, changes) in changes.chunks_exact_mut(nodes.len().max(1)).enumerate() {
        let (line, value) = (index / VARIED, index % VARIED);
        let varied = variations[value][line][in_track];
        let roots = transfer.by_seat(line, in_track, nodes.clone());
        for (change, root) in changes.iter_mut().zip(roots) {
            *change = (root * root * varied).re;
        }
    }
    changes
}

/// Sums of these changes over the windows of nearby sleepers: `[sleeper near][speed and band][value]`.
#[expect(clippy::inline_always, reason = "must be compiled for each instruction set")]
#[inline(always)]
fn over_windows(
    forward: &Forward,
    excitation: &[Vec<f64>],
    by_line: &[f64],
    near: &Range<usize>,
    nodes: &Range<usize>,
) -> Vec<[f64; VARIED]> {
    let (bands, length) = (forward.bands.count(), VARIED * nodes.len());
    let mut changes = vec![[0.0; VARIED]; near.len() * forward.per_sleeper()];
    let mut sums = vec![0.0; length];
    for row in 0..forward.per_sleeper() {
        let (speed, band) = (row / bands, row % bands);
        sums.fill(0.0);
        for &(line, weight) in forward.bands.weights(band) {
            let weight = weight * excitation[speed][line];
            for (sum, change) in sums.iter_mut().zip(&by_line[line * length..][..length]) {
                *sum += weight * change;
            }
        }
        for (index, compared) in near.clone().enumerate() {
            let window = &forward.windows[speed][compared][band];
            changes[index * forward.per_sleeper() + row] =
                std::array::from_fn(|value| window.mean(&sums[value * nodes.len()..], nodes.start));
        }
    }
    changes
}

/// Range of all nodes in the windows of some sleepers.
fn nodes(forward: &Forward, sleepers: Range<usize>) -> Range<usize> {
    let speeds = forward.windows.iter();
    let seen = speeds.flat_map(|speed| speed[sleepers.clone()].iter().flatten().map(Window::nodes));
    let all = seen.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
    all.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::section::Section;
    use num_complex::Complex64;
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn sums_by_lines_first_are_those_node_by_node() {
        let section = Section::new(TrackDesign::v_track(), 3, 1.0);
        let forward = Forward::new(section, Bands::new(300.0, 2000.0), &[13.0, 7.0], vec![0.0; 2]);
        let values = forward.unknowns.typical();
        let transfer = forward.transfer(&values, &[], true).unwrap();
        let excitation = forward.excitation(&transfer, &values);
        let lines = forward.bands.lines_hz().len();
        let sleepers = forward.section.spans() - 1;
        let variations: [Variation; VARIED] = std::array::from_fn(|value| {
            let at = |line: usize, sleeper: usize| {
                Complex64::from_polar(1.0 + value as f64, (line * sleeper) as f64)
            };
            (0..lines).map(|line| (0..sleepers).map(|s| at(line, s)).collect()).collect()
        });
        let changes = SupportChanges::new(&forward, &transfer, &variations, &excitation);
        let (compared, speed, band) = (2, 1, 7);
        let row = speed * forward.bands.count() + band;
        let window = &forward.windows[speed][compared][band];
        let middle = forward.section.in_track(compared);
        for in_track in [middle - NEIGHBOURS, middle, middle + NEIGHBOURS] {
            let plain: [f64; VARIED] = std::array::from_fn(|value| {
                let of_line = |&(line, weight): &(usize, f64)| {
                    let sensitivity = transfer.sensitivity(window, line, in_track);
                    weight
                        * excitation[speed][line]
                        * (sensitivity * variations[value][line][in_track]).re
                };
                forward.bands.weights(band).iter().map(of_line).sum()
            });
            for (quick, plain) in changes.at(in_track, compared, row).iter().zip(plain) {
                // Rounding of some hundred terms, of which some cancel.
                assert!((quick / plain - 1.0).abs() < 1e-10, "{quick} {plain}");
            }
        }
    }
}
