//! Models with common inputs: one speed (or all speeds) and one feature set, with one model per parameter.

use crate::distance::distances_within;
use crate::kernel::correlations;
use crate::{Error, Factor, Hyperparameters, InputMap, MeanFunction, Spread, distances};
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::OnceLock;
use tracktwin_parameters::{Parameter, Scale};

/// Pairs (true value, predicted value) of a parameter, in the unit of the parameter.
pub type Tested = (Parameter, Vec<(f64, f64)>);

/// Speeds and feature set of a group of models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupKey {
    /// Speeds in km/h; their features are concatenated in this order.
    pub speeds_km_h: Vec<f64>,
    /// Name of the feature set.
    pub feature: String,
    /// Range of bins of the feature set, the same at every speed.
    pub columns: Range<usize>,
}

/// Error measures of one model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelScore {
    /// MASE (paper, eq. 11) over the folds of the training set, as a share of the range: 0.05 is 5 %.
    pub mase_folds: f64,
    /// MASE over the test set, as a share of the range.
    pub mase_test: f64,
    /// Mean of prediction minus true value over the test set, as a share of the range.
    pub bias_test: f64,
    /// Share of the test set inside the predicted 90 % interval.
    pub coverage_90_test: f64,
}

/// A Gaussian process for one parameter.
///
/// The parameter is mapped internally onto [0, 1] by its range in the library and its scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterModel {
    /// The predicted parameter.
    pub parameter: Parameter,
    /// Lowest and highest value in the library, in the parameter's unit.
    pub range: [f64; 2],
    /// Scale on which the parameter is mapped onto [0, 1].
    #[serde(default)]
    pub scale: Scale,
    /// Length and noise ratio of the kernel.
    pub hyperparameters: Hyperparameters,
    /// Signal variance `s²`, of the parameter mapped onto [0, 1].
    pub signal_variance: f64,
    /// Log marginal likelihood in nats.
    pub log_likelihood: f64,
    /// Factor on the standard deviation as a function of the parameter mapped onto [0, 1].
    pub spread: Spread,
    /// Error measures of the model.
    pub score: ModelScore,
}

/// Predicted mean and standard deviation of a parameter, in the unit of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The parameter.
    pub parameter: Parameter,
    /// Expected value, clamped to the range of the library.
    pub mean: f64,
    /// Standard deviation of the value of a new case around `mean`.
    pub sd: f64,
}

/// Models of all parameters for the same inputs.
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
    /// One factor per distinct pair of hyper-parameters, computed at its first use.
    pub(crate) factors: Vec<(Hyperparameters, OnceLock<Factor>)>,
}

impl ModelGroup {
    /// Speeds and feature set of the group.
    pub fn key(&self) -> &GroupKey {
        &self.key
    }

    /// The models, in the order of the training set's varied parameters.
    pub fn models(&self) -> &[ParameterModel] {
        &self.models
    }

    /// Map from features to inputs.
    pub fn input_map(&self) -> &InputMap {
        &self.input_map
    }

    /// Number of training entries.
    pub fn entries(&self) -> usize {
        self.inputs.nrows()
    }

    /// Predicts every parameter for each of the `observations`. An observation holds the ln-powers of all
    /// bins, with the speeds of the group one after the other (speeds * bins numbers).
    ///
    /// A batch costs far less than the same number of single observations. The first call factorises the
    /// covariances (half a second each for 5000 entries).
    ///
    /// # Errors
    /// [`Error::Shape`] if an observation has another length; [`Error::NotPositiveDefinite`] if a
    /// covariance cannot be factorised.
    pub fn predict(&self, observations: &[Vec<f64>]) -> Result<Vec<Vec<Prediction>>, Error> {
        let (means, sds) = self.predict_features(self.features(observations)?.as_ref())?;
        Ok((0..observations.len()).map(|t| self.in_units(&means, &sds, t)).collect())
    }

    /// Inputs of the Gaussian processes for each of the `observations` (as for [`Self::predict`]): the
    /// features after the input map, m numbers each.
    ///
    /// # Errors
    /// [`Error::Shape`] if an observation has another length.
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

    /// Computes the missing factors and returns all factors.
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
                let mean = model.scale.at(model.range, means[(t, j)]);
                let sd = sds[(t, j)] * model.scale.slope(model.range, mean);
                Prediction { parameter: model.parameter, mean, sd }
            })
            .collect()
    }
}

/// The distinct hyper-parameters of the models, in order of appearance.
pub(crate) fn different(all: &[Hyperparameters]) -> Vec<Hyperparameters> {
    let mut out: Vec<Hyperparameters> = Vec::new();
    for at in all {
        if !out.contains(at) {
            out.push(*at);
        }
    }
    out
}
