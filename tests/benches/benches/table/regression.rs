//! A likelihood, and the training of all models of one speed.

use super::{ENTRIES, Error, Line};
use faer::Mat;
use tracktwin_benches::{by_the_clock, cost, feature_vectors, library, once};
use tracktwin_surrogate::{
    Factor, FeatureColumns, Hyperparameters, ModelGroup, TrainOptions, distances_within, train,
};

/// Step of a difference quotient of the likelihood, in the logarithms of length and noise.
const STEP: f64 = 1e-4;

/// One target and a typical pair of hyper-parameters.
pub(crate) fn likelihood() -> Result<Vec<Line>, Error> {
    let features = feature_vectors(ENTRIES, 300);
    let targets = Mat::from_fn(ENTRIES, 1, |i, _| features[(i, 150)] * 0.1);
    let (none, away) = (Mat::zeros(ENTRIES, 0), distances_within(features.as_ref()));
    let length = away.subcols(0, 100).sum() / (100.0 * ENTRIES as f64);
    let at = Hyperparameters { length, noise_ratio: 0.05 };
    let factor = |at| Factor::new(away.as_ref(), none.as_ref(), at);
    let both = || -> Result<[f64; 2], Error> {
        let factor = factor(at)?;
        Ok(factor.gradients(away.as_ref(), &factor.weights(targets.as_ref()))[0])
    };
    let likelihood = |by: f64| -> Result<f64, Error> {
        let at = Hyperparameters { length: length * by.exp(), ..at };
        Ok(factor(at)?.weights(targets.as_ref()).log_likelihoods[0])
    };
    let quotient = (likelihood(STEP)? - likelihood(-STEP)?) / (2.0 * STEP);
    let off = (both()?[0] / quotient - 1.0).abs();
    let apart = |i: usize, j: usize| (features.row(i) - features.row(j)).norm_l2();
    let worst = (1..100).map(|i| (away[(i, 0)] / apart(i, 0) - 1.0).abs()).fold(0.0, f64::max);
    faer::set_global_parallelism(faer::Par::rayon(2));
    let together = by_the_clock(both);
    faer::set_global_parallelism(faer::Par::Seq);
    Ok(vec![
        Line::new(
            "regression: likelihood and gradient, 5000, two cores by the clock",
            together,
            "",
        ),
        Line::new(
            "regression: distances, 5000 x 300",
            cost(|| distances_within(features.as_ref())),
            format!("{worst:.0e} off those of differences"),
        ),
        Line::new("regression: covariance and Cholesky, 5000", cost(|| factor(at)), ""),
        Line::new(
            "regression: likelihood and gradient, 5000",
            cost(both),
            format!("by the length {off:.0e} off the difference quotient"),
        ),
    ])
}

/// Training of the paper's five feature vectors at one speed, with six parameters each. It includes
/// scalings, hyper-parameters, folds and test.
pub(crate) fn training() -> Result<Vec<Line>, Error> {
    let set = library(2 * ENTRIES, &[13.0]);
    let bands = [("GF", 50.0, 4000.0), ("LF1", 400.0, 700.0), ("LF2", 800.0, 1500.0)]
        .into_iter()
        .chain([("LF3", 1500.0, 2500.0), ("LF4", 2500.0, 4000.0)]);
    let features = bands
        .map(|(name, low, high)| FeatureColumns::in_band(name, &set.frequencies_hz, low, high));
    let options = TrainOptions::new(features.collect());
    let (trained, cost) = once(|| train(&set, &options, &|_| ()));
    let trained = trained?;
    let models: Vec<_> = trained.groups().iter().flat_map(ModelGroup::models).collect();
    let mean = |score: fn(&tracktwin_surrogate::ModelScore) -> f64| {
        100.0 * models.iter().map(|model| score(&model.score)).sum::<f64>() / models.len() as f64
    };
    let [folds, test, coverage] =
        [mean(|s| s.mase_folds), mean(|s| s.mase_test), mean(|s| s.coverage_90_test)];
    let accuracy = format!(
        "mean MASE {test:.1} % in the test half, {folds:.1} % in the folds; 90 % intervals hold {coverage:.0} %"
    );
    Ok(vec![Line::new(&format!("training: {} models of one speed", models.len()), cost, accuracy)])
}
