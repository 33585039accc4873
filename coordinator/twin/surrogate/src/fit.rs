//! Choice of the input scaling by the errors on held-out entries, and of the hyper-parameters by the
//! marginal likelihood.

use crate::distance::{distances, distances_within};
use crate::group::different;
use crate::kernel::correlations;
use crate::ladder::{Ladder, Rung, Tried};
use crate::{Error, Factor, Hyperparameters, InputMap, InputScaling};
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};

/// Start of the search: a length of four typical distances and a noise ratio of 1/16.
const START: Rung = [4, -4];
/// Largest number of entries for the search of the hyper-parameters. Twice as many entries move the maximum
/// of the likelihood by less than a step of the ladder, at eight times the cost.
const CLIMBERS_MAX: usize = 2500;
/// Step of the first, coarse search, in rungs.
const COARSE: i32 = 3;

/// Mean function of a Gaussian process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MeanFunction {
    /// One constant.
    Constant,
    /// A constant and one slope per input.
    Linear,
}

/// Result of [`fit`]: all quantities needed to compute the weights.
pub struct HyperparameterFit {
    /// Map from features to inputs.
    pub input_map: InputMap,
    /// The mean function.
    pub mean: MeanFunction,
    /// Mapped inputs of the training entries, n x m.
    pub inputs: Mat<f64>,
    /// Hyper-parameters of every target, in the order of the targets; targets share a pair where the
    /// likelihood permits.
    pub hyperparameters: Vec<Hyperparameters>,
}

impl MeanFunction {
    /// The mean function for a scaling: linear in whitened inputs, which are few and independent; constant
    /// for bins, which are many and nearly collinear.
    pub fn around(scaling: InputScaling) -> Self {
        match scaling {
            InputScaling::Whitened { .. } => Self::Linear,
            InputScaling::Raw | InputScaling::Standardised => Self::Constant,
        }
    }

    /// Basis of the mean at `inputs` (n x m): n x 1 if constant, n x (1 + m) if linear.
    pub fn basis(self, inputs: MatRef<'_, f64>) -> Mat<f64> {
        let columns = match self {
            Self::Constant => 1,
            Self::Linear => 1 + inputs.ncols(),
        };
        Mat::from_fn(inputs.nrows(), columns, |i, j| if j == 0 { 1.0 } else { inputs[(i, j - 1)] })
    }
}

/// Fits Gaussian processes from `features` (n x d) to `targets` (n x p). The function selects the scaling
/// among `scalings` that predicts `subset` held-out entries best.
///
/// The entries must be in random order: the first ones are held out to compare the scalings. A scaling is
/// fitted to other entries, because a likelihood over its own training entries would favour the scaling
/// that overfits most. A scaling is left out if its mean function needs more than half of the `subset`'s
/// degrees of freedom.
///
/// # Errors
/// The errors of [`InputMap::fit`] and [`Factor::new`]; [`Error::TooFewEntries`] if no scaling is left.
pub fn fit(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scalings: &[InputScaling],
    subset: usize,
) -> Result<HyperparameterFit, Error> {
    let subset = subset.min(features.nrows() / 3);
    let (scaling, rungs) = choose(features, targets, scalings, subset)?;
    let input_map = InputMap::fit(scaling, features, targets)?;
    let inputs = input_map.apply(features);
    let climbers = features.nrows().min(CLIMBERS_MAX);
    let mean = MeanFunction::around(scaling);
    let climbing = inputs.subrows(0, climbers);
    let search = LikelihoodSearch::new(climbing, mean, targets.subrows(0, climbers));
    let mut tried = Tried::default();
    tried.climb(&rungs, 1, &mut |rung| search.log_likelihoods(rung))?;
    let hyperparameters = tried.shared().into_iter().map(|rung| search.ladder.at(rung)).collect();
    Ok(HyperparameterFit { input_map, mean, inputs, hyperparameters })
}

/// The scaling with the smallest held-out error, and the most likely rungs for this scaling.
fn choose(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scalings: &[InputScaling],
    subset: usize,
) -> Result<(InputScaling, Vec<Rung>), Error> {
    let rest = features.nrows() - subset;
    let judges = (features.subrows(0, subset), targets.subrows(0, subset));
    let makers = (features.subrows(subset, rest), targets.subrows(subset, rest));
    let mut best: Option<(f64, InputScaling, Vec<Rung>)> = None;
    let mut least = usize::MAX;
    for &scaling in scalings {
        let map = InputMap::fit(scaling, makers.0, makers.1)?;
        // Twice the test entries: enough to distinguish scalings, and an eighth of the cost of four
        // times.
        let trained = rest.min(2 * subset);
        let inputs = map.apply(makers.0.subrows(0, trained));
        let mean = MeanFunction::around(scaling);
        let climbers = inputs.subrows(0, subset);
        let search = LikelihoodSearch::new(climbers, mean, makers.1.subrows(0, subset));
        let needed = 2 * search.basis.ncols();
        if needed > subset {
            least = least.min(3 * needed);
            continue;
        }
        let mut tried = Tried::default();
        tried.climb(&[START], COARSE, &mut |rung| search.log_likelihoods(rung))?;
        let at: Vec<_> = tried.shared().into_iter().map(|rung| search.ladder.at(rung)).collect();
        let trainers = (inputs.as_ref(), makers.1.subrows(0, trained));
        let judging = map.apply(judges.0);
        let error = log_errors(mean, &at, trainers, (judging.as_ref(), judges.1))?;
        if best.as_ref().is_none_or(|(least, ..)| error < *least) {
            best = Some((error, scaling, tried.best()));
        }
    }
    let too_few = Error::TooFewEntries { found: features.nrows(), least };
    best.map(|(_, scaling, rungs)| (scaling, rungs)).ok_or(too_few)
}

/// Sum over the targets of the logarithm of their mean absolute error. Processes fitted to the `trained`
/// inputs and targets predict the `judging` targets. The logarithm weights every target by its relative
/// reduction of the error.
fn log_errors(
    mean: MeanFunction,
    at: &[Hyperparameters],
    trained: (MatRef<'_, f64>, MatRef<'_, f64>),
    judging: (MatRef<'_, f64>, MatRef<'_, f64>),
) -> Result<f64, Error> {
    let within = distances_within(trained.0);
    let away = distances(trained.0, judging.0);
    let (basis, judging_basis) = (mean.basis(trained.0), mean.basis(judging.0));
    let mut sum = 0.0;
    for one in different(at) {
        let factor = Factor::new(within.as_ref(), basis.as_ref(), one)?;
        let weights = factor.weights(trained.1);
        let predicted = &judging_basis * &weights.coefficients
            + correlations(away.as_ref(), one.length).transpose() * &weights.weights;
        for j in (0..at.len()).filter(|&j| at[j] == one) {
            let error = (predicted.col(j) - judging.1.col(j)).norm_l1();
            sum += (error / judging.1.nrows() as f64).ln();
        }
    }
    Ok(sum)
}

/// Inputs and targets of repeated evaluations of the likelihood.
struct LikelihoodSearch<'a> {
    distances: Mat<f64>,
    basis: Mat<f64>,
    targets: MatRef<'a, f64>,
    ladder: Ladder,
}

impl<'a> LikelihoodSearch<'a> {
    fn new(inputs: MatRef<'_, f64>, mean: MeanFunction, targets: MatRef<'a, f64>) -> Self {
        let distances = distances_within(inputs);
        let basis = mean.basis(inputs);
        let ladder = Ladder { unit: mean_distance(distances.as_ref()) };
        Self { distances, basis, targets, ladder }
    }

    fn log_likelihoods(&self, rung: Rung) -> Result<Vec<f64>, Error> {
        let at = self.ladder.at(rung);
        let factor = Factor::new(self.distances.as_ref(), self.basis.as_ref(), at)?;
        Ok(factor.weights(self.targets).log_likelihoods)
    }
}

/// Mean distance from the first two hundred entries to all others, as a typical distance.
fn mean_distance(distances: MatRef<'_, f64>) -> f64 {
    let n = distances.nrows();
    let sample = n.min(200);
    let sum: f64 = (0..sample).map(|j| distances.col(j).sum()).sum();
    sum / (sample * (n - 1)) as f64
}
