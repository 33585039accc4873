//! Finds input scaling, mean and hyper-parameters by the marginal likelihood.
//!
//! A subset decides the scaling and where to begin, a larger one the hyper-parameters.

use crate::distance::distances_within;
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
pub struct Fit {
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
/// that `subset` entries find most likely.
///
/// The entries must be in random order: the first ones are the subset. The likelihoods of the
/// scalings are comparable because the targets are the same; the scaling is learned from the
/// entries that the subset leaves, lest it be judged by what it was made of.
///
/// # Errors
/// Those of [`InputMap::fit`] and [`Factor::new`].
///
/// # Panics
/// When there is no scaling to choose from.
pub fn fit(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scalings: &[InputScaling],
    subset: usize,
) -> Result<Fit, Error> {
    let subset = subset.min(features.nrows() / 2);
    let (scaling, rungs) = choose(features, targets, scalings, subset)?;
    let input_map = InputMap::fit(scaling, features, targets)?;
    let inputs = input_map.apply(features);
    let climbers = features.nrows().min(CLIMBERS_MAX);
    let mean = MeanFunction::around(scaling);
    let search = Search::new(inputs.subrows(0, climbers), mean, targets.subrows(0, climbers));
    let mut tried = Tried::default();
    tried.climb(&rungs, 1, &mut |rung| search.log_likelihoods(rung))?;
    let hyperparameters = tried.shared().into_iter().map(|rung| search.ladder.at(rung)).collect();
    Ok(Fit { input_map, mean, inputs, hyperparameters })
}

/// The most likely scaling, and the best rungs under it.
fn choose(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scalings: &[InputScaling],
    subset: usize,
) -> Result<(InputScaling, Vec<Rung>), Error> {
    let rest = features.nrows() - subset;
    let (judges, makers) = (features.subrows(0, subset), features.subrows(subset, rest));
    let maps = candidates(makers, targets.subrows(subset, rest), scalings)?;
    let mut best: Option<(f64, InputScaling, Vec<Rung>)> = None;
    for map in maps {
        let search = Search::new(
            map.apply(judges).as_ref(),
            MeanFunction::around(map.scaling),
            targets.subrows(0, subset),
        );
        let mut tried = Tried::default();
        tried.climb(&[START], COARSE, &mut |rung| search.log_likelihoods(rung))?;
        if best.as_ref().is_none_or(|(score, ..)| tried.score() > *score) {
            best = Some((tried.score(), map.scaling, tried.best()));
        }
    }
    let (_, scaling, rungs) = best.expect("there is a scaling to choose from");
    Ok((scaling, rungs))
}

/// A map for every scaling; the whitened ones are cut from one, which is what costs.
fn candidates(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scalings: &[InputScaling],
) -> Result<Vec<InputMap>, Error> {
    let most = scalings.iter().filter_map(|scaling| match scaling {
        InputScaling::Whitened { components } => Some(*components),
        _ => None,
    });
    let whitened = most
        .max()
        .map(|components| InputMap::fit(InputScaling::Whitened { components }, features, targets))
        .transpose()?;
    scalings
        .iter()
        .map(|&scaling| match (scaling, &whitened) {
            (InputScaling::Whitened { components }, Some(map)) => Ok(map.leading(components)),
            _ => InputMap::fit(scaling, features, targets),
        })
        .collect()
}

/// Inputs and targets whose likelihood is asked for again and again.
struct Search<'a> {
    distances: Mat<f64>,
    basis: Mat<f64>,
    targets: MatRef<'a, f64>,
    ladder: Ladder,
}

impl<'a> Search<'a> {
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
