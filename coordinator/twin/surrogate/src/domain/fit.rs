//! Bounded fit: the parameters whose expected coordinates are nearest to the observed coordinates.

use super::coordinates::Coordinates;
use crate::Error;
use crate::cholesky::Cholesky;
use faer::Mat;

/// Largest number of steps of a search.
const STEPS_MAX: usize = 25;
/// The search ends when a step reduces chi-square by less than this.
const GAIN_MIN: f64 = 1e-3;
/// Initial damping and smallest damping.
const DAMPING: [f64; 2] = [1e-3, 1e-7];
/// The search ends when the damping exceeds this value.
const DAMPING_MAX: f64 = 1e6;

/// Bounds of the mapped parameters.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
}

/// The best point inside bounds.
#[derive(Clone, Debug)]
pub(super) struct BoundedFit {
    /// Mapped parameters.
    pub(super) unit: Vec<f64>,
    /// Weighted sum of squared residuals.
    pub(super) chi_square: f64,
}

impl Bounds {
    /// The ranges of the library: -1 to 1 for every mapped parameter.
    pub(super) fn library(parameters: usize) -> Self {
        Self { low: vec![-1.0; parameters], high: vec![1.0; parameters] }
    }

    fn clamp(&self, unit: &[f64]) -> Vec<f64> {
        let bounds = self.low.iter().zip(&self.high);
        unit.iter().zip(bounds).map(|(value, (low, high))| value.clamp(*low, *high)).collect()
    }

    /// Whether `unit` lies at a bound of `axis` and `step` points out of the bounds.
    fn holds_back(&self, unit: f64, step: f64, axis: usize) -> bool {
        (unit <= self.low[axis] && step < 0.0) || (unit >= self.high[axis] && step > 0.0)
    }
}

/// Least-squares problem in the leading directions `l`, made from the observed coordinates and their
/// precisions: chi-square is `square - 2 pull' l + l' metric l`.
pub(super) struct Problem<'a> {
    coordinates: &'a Coordinates,
    square: f64,
    pull: Vec<f64>,
    metric: Mat<f64>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(coordinates: &'a Coordinates, observed: &[f64], precision: &[f64]) -> Self {
        let from_leading = &coordinates.from_leading;
        let (leading, d) = (from_leading.nrows(), from_leading.ncols());
        let weighted = Mat::from_fn(leading, d, |l, k| from_leading[(l, k)] * precision[k]);
        let pull = (0..leading).map(|l| (0..d).map(|k| weighted[(l, k)] * observed[k]).sum());
        let pairs = observed.iter().zip(precision);
        Self {
            coordinates,
            square: pairs.map(|(observed, precision)| precision * observed * observed).sum(),
            pull: pull.collect(),
            metric: &weighted * from_leading.transpose(),
        }
    }

    /// Levenberg–Marquardt descent from `start`. A parameter at a bound is held there while its step points
    /// out of the bounds.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if a number is not finite.
    pub(super) fn solve(&self, bounds: &Bounds, start: &[f64]) -> Result<BoundedFit, Error> {
        let mut unit = bounds.clamp(start);
        let mut left = self.left(&unit);
        let mut damping = DAMPING[0];
        for _ in 0..STEPS_MAX {
            let (slope, curvature) = self.descent(&unit, &left);
            let mut gain = None;
            while damping < DAMPING_MAX && gain.is_none() {
                let step = step(&unit, &slope, &curvature, damping, bounds)?;
                let tried = bounds.clamp(&sum(&unit, &step));
                let at_tried = self.left(&tried);
                if at_tried.chi_square < left.chi_square {
                    gain = Some(left.chi_square - at_tried.chi_square);
                    (unit, left) = (tried, at_tried);
                    damping = (0.1 * damping).max(DAMPING[1]);
                } else {
                    damping *= 10.0;
                }
            }
            if gain.is_none_or(|gain| gain < GAIN_MIN) {
                break;
            }
        }
        Ok(BoundedFit { unit, chi_square: left.chi_square })
    }

    fn left(&self, unit: &[f64]) -> Left {
        let mean = self.coordinates.expected_leading(unit);
        let count = mean.len();
        let of_row = |l: usize| (0..count).map(|k| self.metric[(l, k)] * mean[k]).sum::<f64>();
        let residual: Vec<f64> = (0..count).map(|l| self.pull[l] - of_row(l)).collect();
        let both = mean.iter().zip(self.pull.iter().zip(&residual));
        let explained: f64 = both.map(|(mean, (pull, residual))| mean * (pull + residual)).sum();
        Left { residual, chi_square: self.square - explained }
    }

    /// Half the negative gradient of chi-square, and half its Gauss–Newton curvature (without second
    /// derivatives).
    fn descent(&self, unit: &[f64], left: &Left) -> (Vec<f64>, Mat<f64>) {
        let slopes = self.coordinates.slopes(unit);
        let along = |axis: usize| {
            slopes.row(axis).iter().zip(&left.residual).map(|(slope, left)| slope * left).sum()
        };
        ((0..unit.len()).map(along).collect(), &slopes * &self.metric * slopes.transpose())
    }
}

/// Residual of the observation at a point.
struct Left {
    /// Half the negative slope of chi-square by the leading directions.
    residual: Vec<f64>,
    chi_square: f64,
}

/// The damped step; parameters that a bound holds back do not move.
fn step(
    unit: &[f64],
    slope: &[f64],
    curvature: &Mat<f64>,
    damping: f64,
    bounds: &Bounds,
) -> Result<Vec<f64>, Error> {
    let p = unit.len();
    let largest = (0..p).map(|axis| curvature[(axis, axis)]).fold(0.0, f64::max);
    let mut free: Vec<usize> =
        (0..p).filter(|&axis| !bounds.holds_back(unit[axis], slope[axis], axis)).collect();
    loop {
        let mut out = vec![0.0; p];
        if free.is_empty() {
            return Ok(out);
        }
        let damped = Mat::from_fn(free.len(), free.len(), |i, j| {
            let value = curvature[(free[i], free[j])];
            if i == j { value * (1.0 + damping) + damping * 1e-3 * largest } else { value }
        });
        let right = Mat::from_fn(free.len(), 1, |i, _| slope[free[i]]);
        let solved = Cholesky::new(damped)?.solve(right.as_ref());
        free.iter().enumerate().for_each(|(i, &axis)| out[axis] = solved[(i, 0)]);
        let before = free.len();
        free.retain(|&axis| !bounds.holds_back(unit[axis], out[axis], axis));
        if free.len() == before {
            return Ok(out);
        }
    }
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}
