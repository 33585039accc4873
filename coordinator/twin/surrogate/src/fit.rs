//! Finds the input scaling by the errors on held-out entries, and the hyper-parameters by the
//! marginal likelihood.

use crate::distance::{distances, distances_within};
use crate::group::different;
use crate::kernel::correlations;
use crate::ladder::{Ladder, Rung, Tried};
use crate::{Error, Factor, Hyperparameters, InputMap, InputScaling};
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};

/// Where the search begins: a length of four typical distances, noise a sixteenth of the signal.
const START: Rung = [4, -4];
/// Entries that decide the hyper-parameters. Twice as many move the top of the likelihood by less
/// than the ladder's step, at eight times the cost.
const CLIMBERS_MAX: usize = 2500;
/// Rungs a step of the first, coarse climb takes.
const COARSE: i32 = 3;

/// The mean around which a process varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MeanFunction {
    /// One constant.
    Constant,
    /// A constant and a slope an input.
    Linear,
}

/// Everything that is found before the final weights.
pub struct HyperparameterFit {
    /// From features to inputs.
    pub input_map: InputMap,
    /// The mean.
    pub mean: MeanFunction,
    /// Mapped inputs of the training entries, n x m.
    pub inputs: Mat<f64>,
    /// Hyper-parameters of every target; equal where targets can share.
    pub hyperparameters: Vec<Hyperparameters>,
}

impl MeanFunction {
    /// The mean that goes with a scaling: linear in whitened inputs, which are few and
    /// independent; constant over bins, which are many and nearly collinear.
    pub fn around(scaling: InputScaling) -> Self {
        match scaling {
            InputScaling::Whitened { .. } => Self::Linear,
            InputScaling::Raw | InputScaling::Standardised => Self::Constant,
        }
    }

    /// Values of the basis at `inputs` (n x m): n x 1 or n x (1 + m).
    pub fn basis(self, inputs: MatRef<'_, f64>) -> Mat<f64> {
        let columns = match self {
            Self::Constant => 1,
            Self::Linear => 1 + inputs.ncols(),
        };
        Mat::from_fn(inputs.nrows(), columns, |i, j| if j == 0 { 1.0 } else { inputs[(i, j - 1)] })
    }
}

/// Fits processes from `features` (n x d) to `targets` (n x p), with the scaling among `scalings`
/// that predicts `subset` entries best.
///
/// The entries must be in random order: the first ones judge the scalings. A scaling is learned
/// from other entries than those that judge it, because a likelihood of the entries it was made of
/// would flatter the ones that learn most. Scalings whose mean would use up more than half of the
/// `subset`'s degrees of freedom are left out.
///
/// # Errors
/// Those of [`InputMap::fit`] and [`Factor::new`]; [`Error::TooFewEntries`] when no scaling is left.
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

/// The scaling with the smallest errors, and the most likely rungs under it.
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

/// Sum over the targets of the logarithm of their mean absolute error, when processes of the
/// `trained` inputs and targets predict the `judging` ones: every target counts by the share of
/// its error that is saved.
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

/// Inputs and targets whose likelihood is asked for again and again.
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

/// Mean distance from the first two hundred entries to all others: a typical one.
fn mean_distance(distances: MatRef<'_, f64>) -> f64 {
    let n = distances.nrows();
    let sample = n.min(200);
    let sum: f64 = (0..sample).map(|j| distances.col(j).sum()).sum();
    sum / (sample * (n - 1)) as f64
}
