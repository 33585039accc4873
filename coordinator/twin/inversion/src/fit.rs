//! The fit of one section of track.

use crate::soft::add_soft_sleepers;
use nalgebra::{DMatrix, DVector};
use tracktwin_diagnosis::{
    Amplitude, BALLAST_ERROR, Calibration, CalibrationError, Candidate, Forward, Mean, NullModel,
    Observation, Own, PreparationError, PreparedRecording, Problem, Quadratic, Unknowns, Variation,
    expect_variation, learn_railpad_damping, learn_variation,
};
use tracktwin_parameters::Track;
use tracktwin_signal::recording::Recording;

/// Number of rounds; each round estimates the variation and fits the track again.
const ROUNDS: usize = 2;

/// Expected misfit of a sleeper if the model is valid. It is below one, because the fit absorbs a part and the
/// covariance includes an error of the prediction.
const EXPECTED: f64 = 0.7;

/// Error of the predicted levels that all sleepers share, in nats: 0.4 dB, by which two simulators of
/// one track differ (docs/accuracy.md).
const RESPONSE: f64 = 0.09;

/// Error of a sleeper's ballast and railpad stiffness in addition to its posterior, as a share of the variation
/// along the track. It covers the difference between model and reality; measured with `tracktwin coverage --method
/// inversion` on recordings of two simulators.
const MISPLACED: [f64; 2] = [BALLAST_ERROR, 0.6];

/// Error of the logarithm of the quantities common to a section's sleepers, in addition to the posterior:
/// real sleepers taper and differ, and their shear stiffness is assumed.
const COMMON_ERROR: f64 = 0.08;

/// Grid along the valley of the posterior: step of the logarithm of the mean railpad stiffness, largest
/// number of steps on either side, and distance of the log weight from the greatest one on that side, in nats, at
/// which a side ends. So a side has at least two steps, and a second minimum behind the first step is found.
const STEP: f64 = 0.2;
const STEPS_MAX: u32 = 12;
const NEGLIGIBLE: f64 = 3.0;

/// Standard deviation of the logarithm of a mean that is held fixed.
const HELD: f64 = 0.02;

/// Number of sleepers of a section, and number of sleepers that two neighbouring sections share.
const LENGTH: usize = 26;
const OVERLAP: usize = 8;

/// Fitted unknowns of one section of a recording.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Index of each value, and the estimated variation along the track.
    pub unknowns: Unknowns,
    /// Natural logarithms of the values of greatest posterior probability, in SI units. An irregularity
    /// level refers to a surface with the spectrum of eq. B.6 (Shen et al. 2023) and the same mean power
    /// over the wave numbers.
    pub values: DVector<f64>,
    /// Standard deviations of these logarithms.
    pub deviations: DVector<f64>,
    /// Amplitude of each support change of `unknowns`, in their order.
    pub changes: Vec<Amplitude>,
    /// Misfit of every sleeper: sum of squares of its whitened residual, divided by the number of its log
    /// powers; about 0.7 if the model is valid.
    pub misfit: Vec<f64>,
}

/// Splits a recording into sections that are fitted one by one.
///
/// # Errors
/// [`PreparationError`] if the recording lacks required data.
pub fn sections(
    recording: &Recording,
    track: &Track,
) -> Result<Vec<PreparedRecording>, PreparationError> {
    PreparedRecording::sections(recording, track, LENGTH, OVERLAP)
}

/// Fits a section whose model contains `known` physics ([`crate::accepted`]); its free parameters are fitted
/// too.
/// `start` must be the result of [`tracktwin_diagnosis::first_calibration`], and the forward model of
/// `prepared` must include the track beyond the section ([`Forward::allow_beyond`]).
///
/// # Errors
/// [`CalibrationError`] if the fit fails or a number is not finite.
pub fn fit(
    prepared: &PreparedRecording,
    null: &NullModel,
    known: &[Candidate],
    start: DVector<f64>,
) -> Result<Fitted, CalibrationError> {
    let plain =
        Observation::new(prepared.expected_log_power(null), &prepared.covariance(null), |_| false)
            .ok_or(CalibrationError::NotFinite)?;
    let mut forward = prepared.forward.clone();
    forward.unknowns = unknowns_of(&forward);
    let mut factors = vec![1.0; forward.section.sleepers()];
    let fit = |forward: &_, factors: &[f64], start| {
        let observation = &plain.clone().with_factors(factors);
        Problem { forward, observation, candidates: known }.calibrate(start)
    };
    let problem = Problem { forward: &forward, observation: &plain, candidates: known };
    let mut calibration = problem.calibrate_widely(start)?;
    let inexact = problem.inexactness(&calibration.values)?;
    let mut probabilities = Vec::new();
    for _ in 0..ROUNDS {
        let found = misfit(&calibration, &factors, plain.compared());
        let found = found.into_iter().map(factor);
        factors = found.zip(&inexact).map(|(factor, inexact)| factor.max(*inexact)).collect();
        calibration = fit(&forward, &factors, calibration.values)?;
        let data = Quadratic::new(&calibration, forward.unknowns.typical(), known)
            .ok_or(CalibrationError::NotFinite)?;
        learn_railpad_damping(&mut forward.unknowns, &data);
        probabilities = learn_variation(&mut forward.unknowns, &data);
        expect_variation(&mut forward.unknowns, &data);
        let best = data.best(&forward.unknowns).ok_or(CalibrationError::NotFinite)?;
        let mut start = calibration.values;
        start.rows_mut(0, best.len()).copy_from(&best);
        calibration = fit(&forward, &factors, start)?;
    }
    let observation = plain.clone().with_factors(&factors);
    add_soft_sleepers(&observation, known, &mut forward, &mut calibration)?;
    let valley =
        along_valley(|forward, start| fit(forward, &factors, start), &forward, &calibration)?;
    let posterior = Posterior::mixture(&valley);
    let misfit = misfit(&calibration, &factors, plain.compared());
    Ok(Fitted::of(forward.unknowns, posterior, &probabilities, misfit))
}

/// The unknowns of a fit, before the variation along the track is estimated.
pub(crate) fn unknowns_of(forward: &Forward) -> Unknowns {
    let mut unknowns = forward.unknowns.clone();
    unknowns.response_deviation = RESPONSE;
    unknowns
}

/// A fit with fixed mean railpad stiffness, and the logarithm of its weight in nats.
struct Held {
    log_weight: f64,
    calibration: Calibration,
}

/// Fits with the mean railpad stiffness fixed at values on either side of the best fit, until the weight falls.
///
/// Stiffer railpads with more damping on softer sleepers give nearly the same levels. The posterior is
/// therefore a long valley, often with several minima, and a normal distribution about one of them is too
/// narrow. The function integrates the posterior over the mean railpad stiffness on a grid. All other
/// unknowns are normally distributed given this mean (nested Laplace approximation).
fn along_valley(
    fit: impl Fn(&Forward, DVector<f64>) -> Result<Calibration, CalibrationError> + Sync,
    forward: &Forward,
    best: &Calibration,
) -> Result<Vec<Held>, CalibrationError> {
    let railpad = forward.unknowns.railpad();
    let prior = forward.unknowns.mean[Own::RailpadStiffness as usize];
    let middle = best.values.rows(railpad.start, railpad.len()).mean();
    let at = |log: f64, mut start: DVector<f64>| -> Result<Held, CalibrationError> {
        let mut held = forward.clone();
        held.unknowns.mean[Own::RailpadStiffness as usize] = Mean { log, deviation: HELD };
        let shift = log - start.rows(railpad.start, railpad.len()).mean();
        railpad.clone().for_each(|index| start[index] += shift);
        let calibration = fit(&held, start)?;
        let from_prior = (log - prior.log) / prior.deviation;
        let log_weight = calibration.log_evidence - 0.5 * from_prior.powi(2);
        Ok(Held { log_weight, calibration })
    };
    let side = |step: f64| {
        let mut walked: Vec<Held> = Vec::new();
        let mut highest = f64::NEG_INFINITY;
        for number in 1..=STEPS_MAX {
            let start = walked.last().map_or(&best.values, |held| &held.calibration.values);
            // At the edge of what makes a track the valley ends.
            let Ok(held) = at(middle + f64::from(number) * step, start.clone()) else { break };
            highest = highest.max(held.log_weight);
            let is_negligible = held.log_weight < highest - NEGLIGIBLE;
            walked.push(held);
            if is_negligible {
                break;
            }
        }
        walked
    };
    let centre = at(middle, best.values.clone())?;
    let (softer, stiffer) = rayon::join(|| side(-STEP), || side(STEP));
    Ok(softer.into_iter().chain([centre]).chain(stiffer).collect())
}

/// Mean and covariance of the unknowns.
struct Posterior {
    values: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Posterior {
    fn mixture(all: &[Held]) -> Self {
        let highest = all.iter().map(|held| held.log_weight).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = all.iter().map(|held| (held.log_weight - highest).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let shares = || weights.iter().map(|weight| weight / sum).zip(all);
        let count = all[0].calibration.values.len();
        let values = shares().fold(DVector::zeros(count), |mean, (share, held)| {
            mean + share * &held.calibration.values
        });
        let covariance =
            shares().fold(DMatrix::zeros(count, count), |covariance, (share, held)| {
                let apart = &held.calibration.values - &values;
                covariance
                    + share * (held.calibration.precision.inverse() + &apart * apart.transpose())
            });
        Self { values, covariance }
    }
}

/// Misfit of every sleeper: sum of squares of its residual, divided by the number of its compared log
/// powers. The covariance is the one before multiplication by `factors`.
fn misfit(calibration: &Calibration, factors: &[f64], compared: usize) -> Vec<f64> {
    let each = calibration.residual.len() / factors.len();
    let of = |(sleeper, factor): (usize, &f64)| {
        factor * calibration.residual.rows(sleeper * each, each).norm_squared() / compared as f64
    };
    factors.iter().enumerate().map(of).collect()
}

/// Factor on the covariance of a sleeper with a large misfit: the weight of a multivariate Student
/// distribution whose scale is estimated for every sleeper.
fn factor(misfit: f64) -> f64 {
    (misfit / EXPECTED).max(1.0)
}

impl Fitted {
    fn of(
        unknowns: Unknowns,
        posterior: Posterior,
        probabilities: &[f64],
        misfit: Vec<f64>,
    ) -> Self {
        let Posterior { mut values, covariance } = posterior;
        let mut deviations = covariance.diagonal();
        // The spectrum's mean and the level are one quantity: the surface's power.
        let spectrum = unknowns.spectrum();
        let share = 1.0 / spectrum.len() as f64;
        let mean = share * values.rows(spectrum.start, spectrum.len()).sum();
        let knots = covariance.rows(spectrum.start, spectrum.len());
        let own = share.powi(2) * knots.columns(spectrum.start, spectrum.len()).sum();
        for index in unknowns.level() {
            values[index] += mean;
            deviations[index] += own + 2.0 * share * knots.column(index).sum();
        }
        let fields = [unknowns.ballast(), unknowns.railpad()];
        let misplaced = fields.into_iter().zip(MISPLACED).zip(unknowns.variation).map(
            |((range, share), Variation { smooth, independent, .. })| {
                (range, (share * smooth.hypot(independent)).powi(2))
            },
        );
        let misplaced: Vec<_> = misplaced.collect();
        let changes = Amplitude::all(&unknowns, probabilities, &values, &covariance);
        for (range, variance) in misplaced {
            range.for_each(|index| deviations[index] += variance);
        }
        unknowns.global().for_each(|index| deviations[index] += COMMON_ERROR.powi(2));
        // What follows the unknowns are parameters of known physics.
        let count = unknowns.count();
        let deviations = deviations.rows(0, count).map(f64::sqrt);
        let values = values.rows(0, count).into_owned();
        Self { unknowns, values, deviations, changes, misfit }
    }
}
