//! Training and test of every group of models.

use crate::distance::distances_within;
use crate::group::different;
use crate::validate::{coverage, folds, folds_with_own_maps, mase};
use crate::{
    Error, Factor, FeatureColumns, Folds, GroupKey, HyperparameterFit, Hyperparameters,
    InputScaling, ModelGroup, ModelScore, ParameterModel, Split, Spread, Trained, TrainingSet, fit,
};
use faer::Mat;
use std::sync::OnceLock;
use tracktwin_number::NORMAL_90;

/// Smallest number of entries for a training: a hundred for the hyper-parameters and a hundred for the
/// test.
pub const ENTRIES_MIN: usize = 200;

/// Options of a training.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// Feature sets, each trained at every speed.
    pub features: Vec<FeatureColumns>,
    /// Name of the feature set that is also trained on all speeds together.
    pub all_speeds: Option<String>,
    /// Candidate scalings of the inputs.
    pub scalings: Vec<InputScaling>,
    /// Number of held-out entries that compare the scalings.
    pub subset: usize,
    /// Number of folds of the cross-validation.
    pub folds: usize,
    /// Random seed of the split into training and test half.
    pub seed: u64,
}

impl TrainOptions {
    /// Default options for these feature sets: five folds (paper, 2.5.5) and all scalings.
    pub fn new(features: Vec<FeatureColumns>) -> Self {
        let whitened = [(16, 0.01), (8, 0.1), (16, 0.1), (32, 0.1), (8, 1.0), (16, 1.0), (32, 1.0)]
            .map(|(components, shrinkage)| InputScaling::Whitened { components, shrinkage });
        Self {
            all_speeds: features.first().map(|feature| feature.name.clone()),
            features,
            scalings: [[InputScaling::Raw, InputScaling::Standardised].as_slice(), &whitened]
                .concat(),
            subset: 1000,
            folds: 5,
            seed: 0,
        }
    }
}

/// Progress of a training.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Number of groups that are finished.
    pub finished: usize,
    /// Total number of groups.
    pub groups: usize,
    /// The group that begins; `None` at the end.
    pub next: Option<&'a GroupKey>,
}

/// Trains on a random half of the entries and tests on the other half (paper, 2.5.5 and 3.4).
///
/// # Errors
/// [`Error::Shape`], [`Error::NotFinite`] or [`Error::Constant`] if the training set is invalid;
/// [`Error::TooFewEntries`]; [`Error::Columns`] or [`Error::UnknownFeature`] if the options do not match
/// the set; otherwise the errors of [`fit()`].
pub fn train(
    set: &TrainingSet,
    options: &TrainOptions,
    progress: &dyn Fn(Progress),
) -> Result<Trained, Error> {
    set.check()?;
    if set.entries() < ENTRIES_MIN {
        return Err(Error::TooFewEntries { found: set.entries(), least: ENTRIES_MIN });
    }
    let keys = keys(set, options)?;
    let split = Split::halves(set.entries(), options.seed);
    let mut groups = Vec::with_capacity(keys.len());
    for key in &keys {
        progress(Progress { finished: groups.len(), groups: keys.len(), next: Some(key) });
        groups.push(train_group(set, key, options, &split)?);
    }
    progress(Progress { finished: keys.len(), groups: keys.len(), next: None });
    Ok(Trained::new(set, options.seed, groups))
}

/// Keys of the groups to train: every feature set at every speed, then the one for all speeds.
fn keys(set: &TrainingSet, options: &TrainOptions) -> Result<Vec<GroupKey>, Error> {
    let key = |speeds_km_h: &[f64], feature: &FeatureColumns| {
        feature.check(set.frequencies_hz.len())?;
        let (speeds_km_h, columns) = (speeds_km_h.to_vec(), feature.columns.clone());
        Ok(GroupKey { speeds_km_h, feature: feature.name.clone(), columns })
    };
    let mut keys = Vec::new();
    for speed in &set.speeds_km_h {
        for feature in &options.features {
            keys.push(key(&[*speed], feature)?);
        }
    }
    if let Some(name) = options.all_speeds.as_ref().filter(|_| set.speeds_km_h.len() > 1) {
        let feature = options
            .features
            .iter()
            .find(|feature| feature.name == *name)
            .ok_or_else(|| Error::UnknownFeature(name.clone()))?;
        keys.push(key(&set.speeds_km_h, feature)?);
    }
    Ok(keys)
}

fn train_group(
    set: &TrainingSet,
    key: &GroupKey,
    options: &TrainOptions,
    split: &Split,
) -> Result<ModelGroup, Error> {
    let speeds = speed_indices(set, key);
    let features = set.features(&split.train, &speeds, &key.columns);
    let targets = unit_targets(set, &split.train);
    let fit = fit(features.as_ref(), targets.as_ref(), &options.scalings, options.subset)?;
    let different = different(&fit.hyperparameters);
    let held_out = held_out(&features, &targets, &fit, &different, options.folds)?;
    let mut group = weigh(set, key, fit, &targets)?;
    for (at, folds) in different.into_iter().zip(held_out) {
        calibrate(&mut group, at, &folds, &targets);
    }
    let tested = set.features(&split.test, &speeds, &key.columns);
    test(&mut group, &tested, &unit_targets(set, &split.test))?;
    // Factors are as large as all inputs of the training set together: they are made again when
    // the models are used.
    for (_, slot) in &mut group.factors {
        slot.take();
    }
    Ok(group)
}

/// Parameters mapped onto [0, 1] by their ranges in the library and their scales.
fn unit_targets(set: &TrainingSet, entries: &[usize]) -> Mat<f64> {
    let mut values = set.values(entries);
    for (j, column) in values.col_iter_mut().enumerate() {
        let (range, scale) = (set.range(j), set.scales[j]);
        column.iter_mut().for_each(|value| *value = scale.share(range, *value));
    }
    values
}

fn speed_indices(set: &TrainingSet, key: &GroupKey) -> Vec<usize> {
    (0..set.speeds_km_h.len())
        .filter(|&index| key.speeds_km_h.contains(&set.speeds_km_h[index]))
        .collect()
}

/// Cross-validation results for each of the hyper-parameters.
fn held_out(
    features: &Mat<f64>,
    targets: &Mat<f64>,
    fit: &HyperparameterFit,
    at: &[Hyperparameters],
    count: usize,
) -> Result<Vec<Folds>, Error> {
    let scaling = fit.input_map.scaling;
    if let InputScaling::Whitened { .. } = scaling {
        return folds_with_own_maps(features.as_ref(), targets.as_ref(), scaling, at, count);
    }
    let away = distances_within(fit.inputs.as_ref());
    let basis = fit.mean.basis(fit.inputs.as_ref());
    at.iter()
        .map(|&at| {
            let factor = Factor::new(away.as_ref(), basis.as_ref(), at)?;
            folds(&factor, factor.weights(targets.as_ref()).weights.as_ref(), count)
        })
        .collect()
}

/// The group with its final weights, not yet validated.
fn weigh(
    set: &TrainingSet,
    key: &GroupKey,
    fit: HyperparameterFit,
    targets: &Mat<f64>,
) -> Result<ModelGroup, Error> {
    let away = distances_within(fit.inputs.as_ref());
    let basis = fit.mean.basis(fit.inputs.as_ref());
    let p = targets.ncols();
    let mut weights = Mat::zeros(targets.nrows(), p);
    let mut coefficients = Mat::zeros(basis.ncols(), p);
    let mut models: Vec<Option<ParameterModel>> = vec![None; p];
    let mut factors = Vec::new();
    for at in different(&fit.hyperparameters) {
        let factor = Factor::new(away.as_ref(), basis.as_ref(), at)?;
        let all = factor.weights(targets.as_ref());
        for j in (0..p).filter(|&j| fit.hyperparameters[j] == at) {
            weights.col_mut(j).copy_from(all.weights.col(j));
            coefficients.col_mut(j).copy_from(all.coefficients.col(j));
            models[j] = Some(ParameterModel {
                parameter: set.varied[j],
                range: set.range(j),
                scale: set.scales[j],
                hyperparameters: at,
                signal_variance: all.signal_variances[j],
                log_likelihood: all.log_likelihoods[j],
                spread: Spread::none(),
                score: ModelScore::default(),
            });
        }
        factors.push((at, OnceLock::from(factor)));
    }
    Ok(ModelGroup {
        key: key.clone(),
        bins: set.frequencies_hz.len(),
        input_map: fit.input_map,
        mean: fit.mean,
        inputs: fit.inputs,
        weights,
        coefficients,
        models: models.into_iter().flatten().collect(),
        factors,
    })
}

/// Computes cross-validation error and spread of the models with these hyper-parameters.
fn calibrate(group: &mut ModelGroup, at: Hyperparameters, folds: &Folds, targets: &Mat<f64>) {
    let models = group.models.iter_mut().enumerate();
    for (j, model) in models.filter(|(_, model)| model.hyperparameters == at) {
        let truth: Vec<f64> = targets.col(j).iter().copied().collect();
        let predicted: Vec<f64> = truth
            .iter()
            .enumerate()
            .map(|(i, t)| (t - folds.errors[(i, j)]).clamp(0.0, 1.0))
            .collect();
        let sds = folds.variances.iter().map(|variance| (model.signal_variance * variance).sqrt());
        let standardised: Vec<f64> =
            truth.iter().zip(&predicted).zip(sds).map(|((t, p), sd)| (t - p) / sd).collect();
        model.score.mase_folds = mase(&truth, &predicted, 1.0);
        model.spread = Spread::fit(&predicted, &standardised);
    }
}

/// Computes the scores on the test entries, which no step of the training used.
fn test(group: &mut ModelGroup, features: &Mat<f64>, targets: &Mat<f64>) -> Result<(), Error> {
    let (means, sds) = group.predict_features(features.as_ref())?;
    let column = |of: &Mat<f64>, j: usize| of.col(j).iter().copied().collect::<Vec<f64>>();
    for (j, model) in group.models.iter_mut().enumerate() {
        let (truth, mean) = (column(targets, j), column(&means, j));
        let difference: f64 = mean.iter().zip(&truth).map(|(m, t)| m - t).sum();
        model.score.mase_test = mase(&truth, &mean, 1.0);
        model.score.bias_test = difference / truth.len() as f64;
        model.score.coverage_90_test = coverage(&truth, &mean, &column(&sds, j), NORMAL_90);
    }
    Ok(())
}
