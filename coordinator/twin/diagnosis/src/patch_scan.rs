//! Differences from the model that no kind explains: patches of the residual with a constant wavelength or a
//! constant frequency at all speeds.
//!
//! In a patch, the power of a band at neighbouring sleepers is higher than the re-tuned model predicts. In a
//! patch of constant frequency it may also be lower. Such patches are visible in a plot of the residual.

use crate::bands::{CENTRE_RAD, gain};
use crate::calibration::{Calibration, Problem};
use crate::candidate::{Candidate, parameter};
use crate::section::Section;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use tracktwin_track::extension::{CORRUGATION, ExtensionInstance};
use tracktwin_track::model::Roughness;

/// Number of patches per octave of wavelength or frequency.
const PER_OCTAVE: f64 = 12.0;

/// Numbers of sleepers of a patch. Effects on the whole track belong to the surface spectrum and the sensor
/// response.
const LENGTHS: [usize; 8] = [1, 2, 3, 4, 6, 8, 11, 14];

/// Largest share of the track that a patch covers.
const SHARE_MAX: f64 = 0.6;

/// Power ratio of a line to its surroundings that defines the shape of a patch: 10 dB.
const RATIO: f64 = 10.0;

/// Smallest share of a patch that the baseline cannot reproduce.
const LEFT_MIN: f64 = 0.05;

/// Quantity of a patch that does not depend on the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fixed {
    /// Wavelength in m: the patch belongs to the rail surface.
    Wavelength(f64),
    /// Frequency in Hz: the patch belongs to track or vehicle.
    Frequency(f64),
}

/// A detected patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Quantity that does not depend on the speed.
    pub fixed: Fixed,
    /// Range of the compared sleepers.
    pub sleepers: Range<usize>,
    /// Natural logarithm of the ratio of measured to predicted power in the middle of the band.
    pub height: f64,
    /// `height` divided by its standard deviation.
    pub deviations: f64,
}

/// Whitened shape of a patch at one sleeper; it is the same at all sleepers.
struct Shape {
    fixed: Fixed,
    column: DVector<f64>,
    /// Product of the derivatives with the shape, for each sleeper.
    projected_gradient: Vec<DVector<f64>>,
}

/// Matched filter of a patch.
struct Filter {
    shape: usize,
    sleepers: Range<usize>,
    imitation: DVector<f64>,
    /// Squared norm of the whitened patch after the baseline was fitted again.
    detectability: f64,
}

/// All patches of a calibrated track.
pub(crate) struct PatchScan {
    shapes: Vec<Shape>,
    filters: Vec<Filter>,
    sleepers: usize,
}

impl Patch {
    /// Gain in log predictive density of the held-out data from this patch, in nats. `before` is the same
    /// patch, found without these data.
    pub(crate) fn gain_over(&self, before: &Self) -> f64 {
        let toward = |patch: &Self| 0.5 * patch.deviations.powi(2) * patch.height.signum();
        (toward(self) - toward(before)) * before.height.signum()
    }

    /// Corrugation candidate for a patch of constant wavelength; `None` for a patch of constant frequency.
    /// `level` is the irregularity level to which the corrugation is added.
    pub(crate) fn as_waves(&self, section: &Section, level: f64) -> Option<Candidate> {
        let Fixed::Wavelength(length_m) = self.fixed else { return None };
        let half_m = 0.5 * section.track.design.sleeper.spacing_m;
        let (first, last) = (self.sleepers.start, self.sleepers.end - 1);
        let stretch_m = [section.x_m(first) - half_m, section.x_m(last) + half_m];
        // Mean square of the waves: what they add to the band, whose width is 0.3 of its middle.
        let wave_number = TAU / length_m;
        let width = wave_number * PI.sqrt() / CENTRE_RAD;
        let surface = Roughness::between(level, section.track.wavelengths_m);
        let beside = surface.density(wave_number) * width;
        let amplitude_m = (2.0 * self.height.exp_m1().max(0.0) * beside).sqrt();
        let kind = CORRUGATION;
        let free = kind.screening.suggested.iter().map(|name| parameter(kind, name)).collect();
        let extension = ExtensionInstance::new(kind.physics).at(stretch_m);
        let trials = vec![vec![length_m, amplitude_m]];
        let length_ratio = section.track.design.length_ratio();
        Some(Candidate { kind, extension, free, trials, length_ratio, choice_nats: 0.0 })
    }
}

impl PatchScan {
    /// Computes the filters for a calibrated track.
    pub(crate) fn new(problem: &Problem<'_>, current: &Calibration) -> Self {
        let sleepers = problem.forward.section.sleepers();
        let shapes: Vec<Shape> =
            kept(problem).into_par_iter().map(|fixed| shape(problem, current, fixed)).collect();
        let most = (SHARE_MAX * sleepers as f64) as usize;
        let runs = runs(LENGTHS.into_iter().filter(|&length| length <= most), sleepers);
        let filters = (0..shapes.len())
            .into_par_iter()
            .flat_map_iter(|number| filters(number, &shapes[number], current, &runs))
            .collect();
        Self { shapes, filters, sleepers }
    }

    /// The patches of one wavelength or frequency, over every number of sleepers.
    pub(crate) fn of_every_length(
        problem: &Problem<'_>,
        current: &Calibration,
        fixed: Fixed,
    ) -> Self {
        let sleepers = problem.forward.section.sleepers();
        let shapes = vec![shape(problem, current, fixed)];
        let filters = filters(0, &shapes[0], current, &runs(1..=sleepers, sleepers)).collect();
        Self { shapes, filters, sleepers }
    }

    /// The patch with the largest deviation in a whitened residual, among those for which `is_one` is true.
    /// `projected_gradient` is the product of the residual with the baseline's derivatives.
    pub(crate) fn best(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
        is_one: impl Fn(Fixed, &Range<usize>) -> bool + Sync,
    ) -> Option<Patch> {
        let each = residual.len() / self.sleepers;
        let dots: Vec<Vec<f64>> = self
            .shapes
            .par_iter()
            .map(|shape| {
                let at = |sleeper| shape.column.dot(&residual.rows(sleeper * each, each));
                (0..self.sleepers).map(at).collect()
            })
            .collect();
        let score = |filter: &Filter| {
            let dots = &dots[filter.shape][filter.sleepers.clone()];
            let along = dots.iter().sum::<f64>() - filter.imitation.dot(projected_gradient);
            let deviations = along / filter.detectability.sqrt();
            // A surface adds power; it takes none away.
            let is_surface = matches!(self.shapes[filter.shape].fixed, Fixed::Wavelength(_));
            (if is_surface { deviations } else { deviations.abs() }, along)
        };
        let is_allowed = |it: &&Filter| is_one(self.shapes[it.shape].fixed, &it.sleepers);
        let allowed = self.filters.par_iter().filter(is_allowed);
        let scored = allowed.map(|filter| (score(filter), filter));
        let ((deviations, along), filter) = scored.max_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
        let peak = RATIO.ln();
        Some(Patch {
            fixed: self.shapes[filter.shape].fixed,
            sleepers: filter.sleepers.clone(),
            height: peak * along / filter.detectability,
            deviations,
        })
    }
}

/// Wavelengths that lie in the bands of two speeds at least, and the frequencies of all bands.
fn kept(problem: &Problem<'_>) -> Vec<Fixed> {
    let centres = problem.forward.bands.centres_hz();
    let bands_hz = [centres[0], centres[centres.len() - 1]];
    let frequencies = steps(bands_hz).map(Fixed::Frequency);
    let wavelengths = lengths_m(&problem.forward.speeds_m_s, bands_hz).map(steps);
    frequencies.chain(wavelengths.into_iter().flatten().map(Fixed::Wavelength)).collect()
}

/// Shortest wavelength in m whose frequency lies in the bands at all speeds, and longest one for which it does at two
/// speeds; `None` for a single speed. Of slow passes long waves lie below the bands.
fn lengths_m(speeds_m_s: &[f64], [low_hz, high_hz]: [f64; 2]) -> Option<[f64; 2]> {
    let mut speeds_m_s = speeds_m_s.to_vec();
    speeds_m_s.sort_by(|a, b| b.total_cmp(a));
    let [fastest, second, ..] = speeds_m_s[..] else { return None };
    Some([fastest / high_hz, second / low_hz])
}

/// Values from one to the other, evenly in the logarithm; none if the second is smaller.
fn steps([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let count = if to > from { (PER_OCTAVE * (to / from).log2()) as usize + 1 } else { 0 };
    (0..count).map(move |step| from * (step as f64 / PER_OCTAVE).exp2())
}

fn shape(problem: &Problem<'_>, current: &Calibration, fixed: Fixed) -> Shape {
    let forward = problem.forward;
    let sleepers = forward.section.sleepers();
    let centres = forward.bands.centres_hz();
    let level = |row: usize| {
        let (_, speed, band) = forward.place(row);
        let frequency_hz = match fixed {
            Fixed::Wavelength(length_m) => forward.speeds_m_s[speed] / length_m,
            Fixed::Frequency(frequency_hz) => frequency_hz,
        };
        let gain = gain(centres[band], frequency_hz);
        ((RATIO - 1.0) * gain * gain).ln_1p()
    };
    let levels = DMatrix::from_fn(forward.count(), 1, |row, _| level(row));
    let observation = problem.observation;
    let whitened = observation.fitted_rows(&observation.whiten_matrix(&levels));
    let each = whitened.nrows() / sleepers;
    let column = whitened.view((0, 0), (each, 1)).column(0).into_owned();
    let projected_gradient = (0..sleepers)
        .map(|sleeper| current.jacobian.rows(sleeper * each, each).tr_mul(&column))
        .collect();
    Shape { fixed, column, projected_gradient }
}

/// Every run of neighbouring sleepers with one of these lengths.
fn runs(lengths: impl Iterator<Item = usize>, sleepers: usize) -> Vec<Range<usize>> {
    let of = |length: usize| (0..=sleepers - length).map(move |first| first..first + length);
    lengths.flat_map(of).collect()
}

fn filters(
    number: usize,
    shape: &Shape,
    current: &Calibration,
    runs: &[Range<usize>],
) -> impl Iterator<Item = Filter> {
    let square = shape.column.norm_squared();
    let filter = move |run: &Range<usize>| {
        let count = run.len() as f64;
        let mut projected_gradient = DVector::zeros(current.values.len());
        shape.projected_gradient[run.clone()].iter().for_each(|part| projected_gradient += part);
        let imitation = current.precision.solve(&projected_gradient);
        let detectability = count * square - projected_gradient.dot(&imitation);
        (detectability > LEFT_MIN * count * square).then_some(Filter {
            shape: number,
            sleepers: run.clone(),
            imitation,
            detectability,
        })
    };
    runs.iter().filter_map(filter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_that_two_of_three_speeds_show_are_looked_for() {
        let [shortest_m, longest_m] = lengths_m(&[11.0, 22.0, 16.0], [100.0, 5000.0]).unwrap();
        assert_eq!((shortest_m, longest_m), (22.0 / 5000.0, 0.16));
        assert_eq!(lengths_m(&[11.0], [100.0, 5000.0]), None);
    }
}
