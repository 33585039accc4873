//! Null model: differences between recording and prediction when nothing is left out.
//!
//! Time simulations of the calibrated track over random surfaces give two quantities: the offset of the log
//! powers of one pass from their expected value, and their covariance. The covariance extends over bands
//! and, at equal wave numbers, over speeds, because all speeds share one surface.

use crate::forward::Forward;
use crate::section::Section;
use crate::spectra::log_powers;
use nalgebra::{Cholesky, DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;
use tracktwin_signal::Signal;
use tracktwin_track::extension::Extension;
use tracktwin_track::model::{Mesh, Roughness, Surface, TrackModel};
use tracktwin_track::time::{self, Pass, PassError};

/// Time step and sample interval in s.
const TIME_STEP_S: f64 = 1e-5;

/// Number of spans simulated beyond the first and the last sleeper; the ends of the track hardly affect the
/// covariance.
const SPANS_BEYOND: usize = 8;

/// Number of rail elements per span, and of elements per half sleeper, as in campaigns (docs/accuracy.md).
const ELEMENTS: usize = 4;
const SLEEPER_ELEMENTS: usize = 8;

/// Number of spans before the first window and after the last.
const RUN_IN_SPANS: f64 = 4.0;

/// Number of surfaces that are simulated together.
const AT_A_TIME: u64 = 8;

/// Step of the grid of logarithms on which null models are simulated. A change of the stiffness by a fifth
/// has little effect on the covariance.
const GRID_STEP: f64 = 0.4;

/// Shrinkage of the covariance towards its diagonal; the number of samples is only a few times the number
/// of log powers.
const SHRINKAGE: f64 = 0.03;

/// Standard deviation of the prediction error in nats: 0.1 dB.
const PREDICTION_ERROR: f64 = 0.025;

/// Correlation length of the prediction error in bands.
const PREDICTION_LENGTH: f64 = 1.5;

/// Differences of simulated and predicted log powers when nothing is left out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NullModel {
    /// Number of log powers per sleeper.
    per_sleeper: usize,
    /// One row per simulation: simulated minus predicted log powers, in the order of [`Forward`].
    pub differences: Vec<Vec<f64>>,
}

impl NullModel {
    /// Version of the simulation and prediction of null models, in addition to that of the physics. Stored
    /// null models of another version are simulated again. A test fails if the version must be raised.
    pub const VERSION: u32 = 2;

    /// Simulates passes over `surfaces` random surfaces with the given values. All irregularity levels are
    /// replaced by their mean.
    ///
    /// # Errors
    /// [`NullError`] if a simulation fails.
    pub fn simulate(
        forward: &Forward,
        values: &DVector<f64>,
        surfaces: u64,
        seed: u64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Self, NullError> {
        let differences =
            simulated(&with_near_ends(forward), values, &[], [surfaces, seed], progress)?;
        let differences = differences.iter().map(|it| it.as_slice().to_vec()).collect();
        Ok(Self { per_sleeper: forward.per_sleeper(), differences })
    }

    /// Restores a null model from stored numbers: one simulation after the other, each in the order of
    /// [`Forward`].
    ///
    /// `None` if the count of numbers does not match the forward model.
    pub fn from_numbers(forward: &Forward, numbers: &[f64]) -> Option<Self> {
        let whole = !numbers.is_empty() && numbers.len().is_multiple_of(forward.count());
        let differences = numbers.chunks_exact(forward.count()).map(<[f64]>::to_vec).collect();
        whole.then(|| Self { per_sleeper: forward.per_sleeper(), differences })
    }

    /// Values for the simulation of a null model: rounded to a coarse grid and equal at all sleepers, so
    /// that similar tracks share a null model.
    pub fn grid_values(forward: &Forward, values: &DVector<f64>) -> DVector<f64> {
        let unknowns = &forward.unknowns;
        let mut grid = unknowns.typical();
        for range in [unknowns.ballast(), unknowns.railpad()] {
            let mean = values.rows(range.start, range.len()).mean();
            range.for_each(|index| grid[index] = (mean / GRID_STEP).round() * GRID_STEP);
        }
        for index in unknowns.global() {
            grid[index] = (values[index] / GRID_STEP).round() * GRID_STEP;
        }
        grid
    }

    /// Mean difference of the log powers of a sleeper, over all simulations and sleepers.
    pub fn offset(&self) -> DVector<f64> {
        let mut sum = DVector::zeros(self.per_sleeper);
        let mut count = 0.0;
        for part in self.parts() {
            sum += DVector::from_column_slice(part);
            count += 1.0;
        }
        sum / count
    }

    /// The offset repeated for `sleepers` sleepers.
    pub fn offset_of(&self, sleepers: usize) -> DVector<f64> {
        let offset = self.offset();
        DVector::from_fn(sleepers * self.per_sleeper, |row, _| offset[row % self.per_sleeper])
    }

    /// Covariance of the log powers of a sleeper about the offset, with shrinkage towards its diagonal. It
    /// includes the variation between passes and the prediction error.
    ///
    /// `pass_variance` is the variance of the mean over the passes, one value per speed and band.
    pub fn covariance(&self, bands: usize, pass_variance: &DVector<f64>) -> DMatrix<f64> {
        let simulated = self.simulated_covariance();
        let further = further_covariance(&simulated, bands, pass_variance);
        (1.0 - SHRINKAGE) * simulated + further
    }

    /// Simulated differences minus their offset. A random draw adds the variation that the simulations
    /// lack: that between passes and the prediction error. The result has the covariance
    /// [`NullModel::covariance`].
    pub(crate) fn drawn(&self, bands: usize, pass_variance: &DVector<f64>) -> Vec<DVector<f64>> {
        let offset = self.offset();
        let further = further_covariance(&self.simulated_covariance(), bands, pass_variance);
        // What is no covariance makes no observation either, which is told there.
        let none = || DMatrix::zeros(self.per_sleeper, self.per_sleeper);
        let factor = Cholesky::new(further).map_or_else(none, Cholesky::unpack);
        let draw = |(number, difference): (usize, &Vec<f64>)| {
            let mut random = ChaCha8Rng::seed_from_u64(number as u64);
            let mut drawn = DVector::from_column_slice(difference);
            for first in (0..drawn.len()).step_by(self.per_sleeper) {
                let normal =
                    DVector::from_fn(self.per_sleeper, |_, _| StandardNormal.sample(&mut random));
                let mut sleeper = drawn.rows_mut(first, self.per_sleeper);
                sleeper -= &offset;
                sleeper *= (1.0 - SHRINKAGE).sqrt();
                sleeper += &factor * normal;
            }
            drawn
        };
        self.differences.par_iter().enumerate().map(draw).collect()
    }

    fn simulated_covariance(&self) -> DMatrix<f64> {
        let offset = self.offset();
        let mut sum = DMatrix::zeros(self.per_sleeper, self.per_sleeper);
        let mut count = 0.0;
        for part in self.parts() {
            let difference = DVector::from_column_slice(part) - &offset;
            sum.ger(1.0, &difference, &difference, 1.0);
            count += 1.0;
        }
        sum / (count - 1.0)
    }

    fn parts(&self) -> impl Iterator<Item = &[f64]> {
        self.differences.iter().flat_map(|row| row.chunks_exact(self.per_sleeper))
    }
}

/// Part of the covariance that is added to the simulated one, including the diagonal part of the shrinkage.
fn further_covariance(
    simulated: &DMatrix<f64>,
    bands: usize,
    pass_variance: &DVector<f64>,
) -> DMatrix<f64> {
    let deviation = simulated.diagonal().map(f64::sqrt);
    DMatrix::from_fn(simulated.nrows(), simulated.ncols(), |i, j| {
        let mut value = if i == j { 1e-6 + SHRINKAGE * simulated[(i, i)] } else { 0.0 };
        if i / bands == j / bands {
            let correlation = simulated[(i, j)] / (deviation[i] * deviation[j]);
            value += correlation * (pass_variance[i] * pass_variance[j]).sqrt();
            let distance = (i as f64 - j as f64) / PREDICTION_LENGTH;
            value += PREDICTION_ERROR.powi(2) * (-0.5 * distance * distance).exp();
        }
        value
    })
}

/// Reason why no null model exists.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NullError {
    /// The calibrated track cannot be built.
    #[error(transparent)]
    Model(#[from] tracktwin_track::model::ModelError),
    /// The simulation of a pass fails.
    #[error(transparent)]
    Pass(#[from] PassError),
    /// A simulated acceleration is not finite.
    #[error("a simulated pass is no signal: {0}")]
    Signal(#[from] tracktwin_signal::SignalError),
}

/// The values with one level, the unmodified surface spectrum and no gains.
fn plain(forward: &Forward, values: &DVector<f64>) -> DVector<f64> {
    let unknowns = &forward.unknowns;
    let mut plain = values.clone();
    let level = values.rows(unknowns.level().start, unknowns.level().len()).mean();
    unknowns.level().for_each(|index| plain[index] = level);
    // What follows is the recording's, not the track's.
    (unknowns.spectrum().start..unknowns.count()).for_each(|index| plain[index] = 0.0);
    plain
}

/// A forward model for simulated passes: near ends, where all wheels are still on the track, and no noise.
///
/// Further wheels increase the small parts of the covariance (docs/diagnosis.md, section 4): what they send
/// through the rail meets the motion of the first wheel with a phase that differs from place to place.
fn with_near_ends(forward: &Forward) -> Forward {
    let further = forward.section.furthest_wheel().ceil() as usize;
    let mut quiet = forward.with_ends(SPANS_BEYOND + further);
    quiet.noise_density.fill(0.0);
    quiet
}

/// The same with the first wheel only: with a force law further wheels take twenty times the time.
pub(crate) fn with_one_wheel(forward: &Forward) -> Forward {
    let mut alone = forward.clone();
    alone.section.track.design.wheel.further_wheels_m.clear();
    with_near_ends(&alone)
}

/// Simulated minus expected log powers over random surfaces, with all levels replaced by their mean.
/// `quiet` is a forward model with near ends; the extensions belong to its track.
///
/// # Errors
/// [`NullError`] if a simulation fails.
pub(crate) fn simulated(
    quiet: &Forward,
    values: &DVector<f64>,
    extensions: &[Arc<dyn Extension>],
    [surfaces, seed]: [u64; 2],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<DVector<f64>>, NullError> {
    let values = plain(quiet, values);
    let level = values[quiet.unknowns.level().start].exp();
    let expected = quiet.log_power(&values, extensions)?;
    let section = &quiet.section;
    let supports = quiet.unknowns.supports(section, &values);
    let mesh = Mesh::uniform(section.spans(), ELEMENTS, SLEEPER_ELEMENTS);
    let model = TrackModel::build(&section.track.design, &mesh, &supports, extensions)?;
    let roughness = Roughness::between(level, section.track.wavelengths_m);
    let done = std::sync::atomic::AtomicU64::new(0);
    let groups: Vec<u64> = (0..surfaces).step_by(AT_A_TIME as usize).collect();
    let differences: Vec<Vec<DVector<f64>>> = groups
        .into_par_iter()
        .map(|first| {
            let seeds = first..(first + AT_A_TIME).min(surfaces);
            let surfaces: Vec<_> =
                seeds.map(|s| model.surface(&roughness, seed.wrapping_add(s))).collect();
            let log_powers = simulate(quiet, &model, &surfaces)?;
            let count = done.fetch_add(surfaces.len() as u64, std::sync::atomic::Ordering::Relaxed);
            progress((count + surfaces.len() as u64) as f64);
            Ok(log_powers.into_iter().map(|log_power| log_power - &expected).collect())
        })
        .collect::<Result<_, NullError>>()?;
    Ok(differences.into_iter().flatten().collect())
}

/// Log powers of passes over surfaces at all speeds, in the order of [`Forward`].
fn simulate(
    forward: &Forward,
    model: &TrackModel,
    surfaces: &[Surface],
) -> Result<Vec<DVector<f64>>, NullError> {
    let mut all = vec![DVector::zeros(forward.count()); surfaces.len()];
    let models = vec![model.clone(); surfaces.len()];
    for (speed, &speed_m_s) in forward.speeds_m_s.iter().enumerate() {
        let pass = pass(&forward.section, speed_m_s);
        let windows = windows(&forward.section, &pass);
        for (record, all) in time::passes(&models, &pass, surfaces)?.into_iter().zip(&mut all) {
            let signal = Signal::new(1.0 / TIME_STEP_S, record.acceleration_m_s2)?;
            let powers = log_powers(&signal, &windows, &forward.bands);
            for (sleeper, powers) in powers.into_iter().flatten().enumerate() {
                for (band, power) in powers.into_iter().enumerate() {
                    let row =
                        sleeper * forward.per_sleeper() + speed * forward.bands.count() + band;
                    all[row] = power;
                }
            }
        }
    }
    Ok(all)
}

fn pass(section: &Section, speed_m_s: f64) -> Pass {
    let spacing_m = section.track.design.sleeper.spacing_m;
    let first_m = section.model_x_m(section.x_m(0));
    let last_m = first_m + (section.sleepers() - 1) as f64 * spacing_m;
    Pass {
        speed_m_s,
        start_m: first_m - RUN_IN_SPANS * spacing_m,
        end_m: last_m + RUN_IN_SPANS * spacing_m,
        time_step_s: TIME_STEP_S,
        local_flexibility: true,
    }
}

fn windows(section: &Section, pass: &Pass) -> Vec<Option<Range<usize>>> {
    let spacing_m = section.track.design.sleeper.spacing_m;
    let first_m = section.model_x_m(section.x_m(0)) - pass.start_m;
    let sample = |x_m: f64| (x_m / (pass.speed_m_s * pass.time_step_s)).round() as usize;
    (0..section.sleepers())
        .map(|sleeper| {
            let middle_m = first_m + sleeper as f64 * spacing_m;
            Some(sample(middle_m - 0.5 * spacing_m)..sample(middle_m + 0.5 * spacing_m))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use tracktwin_parameters::Preset;

    #[test]
    fn further_wheels_on_both_sides_stay_on_the_track_and_are_heard() {
        let null = |further_wheels_m: &[f64]| {
            let mut design = Preset::Concrete60E1.design();
            design.wheel.further_wheels_m = further_wheels_m.to_vec();
            let section = Section::new(design, 2, 6.0);
            let forward = Forward::new(section, Bands::new(200.0, 1000.0), &[60.0], vec![0.0]);
            let values = NullModel::grid_values(&forward, &forward.unknowns.typical());
            NullModel::simulate(&forward, &values, 1, 7, &|_| ()).unwrap().differences
        };
        let alone = null(&[]);
        for further in [-2.56, 9.0] {
            let heard = null(&[further]);
            let changes = heard[0].iter().zip(&alone[0]).map(|(a, b)| (a - b).abs());
            assert!(changes.fold(0.0, f64::max) > 0.03, "a wheel at {further} m is not heard");
        }
    }

    #[test]
    fn drawn_differences_scatter_as_the_covariance_says() {
        let (per_sleeper, sleepers) = (4, 40);
        let mut random = ChaCha8Rng::seed_from_u64(99);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        // Neighbouring rows hang together; the mean is none.
        let mut sleeper = || {
            let common = normal();
            (0..per_sleeper).map(|row| 1.0 + 0.2 * common + 0.1 * normal() * row as f64).collect()
        };
        let differences: Vec<Vec<f64>> = (0..100)
            .map(|_| (0..sleepers).flat_map(|_| -> Vec<f64> { sleeper() }).collect())
            .collect();
        let null = NullModel { per_sleeper, differences };
        let pass_variance = DVector::from_vec(vec![0.05, 0.1, 0.2, 0.05]);
        let expected = null.covariance(2, &pass_variance);
        let drawn = null.drawn(2, &pass_variance);
        let differences = drawn.iter().map(|it| it.as_slice().to_vec());
        let drawn = NullModel { per_sleeper, differences: differences.collect() };
        let error = drawn.simulated_covariance() - &expected;
        // Four thousand draws leave some per cent to chance.
        assert!(error.amax() < 0.08 * expected.amax(), "{error} {expected}");
        assert!(drawn.offset().amax() < 0.03, "{}", drawn.offset());
    }
}
