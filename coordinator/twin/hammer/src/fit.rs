//! Fit of a track to the receptances of a hammer test.

use crate::forward::{Forward, PointResidual};
use crate::layout::{Layout, LayoutError};
use crate::measured::PointReceptance;
use crate::unknowns::{Quantity, Unknowns};
use nalgebra::{Cholesky, DMatrix, DVector};
use tracktwin_parameters::Track;
use tracktwin_track::model::ModelError;

/// Number of neighbouring values with the same model error: the model error is correlated over a third of
/// an octave.
const ALIKE: f64 = 8.0;

/// Expected standard deviation of the model error at a frequency in nats: 0.4 dB, the difference between
/// two simulators of one track. It is the smallest estimate of the model error, and the misfits are judged
/// by it.
const MODEL_ERROR: f64 = 0.05;

/// Two receptances within this distance in m count as one position.
const SAME_PLACE_M: f64 = 1e-3;

/// Number of rounds that estimate the model error and the unevenness.
const ROUNDS: usize = 4;

/// Largest number of steps of a fit, its initial and largest damping, and the decrease of the objective in
/// nats that ends it.
const STEPS_MAX: usize = 30;
const DAMPING: f64 = 1e-2;
const DAMPING_MAX: f64 = 1e8;
const CONVERGED: f64 = 1e-3;

/// Starts of the means of railpad and ballast stiffness, in standard deviations of the prior.
const STARTS: [f64; 3] = [-1.0, 0.0, 1.0];
/// Limits of the fit of an even track, which only selects a start: number of steps, approximate number of
/// receptances, and step in the list of frequencies.
const START_STEPS: usize = 8;
const START_POINTS: usize = 8;
const START_LINES: usize = 4;

/// Errors of the fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The hit positions do not form a layout.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Force and response have opposite directions.
    #[error(
        "the receptance at {position_m} m gains energy (its imaginary part is positive): force and \
         response have opposite directions; change the sign of one"
    )]
    Turned {
        /// Position along the track in m.
        position_m: f64,
    },
    /// Two receptances have the same position.
    #[error(
        "two receptances have one place, {first_m} m and {second_m} m: each would count as \
         independent; average the hits at a place in one table"
    )]
    Repeated {
        /// Position of the first in m.
        first_m: f64,
        /// Position of the second in m.
        second_m: f64,
    },
    /// The track model cannot be built or solved.
    #[error("the track model cannot be built: {0}")]
    Model(#[from] ModelError),
    /// The normal equations have no solution.
    #[error("the fit does not converge: a receptance or a derivative is not finite")]
    NotFinite,
}

/// Track that was fitted to a hammer test.
#[derive(Clone, Debug)]
pub struct Fitted {
    pub(crate) layout: Layout,
    pub(crate) unknowns: Unknowns,
    pub(crate) values: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Standard deviation of the model error in nats, estimated from the test.
    pub(crate) model_error: f64,
    /// Position in m and misfit (normalised mean square of the residuals) of each point.
    point_misfits: Vec<(f64, f64)>,
}

/// Fits the track; every sleeper near a hit position has its own values.
///
/// `sleeper_at_m` is the position of one sleeper in m, in the coordinates of the receptances.
///
/// # Errors
/// [`FitError`] if the receptances do not belong to one stretch of track, gain energy or share a position,
/// or if the fit fails.
pub fn fit(
    track: &Track,
    sleeper_at_m: f64,
    points: &[PointReceptance],
) -> Result<Fitted, FitError> {
    check(points)?;
    let struck_m = points.iter().map(|point| point.position_m);
    let layout = Layout::new(&track.design, sleeper_at_m, struck_m)?;
    let forward = Forward::new(&track.design, layout, points);
    let mut unknowns = Unknowns::new(&track.prior, forward.layout().own());
    let mut model_error = MODEL_ERROR;
    let mut values = best_start(&forward, &unknowns)?;
    let mut covariance = DMatrix::zeros(0, 0);
    for round in 0..=ROUNDS {
        let solved = Solve { forward: &forward, unknowns: &unknowns, model_error }.minimise(
            values,
            STEPS_MAX,
            |_| true,
        )?;
        values = solved.values;
        covariance = solved.covariance;
        if round < ROUNDS {
            model_error = error_of_model(&forward, &unknowns, &values)?;
            unknowns.learn(&values, &covariance.diagonal());
        }
    }
    let point_misfits = misfits(&forward, &unknowns, &values)?;
    Ok(Fitted {
        layout: forward.layout().clone(),
        unknowns,
        values,
        covariance,
        model_error,
        point_misfits,
    })
}

/// Checks that force and response have the same direction and that every receptance has its own position.
fn check(points: &[PointReceptance]) -> Result<(), FitError> {
    if let Some(turned) = points.iter().find(|point| point.is_turned()) {
        return Err(FitError::Turned { position_m: turned.position_m });
    }
    let mut places_m: Vec<f64> = points.iter().map(|point| point.position_m).collect();
    places_m.sort_by(f64::total_cmp);
    match places_m.windows(2).find(|pair| pair[1] - pair[0] < SAME_PLACE_M) {
        Some(pair) => Err(FitError::Repeated { first_m: pair[0], second_m: pair[1] }),
        None => Ok(()),
    }
}

/// Fits an even track from several starts and returns the best values. Several starts are necessary because
/// receptances have resonances and the objective has several minima.
fn best_start(forward: &Forward<'_>, unknowns: &Unknowns) -> Result<DVector<f64>, FitError> {
    let every = forward.points.len().div_ceil(START_POINTS).max(1);
    let thinned = |point: &PointReceptance| {
        point.kept(&(0..point.values.len()).step_by(START_LINES).collect::<Vec<_>>())
    };
    let points: Vec<PointReceptance> = forward.points.iter().step_by(every).map(thinned).collect();
    let forward = &Forward::new(forward.design(), forward.layout().clone(), &points);
    // An even track explains an uneven one only so far.
    let solve = Solve { forward, unknowns, model_error: 4.0 * MODEL_ERROR };
    let mut best: Option<Solved> = None;
    for railpad in STARTS {
        for ballast in STARTS {
            let mut start = unknowns.start();
            let moved =
                [(Quantity::RailpadStiffness, railpad), (Quantity::BallastStiffness, ballast)];
            for (of, way) in moved {
                start[Unknowns::mean(of)] += way * unknowns.prior_deviation(of);
            }
            let solved = solve.minimise(start, START_STEPS, |it| it < Unknowns::SHARED)?;
            if best.as_ref().is_none_or(|best| solved.objective < best.objective) {
                best = Some(solved);
            }
        }
    }
    Ok(best.expect("there are starts").values)
}

/// Reciprocal variances of the residuals of a point, in the order of its rows.
fn weights(point: &PointReceptance, model_error: f64) -> DVector<f64> {
    let lines = point.values.len();
    let of = |row: usize, _| {
        let measured = point.deviation(row % lines);
        (measured * measured + ALIKE * model_error * model_error).recip()
    };
    DVector::from_fn(2 * lines, of)
}

/// Standard deviation of the model error in nats for which the whitened residuals have a mean square of
/// one; at least the prior value.
fn error_of_model(
    forward: &Forward<'_>,
    unknowns: &Unknowns,
    values: &DVector<f64>,
) -> Result<f64, FitError> {
    let (mut sum, mut count) = (0.0, 0.0);
    for (residual, point) in forward.residuals(unknowns, values)?.iter().zip(forward.points) {
        let lines = point.values.len();
        for (row, value) in residual.iter().enumerate() {
            sum += value * value - point.deviation(row % lines).powi(2);
            count += 1.0;
        }
    }
    Ok((sum / f64::max(count, 1.0)).max(MODEL_ERROR * MODEL_ERROR).sqrt())
}

/// Position of each point in m, and the mean square of its residuals divided by its expectation, the sum of
/// the variances of the measurement and of the expected model error.
fn misfits(
    forward: &Forward<'_>,
    unknowns: &Unknowns,
    values: &DVector<f64>,
) -> Result<Vec<(f64, f64)>, FitError> {
    let residuals = forward.residuals(unknowns, values)?;
    let of = |(residual, point): (&DVector<f64>, &PointReceptance)| {
        let lines = point.values.len();
        let expected =
            |row: usize| point.deviation(row % lines).powi(2) + MODEL_ERROR * MODEL_ERROR;
        let squares = residual.iter().enumerate().map(|(row, value)| value * value / expected(row));
        (point.position_m, squares.sum::<f64>() / residual.len().max(1) as f64)
    };
    Ok(residuals.iter().zip(forward.points).map(of).collect())
}

/// One least-squares problem.
struct Solve<'a> {
    forward: &'a Forward<'a>,
    unknowns: &'a Unknowns,
    model_error: f64,
}

/// Minimum of a problem.
struct Solved {
    values: DVector<f64>,
    objective: f64,
    /// Posterior covariance (Laplace: Gaussian about the minimum).
    covariance: DMatrix<f64>,
}

impl Solve<'_> {
    /// Half the sum of squares of the whitened residuals and of the deviations from the prior.
    fn objective(&self, values: &DVector<f64>) -> Result<f64, FitError> {
        let residuals = self.forward.residuals(self.unknowns, values)?;
        let data: f64 = residuals
            .iter()
            .zip(self.forward.points)
            .map(|(residual, point)| {
                let weights = weights(point, self.model_error);
                residual.iter().zip(weights.iter()).map(|(r, w)| r * r * w).sum::<f64>()
            })
            .sum();
        let from_prior = values - self.unknowns.start();
        let prior: f64 = from_prior
            .iter()
            .zip(self.unknowns.precision().iter())
            .map(|(x, precision)| x * x * precision)
            .sum();
        Ok(0.5 * (data + prior))
    }

    /// Minimises over the unknowns for which `free` is true, by the Levenberg–Marquardt method.
    fn minimise(
        &self,
        mut values: DVector<f64>,
        steps: usize,
        free: impl Fn(usize) -> bool,
    ) -> Result<Solved, FitError> {
        let mut objective = self.objective(&values)?;
        let mut damping = DAMPING;
        let (mut matrix, mut slope) = self.normal(&values, &free)?;
        for _ in 0..steps {
            let mut fall = None;
            while fall.is_none() && damping < DAMPING_MAX {
                let mut damped = matrix.clone();
                for row in 0..damped.nrows() {
                    damped[(row, row)] *= 1.0 + damping;
                }
                let step = Cholesky::new(damped).ok_or(FitError::NotFinite)?.solve(&slope);
                let tried = &values + step;
                // A track that cannot be built is no better one.
                let found = self.objective(&tried).unwrap_or(f64::INFINITY);
                if found < objective {
                    fall = Some(objective - found);
                    (values, objective) = (tried, found);
                    damping *= 0.2;
                } else {
                    damping *= 5.0;
                }
            }
            let Some(fall) = fall else { break };
            (matrix, slope) = self.normal(&values, &free)?;
            if fall < CONVERGED {
                break;
            }
        }
        let factor = Cholesky::new(matrix).ok_or(FitError::NotFinite)?;
        if !objective.is_finite() {
            return Err(FitError::NotFinite);
        }
        Ok(Solved { values, objective, covariance: factor.inverse() })
    }

    /// Matrix and right-hand side of the normal equations; unknowns that are not free do not change.
    fn normal(
        &self,
        values: &DVector<f64>,
        free: impl Fn(usize) -> bool,
    ) -> Result<(DMatrix<f64>, DVector<f64>), FitError> {
        let precision = self.unknowns.precision();
        let mut slope = (self.unknowns.start() - values).component_mul(&precision);
        let mut matrix = DMatrix::from_diagonal(&precision);
        let linearised = self.forward.linearised(self.unknowns, values)?;
        for (point, measured) in linearised.iter().zip(self.forward.points) {
            let PointResidual { residual, jacobian, unknowns } = point;
            let roots = weights(measured, self.model_error).map(f64::sqrt);
            let mut whitened = jacobian.clone();
            for mut column in whitened.column_iter_mut() {
                column.component_mul_assign(&roots);
            }
            let information = whitened.tr_mul(&whitened);
            let pull = whitened.tr_mul(&residual.component_mul(&roots));
            for (a, &row) in unknowns.iter().enumerate() {
                slope[row] += pull[a];
                for (b, &column) in unknowns.iter().enumerate() {
                    matrix[(row, column)] += information[(a, b)];
                }
            }
        }
        for held in (0..slope.len()).filter(|it| !free(*it)) {
            slope[held] = 0.0;
            matrix.row_mut(held).fill(0.0);
            matrix.column_mut(held).fill(0.0);
            matrix[(held, held)] = 1.0;
        }
        Ok((matrix, slope))
    }
}

impl Fitted {
    /// Logarithm of the gain of the measurement, and its standard deviation.
    pub(crate) fn gain(&self) -> (f64, f64) {
        let variance = self.covariance[(Unknowns::GAIN, Unknowns::GAIN)];
        (self.values[Unknowns::GAIN], variance.max(0.0).sqrt())
    }

    /// Logarithm of a quantity at the reported sleeper `index`, and its standard deviation.
    pub(crate) fn logarithm(&self, of: Quantity, index: usize) -> (f64, f64) {
        let (mean, own) = (Unknowns::mean(of), self.unknowns.at(of, Layout::own_index(index)));
        let covariance = &self.covariance;
        let variance =
            covariance[(mean, mean)] + covariance[(own, own)] + 2.0 * covariance[(mean, own)];
        (self.values[mean] + self.values[own], variance.max(0.0).sqrt())
    }

    /// Standard deviation of the deviation from the mean at the reported sleeper `index`, divided by its
    /// prior standard deviation.
    pub(crate) fn own_share(&self, of: Quantity, index: usize) -> f64 {
        let own = self.unknowns.at(of, Layout::own_index(index));
        self.covariance[(own, own)].max(0.0).sqrt() / self.unknowns.unevenness[of as usize]
    }

    /// Mean misfit of the points that belong to the reported sleeper `index`; `None` if there is no such
    /// point.
    pub(crate) fn misfit(&self, index: usize) -> Option<f64> {
        let of = self.point_misfits.iter();
        let near = of.filter(|(x_m, _)| self.layout.near(*x_m).any(|it| it == index));
        let (sum, count) = near.fold((0.0, 0), |(sum, count), (_, it)| (sum + it, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use tracktwin_parameters::Preset;

    fn refused(points: &[PointReceptance]) -> String {
        fit(&Preset::VTrack.track(), 0.0, points).unwrap_err().to_string()
    }

    fn point(position_m: f64, im: f64) -> PointReceptance {
        PointReceptance {
            position_m,
            frequencies_hz: vec![100.0, 200.0],
            values: vec![Complex64::new(1e-8, im); 2],
            coherence: None,
            hits: None,
        }
    }

    #[test]
    fn a_response_against_the_force_is_refused() {
        let message = refused(&[point(1.0, -1e-9), point(2.0, 1e-9)]);
        assert!(message.starts_with("the receptance at 2 m gains energy"), "{message}");
    }

    #[test]
    fn two_receptances_of_one_place_are_refused() {
        let message = refused(&[point(1.5, -1e-9), point(3.0, -1e-9), point(1.5005, -1e-9)]);
        assert!(message.contains("1.5 m and 1.5005 m"), "{message}");
    }
}
