//! The compared stretch of track: its geometry, and the part of it that contributes to a band.

use crate::bands::{Bands, CENTRE_RAD};
use std::f64::consts::{SQRT_2, TAU};
use std::ops::Range;
use tracktwin_parameters::{Track, TrackDesign};
use tracktwin_track::extension::ExtensionInstance;
use tracktwin_track::model::Mesh;

/// Number of spans modelled beyond the first and last compared sleeper.
const SPANS_BEYOND: usize = 16;

/// Number of rail elements per span and of elements per half sleeper (docs/accuracy.md).
pub(crate) const ELEMENTS: usize = 8;

/// Reach of a window beyond its ends, in standard deviations of its blur.
const BLUR_REACH: f64 = 3.5;

/// Rail nodes that contribute to a window, with weights that sum to one.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Index of the first node.
    pub first: usize,
    /// Weights of this node and of the nodes after it.
    pub shares: Vec<f64>,
}

impl Window {
    /// Range of the nodes.
    pub fn nodes(&self) -> Range<usize> {
        self.first..self.first + self.shares.len()
    }

    /// Weighted mean of values at rail nodes; `first` is the index of the node of `values[0]`.
    pub fn mean(&self, values: &[f64], first: usize) -> f64 {
        let seen = &values[self.first - first..][..self.shares.len()];
        self.shares.iter().zip(seen).map(|(share, value)| share * value).sum()
    }
}

/// Index of the section in which a sleeper lies farthest from the ends; of two equal ones the first. `None` if it lies
/// in no section. Sections are ranges of sleepers.
pub fn owner(sections: &[Range<usize>], sleeper: usize) -> Option<usize> {
    let depth = |section: usize| {
        let Range { start, end } = sections[section];
        (sleeper - start).min(end - sleeper - 1)
    };
    let there = (0..sections.len()).filter(|&section| sections[section].contains(&sleeper));
    there.reduce(|best, other| if depth(other) > depth(best) { other } else { best })
}

/// Standard deviation in m of the Gaussian by which a band's wavelet blurs positions, at this centre in Hz.
pub(crate) fn blur_m(speed_m_s: f64, centre_hz: f64) -> f64 {
    speed_m_s * CENTRE_RAD / (TAU * centre_hz * SQRT_2)
}

/// A stretch of sleepers and the track around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Track description with its priors.
    pub track: Track,
    /// Positions of the compared sleepers in m, in the coordinates of the recording.
    pub(crate) sleepers_x_m: Vec<f64>,
    /// Number of spans modelled beyond the first and the last compared sleeper. The continuation of the
    /// track is unknown; distant ends have less effect.
    pub spans_beyond: usize,
}

impl Section {
    /// A section of evenly spaced sleepers with the default length of track around it; `first_x_m` in m.
    pub fn new(track: impl Into<Track>, sleepers: usize, first_x_m: f64) -> Self {
        let track = track.into();
        let spacing_m = track.design.sleeper.spacing_m;
        let x_m = (0..sleepers).map(|sleeper| first_x_m + sleeper as f64 * spacing_m).collect();
        Self::at(track, x_m)
    }

    /// A section of sleepers at these positions in m, ascending, with the default length of track around it. The
    /// model's sleepers are evenly spaced: a position between two sleepers divides the model's span as it divides
    /// theirs.
    pub fn at(track: impl Into<Track>, sleepers_x_m: Vec<f64>) -> Self {
        Self { track: track.into(), sleepers_x_m, spans_beyond: SPANS_BEYOND }
    }

    /// Number of compared sleepers.
    pub const fn sleepers(&self) -> usize {
        self.sleepers_x_m.len()
    }

    /// Whether the track is V-Track, on which error rates of diagnoses were measured (docs/trial.md).
    pub fn is_v_track(&self) -> bool {
        self.track.design == TrackDesign::v_track()
    }

    /// Mesh of the whole track: the compared sleepers and the spans beyond them.
    pub fn mesh(&self) -> Mesh {
        Mesh::uniform(self.spans(), ELEMENTS, ELEMENTS)
    }

    /// Number of spans of the whole track.
    pub fn spans(&self) -> usize {
        self.sleepers() - 1 + 2 * self.spans_beyond
    }

    /// Distance of the furthest wheel from the measuring one, in spacings.
    pub(crate) fn furthest_wheel(&self) -> f64 {
        let design = &self.track.design;
        let distances_m = design.wheel.further_wheels_m.iter().map(|ahead_m| ahead_m.abs());
        distances_m.fold(0.0, f64::max) / design.sleeper.spacing_m
    }

    /// For each sleeper of the whole track, the index of the compared sleeper whose values it takes: its
    /// own, or those of the first or last compared sleeper.
    pub fn compared(&self) -> impl Iterator<Item = usize> + '_ {
        (1..self.spans())
            .map(|sleeper| sleeper.clamp(self.spans_beyond, self.last()) - self.spans_beyond)
    }

    /// Index in the whole track (from 0) of a compared sleeper.
    pub const fn in_track(&self, sleeper: usize) -> usize {
        self.spans_beyond + sleeper - 1
    }

    const fn last(&self) -> usize {
        self.spans_beyond + self.sleepers() - 1
    }

    /// Index of the rail node above a compared sleeper.
    pub const fn seat_node(&self, sleeper: usize) -> usize {
        self.node_above(self.in_track(sleeper))
    }

    /// Index of the rail node above a sleeper of the whole track.
    pub const fn node_above(&self, in_track: usize) -> usize {
        (in_track + 1) * ELEMENTS
    }

    /// Position on the model's track, in m, of a position of the recording in m.
    pub fn model_x_m(&self, x_m: f64) -> f64 {
        let spacing_m = self.track.design.sleeper.spacing_m;
        (self.spans_beyond as f64 + self.spans_from_first(x_m)) * spacing_m
    }

    /// Number of spans, with fractions, from the first compared sleeper to a position of the recording in m.
    pub(crate) fn spans_from_first(&self, x_m: f64) -> f64 {
        let x = &self.sleepers_x_m;
        let last = self.sleepers() - 1;
        let spacing_m = self.track.design.sleeper.spacing_m;
        if x_m <= x[0] {
            return (x_m - x[0]) / spacing_m;
        }
        if x_m >= x[last] {
            return last as f64 + (x_m - x[last]) / spacing_m;
        }
        let next = x.partition_point(|&sleeper_m| sleeper_m <= x_m);
        (next - 1) as f64 + (x_m - x[next - 1]) / (x[next] - x[next - 1])
    }

    /// Position of the middle of a compared sleeper's window, in m of the recording.
    pub fn x_m(&self, sleeper: usize) -> f64 {
        self.sleepers_x_m[sleeper]
    }

    /// Whether two stretches, `[from, to]` in m, are at most a spacing apart.
    pub fn are_beside(&self, one: [f64; 2], other: [f64; 2]) -> bool {
        let spacing_m = self.track.design.sleeper.spacing_m;
        one[0] - spacing_m <= other[1] && other[0] - spacing_m <= one[1]
    }

    /// Converts an extension from the coordinates of the recording (compared sleepers, positions in m) to
    /// those of the model's track. What acts at three in four sleepers goes on beyond an end that has it, as what acts
    /// at all of them does.
    pub fn in_model(&self, extension: &ExtensionInstance) -> ExtensionInstance {
        let mut placed = extension.clone();
        placed.x_m = extension.x_m.map(|ends| ends.map(|x_m| self.model_x_m(x_m)));
        placed.sleepers = extension.sleepers.as_ref().map(|numbers| self.acting(numbers));
        placed
    }

    /// Indices in the whole track of the sleepers at which an effect acts, from those of the compared ones.
    fn acting(&self, numbers: &[usize]) -> Vec<usize> {
        let last = self.sleepers() - 1;
        let at = |end: usize| are_most(numbers.len(), self.sleepers()) && numbers.contains(&end);
        let before = if at(0) { 0..self.in_track(0) } else { 0..0 };
        let behind = if at(last) { self.in_track(last) + 1..self.spans() - 1 } else { 0..0 };
        before.chain(numbers.iter().map(|&number| self.in_track(number))).chain(behind).collect()
    }

    /// Rail nodes that contribute to a sleeper's window at a speed and band centre in Hz.
    ///
    /// The wavelet blurs the window: the value at position `x` contains power from around `x`, weighted by
    /// a Gaussian. Its standard deviation is the distance that the wheel covers in `6 / (2 pi f sqrt 2)`.
    pub fn window(&self, sleeper: usize, speed_m_s: f64, centre_hz: f64) -> Window {
        let spacing_m = self.track.design.sleeper.spacing_m;
        let blur_m = blur_m(speed_m_s, centre_hz);
        let node_m = spacing_m / ELEMENTS as f64;
        let middle = self.seat_node(sleeper);
        let reach = ((0.5 * spacing_m + BLUR_REACH * blur_m) / node_m).ceil() as usize;
        let reach = reach.min(middle);
        let step = |distance_m: f64| 0.5 * libm::erf(distance_m / (SQRT_2 * blur_m));
        let weight = |node: usize| {
            let offset_m = (node as f64 - middle as f64) * node_m;
            step(0.5 * spacing_m - offset_m) - step(-0.5 * spacing_m - offset_m)
        };
        let last = self.spans() * ELEMENTS;
        let nodes = middle - reach..=(middle + reach).min(last);
        let sum: f64 = nodes.clone().map(weight).sum();
        Window { first: *nodes.start(), shares: nodes.map(|node| weight(node) / sum).collect() }
    }

    /// The windows of every compared sleeper and band at a speed: `[sleeper][band]`.
    pub fn windows(&self, speed_m_s: f64, bands: &Bands) -> Vec<Vec<Window>> {
        let of = |sleeper| {
            let bands = bands.centres_hz().iter();
            bands.map(|&hz| self.window(sleeper, speed_m_s, hz)).collect()
        };
        (0..self.sleepers()).map(of).collect()
    }
}

/// Whether some of all sleepers are three in four or more.
pub(crate) const fn are_most(some: usize, all: usize) -> bool {
    4 * some >= 3 * all
}

#[cfg(test)]
mod tests {
    use super::{Section, TrackDesign};

    #[test]
    fn stretches_are_beside_each_other_up_to_a_spacing_apart() {
        let section = Section::new(TrackDesign::v_track(), 25, 1.0);
        let are = |one, other| [section.are_beside(one, other), section.are_beside(other, one)];
        assert_eq!(are([2.0, 2.0], [2.12, 2.12]), [true; 2]);
        assert_eq!(are([2.0, 2.0], [2.13, 2.13]), [false; 2]);
        assert_eq!(are([1.0, 4.0], [2.5, 2.6]), [true; 2]);
    }

    #[test]
    fn what_most_sleepers_have_goes_on_beyond_the_ends_that_have_it() {
        let section = Section::new(TrackDesign::v_track(), 8, 1.0);
        let beyond = section.spans_beyond - 1;
        let of = |numbers: &[usize]| section.acting(numbers);
        let all: Vec<usize> = (0..section.spans() - 1).collect();
        let but = |hole: usize| -> Vec<usize> {
            all.iter().copied().filter(|it| *it != beyond + hole).collect()
        };
        assert_eq!(of(&[0, 1, 2, 3, 5, 6, 7]), but(4));
        assert_eq!(of(&[1, 2, 3, 4, 5, 6, 7]), all[beyond + 1..]);
        assert_eq!(of(&[0, 1, 2, 3, 4]), all[beyond..beyond + 5]);
    }

    /// The model's sleepers are evenly spaced, those of the recording are not quite.
    #[test]
    fn a_place_lies_between_the_same_sleepers_as_in_the_recording() {
        let section = Section::at(TrackDesign::v_track(), vec![1.0, 1.13, 1.25, 1.40]);
        let spans = |x_m: f64| section.spans_from_first(x_m);
        for (sleeper, x_m) in [1.0, 1.13, 1.25, 1.40].into_iter().enumerate() {
            assert!((spans(x_m) - sleeper as f64).abs() < 1e-9);
            assert_eq!(section.x_m(sleeper), x_m);
            let node_m = section.seat_node(sleeper) as f64 * 0.125 / 8.0;
            assert!((section.model_x_m(x_m) - node_m).abs() < 1e-9);
        }
        assert!((spans(1.065) - 0.5).abs() < 1e-9 && (spans(1.325) - 2.5).abs() < 1e-9);
        assert!((spans(0.875) + 1.0).abs() < 1e-9 && (spans(1.525) - 4.0).abs() < 1e-9);
    }
}
