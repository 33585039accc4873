//! Models that share their inputs: one speed (or all) and one feature set, a model a parameter.

use crate::distance::distances_within;
use crate::kernel::correlations;
use crate::{Error, Factor, Hyperparameters, InputMap, MeanFunction, Spread, distances};
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::OnceLock;
use tracktwin_parameters::Parameter;

/// True and predicted values of a parameter, in its unit.
pub type Tested = (Parameter, Vec<(f64, f64)>);

/// Which features a group of models reads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupKey {
    /// Speeds in km/h whose features are concatenated, in this order.
    pub speeds_km_h: Vec<f64>,
    /// Name of the feature set.
    pub feature: String,
    /// Its bins at every speed.
    pub columns: Range<usize>,
}

/// How good one model is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelScore {
    /// MASE (paper, eq. 11) over the folds of the training set; 0.05 is 5 %.
    pub mase_folds: f64,
    /// MASE over the test set.
    pub mase_test: f64,
    /// Mean of prediction minus truth over the test set, as a share of the range.
    pub bias_test: f64,
    /// Share of the test set inside its 90 % interval.
    pub coverage_90_test: f64,
}

/// A Gaussian process for one parameter.
///
/// Internally the parameter is mapped onto [0, 1] by its range in the library.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterModel {
    /// What it predicts.
    pub parameter: Parameter,
    /// Lowest and highest value in the library, in the parameter's unit.
    pub range: [f64; 2],
    /// Length and noise ratio.
    pub hyperparameters: Hyperparameters,
    /// Signal variance `s²`, of the parameter mapped onto [0, 1].
    pub signal_variance: f64,
    /// Log marginal likelihood in nats.
    pub log_likelihood: f64,
    /// Correction of the standard deviation, over the parameter mapped onto [0, 1].
    pub spread: Spread,
    /// How good it is.
    pub score: ModelScore,
}

/// A predicted value, in the parameter's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The parameter.
    pub parameter: Parameter,
    /// Its expected value, kept within the library's range.
    pub mean: f64,
    /// Standard deviation of a new case's value around it.
    pub sd: f64,
}

/// Models of all parameters over the same inputs.
pub struct ModelGroup {
    pub(crate) key: GroupKey,
    pub(crate) bins: usize,
    pub(crate) input_map: InputMap,
    pub(crate) mean: MeanFunction,
    /// n x m.
    pub(crate) inputs: Mat<f64>,
    /// n x p.
    pub(crate) weights: Mat<f64>,
    /// q x p.
    pub(crate) coefficients: Mat<f64>,
    pub(crate) models: Vec<ParameterModel>,
    /// A factor for every different pair of hyper-parameters, made when first asked for.
    pub(crate) factors: Vec<(Hyperparameters, OnceLock<Factor>)>,
}

impl ModelGroup {
    /// Which features the group reads.
    pub fn key(&self) -> &GroupKey {
        &self.key
    }

    /// The models, in the order of the training set's varied parameters.
    pub fn models(&self) -> &[ParameterModel] {
        &self.models
    }

    /// How features become inputs.
    pub fn input_map(&self) -> &InputMap {
        &self.input_map
    }

    /// How many entries it was trained on.
    pub fn entries(&self) -> usize {
        self.inputs.nrows()
    }

    /// Predicts every parameter for every one of the `observations`: ln-powers of all bins, the
    /// group's speeds side by side (speeds x bins numbers each).
    ///
    /// Batches cost far less than single observations. The first call factorises covariances
    /// (half a second each for 5000 entries).
    ///
    /// # Errors
    /// [`Error::Shape`] when an observation has another number of bins.
    pub fn predict(&self, observations: &[Vec<f64>]) -> Result<Vec<Vec<Prediction>>, Error> {
        let (means, sds) = self.predict_features(self.features(observations)?.as_ref())?;
        Ok((0..observations.len()).map(|t| self.in_units(&means, &sds, t)).collect())
    }

    /// What the processes read of every one of the `observations` (as for [`Self::predict`]): the
    /// features after the input map, m numbers each.
    ///
    /// # Errors
    /// [`Error::Shape`] when an observation has another number of bins.
    pub fn inputs_of(&self, observations: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, Error> {
        let inputs = self.input_map.apply(self.features(observations)?.as_ref());
        Ok(inputs.row_iter().map(|row| row.iter().copied().collect()).collect())
    }

    /// The group's columns of the `observations`, t x d.
    fn features(&self, observations: &[Vec<f64>]) -> Result<Mat<f64>, Error> {
        let width = self.key.speeds_km_h.len() * self.bins;
        if let Some(odd) = observations.iter().find(|observed| observed.len() != width) {
            return Err(Error::Shape { what: "observed bins", expected: width, found: odd.len() });
        }
        let d = self.key.columns.len();
        Ok(Mat::from_fn(observations.len(), self.key.speeds_km_h.len() * d, |t, j| {
            observations[t][j / d * self.bins + self.key.columns.start + j % d]
        }))
    }

    /// Means and standard deviations (both t x p) on the [0, 1] scale for `features` (t x d).
    pub(crate) fn predict_features(
        &self,
        features: MatRef<'_, f64>,
    ) -> Result<(Mat<f64>, Mat<f64>), Error> {
        let inputs = self.input_map.apply(features);
        let away = distances(self.inputs.as_ref(), inputs.as_ref());
        let basis = self.mean.basis(inputs.as_ref());
        let mut means = &basis * &self.coefficients;
        let mut sds = Mat::zeros(inputs.nrows(), self.models.len());
        for factor in self.factors()? {
            let at = factor.hyperparameters();
            let variances = factor.variances(away.as_ref(), basis.as_ref());
            let known = correlations(away.as_ref(), at.length);
            for (j, model) in self.of(at) {
                let change = known.transpose() * self.weights.col(j);
                for (t, variance) in variances.iter().enumerate() {
                    let mean = (means[(t, j)] + change[t]).clamp(0.0, 1.0);
                    means[(t, j)] = mean;
                    let sd = (model.signal_variance * variance).sqrt();
                    sds[(t, j)] = sd * model.spread.factor(mean);
                }
            }
        }
        Ok((means, sds))
    }

    fn of(&self, at: Hyperparameters) -> impl Iterator<Item = (usize, &ParameterModel)> {
        self.models.iter().enumerate().filter(move |(_, model)| model.hyperparameters == at)
    }

    /// Makes the factors that are not there yet.
    fn factors(&self) -> Result<Vec<&Factor>, Error> {
        if self.factors.iter().any(|(_, slot)| slot.get().is_none()) {
            let away = distances_within(self.inputs.as_ref());
            let basis = self.mean.basis(self.inputs.as_ref());
            for (at, slot) in self.factors.iter().filter(|(_, slot)| slot.get().is_none()) {
                let factor = Factor::new(away.as_ref(), basis.as_ref(), *at)?;
                // Another thread may have been faster; its factor is the same.
                let _ = slot.set(factor);
            }
        }
        Ok(self.factors.iter().filter_map(|(_, slot)| slot.get()).collect())
    }

    fn in_units(&self, means: &Mat<f64>, sds: &Mat<f64>, t: usize) -> Vec<Prediction> {
        let models = self.models.iter().enumerate();
        models
            .map(|(j, model)| {
                let [low, high] = model.range;
                Prediction {
                    parameter: model.parameter,
                    mean: low + means[(t, j)] * (high - low),
                    sd: sds[(t, j)] * (high - low),
                }
            })
            .collect()
    }
}

/// The different ones among the models' hyper-parameters, in order of appearance.
pub(crate) fn different(all: &[Hyperparameters]) -> Vec<Hyperparameters> {
    let mut out: Vec<Hyperparameters> = Vec::new();
    for at in all {
        if !out.contains(at) {
            out.push(*at);
        }
    }
    out
}
