//! Search for the values of greatest posterior probability: Gauss-Newton on the whitened log powers.

use super::ranges::Ranges;
use super::{Calibration, CalibrationError, Prior, Problem};
use crate::candidate::Candidate;
use crate::quantity::Common;
use nalgebra::DVector;

/// Largest number of Gauss-Newton steps; five suffice if the track is similar to that of the catalogue.
const STEPS_MAX: usize = 10;

/// Number of steps after which the linearisation predicts the minimum.
const FIRST_STEPS: usize = 3;

/// Largest change of a logarithm in one step; the linearisation is not valid beyond it.
const STEP_MAX: f64 = 0.7;

/// A step shorter than this is not halved again.
const STEP_MIN: f64 = 1e-3;

/// A step that is expected to reduce the objective by less than this, in nats, is the last one: it is
/// shorter than a standard deviation, and the derivatives change little.
const NEAR: f64 = 0.3;

/// After a step that is expected to reduce the objective by less than this, in nats, further steps take the
/// same derivatives, which cost several times as much as a prediction. From farther away they would lead to
/// other minima.
const CLOSE: f64 = 5.0;

/// Largest number of these further steps.
const FURTHER_STEPS_MAX: usize = 3;

/// They end when one reduces the objective by less than this, in nats.
const TOLERANCE: f64 = 0.1;

/// Distance of further starts from the prior mean of the sleeper bending stiffness, in standard deviations.
const APART: f64 = 1.3;

/// A further start is given up if its predicted objective is higher than the best by more than this, in nats.
const HOPE: f64 = 5.0;

/// State of an interrupted search.
#[derive(Clone, Debug)]
pub(crate) struct Descent {
    /// Current state.
    pub(crate) state: Calibration,
    /// Whether the search has ended.
    has_ended: bool,
}

/// Values of the search with their residual.
struct Point {
    values: DVector<f64>,
    /// Whitened residual of the fitted log powers.
    residual: DVector<f64>,
    /// Half the sum of squares of residual and prior, in nats.
    objective: f64,
}

impl Calibration {
    /// Prediction of the smallest objective, from the derivatives at the current values, in nats.
    pub(crate) fn predicted_objective(&self) -> f64 {
        self.objective - 0.5 * self.precision.solve(&self.gradient).dot(&self.gradient)
    }

    fn point(&self) -> Point {
        let Self { values, residual, objective, .. } = self;
        Point { values: values.clone(), residual: residual.clone(), objective: *objective }
    }

    /// Gradient of the log posterior at a point near these values, with the derivatives at these values.
    fn gradient_at(&self, prior: &Prior, point: &Point) -> DVector<f64> {
        let pull = &prior.precision * (&point.values - &prior.mean);
        self.jacobian.tr_mul(&point.residual) - pull
    }

    /// Moves to a near point; the derivatives stay.
    fn move_to(&mut self, prior: &Prior, point: Point) {
        self.gradient = self.gradient_at(prior, &point);
        self.log_evidence += self.objective - point.objective;
        let Point { values, residual, objective } = point;
        (self.values, self.residual, self.objective) = (values, residual, objective);
    }

    /// Gauss-Newton step from a point near these values, with the derivatives at these values. `None` if it
    /// is not finite.
    fn step(&self, prior: &Prior, ranges: &Ranges, from: &Point) -> Option<DVector<f64>> {
        let gradient = self.gradient_at(prior, from);
        let mut step = ranges.step(&from.values, &self.precision, gradient)?;
        let longest = step.amax();
        if longest > STEP_MAX {
            step *= STEP_MAX / longest;
        }
        Some(step)
    }
}

impl Problem<'_> {
    /// Finds the values of greatest posterior probability. `start` holds the unknowns of the baseline, then
    /// the candidates' parameters.
    ///
    /// The method is Gauss-Newton on the whitened log powers; a step that increases the objective is
    /// halved.
    ///
    /// # Errors
    /// [`CalibrationError`] if no track or extension exists for `start`, or a derivative is not finite.
    pub fn calibrate(&self, start: DVector<f64>) -> Result<Calibration, CalibrationError> {
        self.calibrate_among(start, &Ranges::default())
    }

    /// As [`Problem::calibrate`]. If the sleepers come out far from their nominal bending stiffness, the
    /// search is repeated from softer and from stiffer sleepers, and the best of the three minima is taken:
    /// another bending mode of the sleepers can explain the same peak of the levels.
    ///
    /// # Errors
    /// The errors of [`Problem::calibrate`].
    pub fn calibrate_widely(&self, start: DVector<f64>) -> Result<Calibration, CalibrationError> {
        let unknowns = &self.forward.unknowns;
        let stiffness = unknowns.common(Common::SleeperBendingStiffness);
        let middle = unknowns.typical()[stiffness];
        let deviation = unknowns.prior_deviations()[stiffness];
        let best = self.calibrate(start)?;
        if (best.values[stiffness] - middle).abs() <= deviation {
            return Ok(best);
        }
        let starts = self.with_other_sleepers(&best.values);
        Ok(self.best_from(best, starts))
    }

    /// These values with softer and with stiffer sleepers.
    pub(crate) fn with_other_sleepers(&self, values: &DVector<f64>) -> [DVector<f64>; 2] {
        let unknowns = &self.forward.unknowns;
        let stiffness = unknowns.common(Common::SleeperBendingStiffness);
        let middle = unknowns.typical()[stiffness];
        let reach = APART * unknowns.prior_deviations()[stiffness];
        [middle - reach, middle + reach].map(|log| {
            let mut other = values.clone();
            other[stiffness] = log;
            other
        })
    }

    /// The best of a known minimum and those that further starts lead to, beside the others.
    pub(crate) fn best_from(
        &self,
        known: Calibration,
        starts: impl IntoIterator<Item = DVector<f64>>,
    ) -> Calibration {
        let mut best = known;
        for start in starts {
            // A start for which no track exists leaves the others as they are.
            let Ok(begun) = self.begin(&start) else { continue };
            if begun.state.predicted_objective() >= best.objective + HOPE {
                continue;
            }
            let Ok(fitted) = self.go_on(begun) else { continue };
            best = if fitted.objective < best.objective {
                fitted.beside(&best)
            } else {
                best.beside(&fitted)
            };
        }
        best
    }

    /// Minus the log posterior at given values, in nats; infinite if no track exists there.
    pub(crate) fn objective(&self, values: &DVector<f64>) -> f64 {
        let point = self.point(&self.prior(), values.clone());
        point.map_or(f64::INFINITY, |point| point.objective)
    }

    /// As [`Problem::calibrate`], with the last candidate's parameters restricted to their ranges.
    ///
    /// # Errors
    /// The errors of [`Problem::calibrate`].
    pub fn calibrate_in_range(&self, start: DVector<f64>) -> Result<Calibration, CalibrationError> {
        let ranges = |candidate: &Candidate| {
            candidate.free.iter().map(|parameter| candidate.range(parameter)).collect()
        };
        let each: Vec<[f64; 2]> = self.candidates.last().map_or(Vec::new(), ranges);
        let first = start.len() - each.len();
        self.calibrate_among(start, &Ranges { first, each })
    }

    /// The first steps of [`Problem::calibrate`].
    ///
    /// # Errors
    /// The errors of [`Problem::calibrate`].
    pub(crate) fn begin(&self, start: &DVector<f64>) -> Result<Descent, CalibrationError> {
        let prior = self.prior();
        let state = self.linearise(&prior, start)?;
        self.descend(&prior, &Ranges::default(), state, FIRST_STEPS)
    }

    /// The remaining steps of [`Problem::calibrate`].
    ///
    /// # Errors
    /// The errors of [`Problem::calibrate`].
    pub(crate) fn go_on(&self, begun: Descent) -> Result<Calibration, CalibrationError> {
        if begun.has_ended {
            return Ok(begun.state);
        }
        let steps = STEPS_MAX - FIRST_STEPS;
        Ok(self.descend(&self.prior(), &Ranges::default(), begun.state, steps)?.state)
    }

    fn calibrate_among(
        &self,
        start: DVector<f64>,
        ranges: &Ranges,
    ) -> Result<Calibration, CalibrationError> {
        let prior = self.prior();
        let mut values = start;
        ranges.confine(&mut values);
        let state = self.linearise(&prior, &values)?;
        Ok(self.descend(&prior, ranges, state, STEPS_MAX)?.state)
    }

    /// Continues from a state; derivatives are computed at most `steps` times.
    fn descend(
        &self,
        prior: &Prior,
        ranges: &Ranges,
        mut state: Calibration,
        steps: usize,
    ) -> Result<Descent, CalibrationError> {
        for _ in 0..steps {
            let here = state.point();
            let step = state.step(prior, ranges, &here).ok_or(CalibrationError::NotFinite)?;
            let expected = 0.5 * step.dot(&state.gradient);
            if expected < NEAR {
                let last = self.reached(prior, &here, &step);
                if let Some(last) = last.filter(|last| last.objective < here.objective) {
                    state.move_to(prior, last);
                }
                return Ok(Descent { state, has_ended: true });
            }
            let Some(mut reached) = self.shortened(prior, &here, step) else {
                return Ok(Descent { state, has_ended: true });
            };
            let further = if expected < CLOSE { FURTHER_STEPS_MAX } else { 0 };
            for _ in 0..further {
                let Some(next) = state
                    .step(prior, ranges, &reached)
                    .and_then(|step| self.reached(prior, &reached, &step))
                    .filter(|next| next.objective < reached.objective)
                else {
                    break;
                };
                let gain = reached.objective - next.objective;
                reached = next;
                if gain < TOLERANCE {
                    break;
                }
            }
            // At the edge of what makes a track there are no derivatives.
            let Ok(next) = self.linearise(prior, &reached.values) else {
                return Ok(Descent { state, has_ended: true });
            };
            state = next;
        }
        Ok(Descent { state, has_ended: false })
    }

    /// The point that a step reaches; the step is halved until the objective decreases. `None` if it never
    /// does.
    fn shortened(&self, prior: &Prior, from: &Point, mut step: DVector<f64>) -> Option<Point> {
        loop {
            match self.reached(prior, from, &step) {
                Some(point) if point.objective < from.objective => return Some(point),
                _ if step.amax() <= STEP_MIN => return None,
                _ => step *= 0.5,
            }
        }
    }

    /// The point that a step reaches; `None` if no track exists there.
    fn reached(&self, prior: &Prior, from: &Point, step: &DVector<f64>) -> Option<Point> {
        self.point(prior, &from.values + step)
    }

    /// Values with their residual; `None` if no track exists for them (for example, an axle box heavier than
    /// the wheel).
    fn point(&self, prior: &Prior, values: DVector<f64>) -> Option<Point> {
        let residual = self.observation.residual(&self.predict(&values).ok()?);
        let residual = self.observation.fitted(&residual);
        let objective = prior.objective(&residual, &values);
        Some(Point { values, residual, objective })
    }
}
