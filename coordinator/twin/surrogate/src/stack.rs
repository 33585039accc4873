//! Combination of the models of single speeds by linear regression on the test half of the library
//! (stacking: Wolpert 1992, Breiman 1996).
//!
//! Each model of a single speed shrinks its estimates towards the middle of the range, the more the less it
//! resolves the parameter. A mean of such estimates is too near to the middle; the regression removes this and
//! weighs common errors correctly.

use crate::cholesky::Cholesky;
use crate::{Error, Prediction, Split, Trained, TrainingSet};
use faer::Mat;
use tracktwin_parameters::Scale;

/// Largest number of test entries that are used.
const ENTRIES_MAX: usize = 1000;
/// Added to the diagonal of the normal equations, as a share of the number of entries, so that equal models can
/// be combined.
const RIDGE: f64 = 1e-6;

/// Combination of the models of several single speeds.
pub struct Stack(Vec<Combination>);

/// Combination for one parameter, which is mapped onto [0, 1] by its range in the library.
struct Combination {
    range: [f64; 2],
    scale: Scale,
    offset: f64,
    /// One weight per speed.
    weights: Vec<f64>,
    /// Root mean square of the error over the mean predicted standard deviation, on the test entries.
    spread: f64,
}

impl Stack {
    /// Fits the combination of the models of these `speeds` (indices) and this feature set.
    ///
    /// # Errors
    /// [`Error::UnknownFeature`] if a speed has no such models; otherwise the errors of
    /// [`crate::ModelGroup::predict`].
    pub fn fit(
        trained: &Trained,
        set: &TrainingSet,
        speeds: &[usize],
        feature: &str,
    ) -> Result<Self, Error> {
        let mut entries = Split::halves(set.entries(), trained.split_seed()).test;
        entries.truncate(ENTRIES_MAX);
        let bins = set.frequencies_hz.len();
        let predicted = |&speed: &usize| {
            let group = trained
                .group(&[set.speeds_km_h[speed]], feature)
                .ok_or_else(|| Error::UnknownFeature(feature.to_owned()))?;
            let features = |&entry: &usize| set.log_power[speed][entry * bins..][..bins].to_vec();
            group.predict(&entries.iter().map(features).collect::<Vec<_>>())
        };
        let predicted = speeds.iter().map(predicted).collect::<Result<Vec<_>, Error>>()?;
        let truth = |entry: usize, column: usize| set.parameters[entry * set.varied.len() + column];
        let combination = |column: usize| {
            let known: Vec<f64> = entries.iter().map(|&entry| truth(entry, column)).collect();
            let of = |entry: usize| predicted.iter().map(move |speed| speed[entry][column]);
            Combination::fit(set.range(column), set.scales[column], &known, of)
        };
        Ok(Self((0..set.varied.len()).map(combination).collect::<Result<_, _>>()?))
    }

    /// Combines the predictions of the models of each speed, in the order of the fit. Parameters have the order
    /// of the training set.
    pub fn combine(&self, by_speed: &[Vec<Prediction>]) -> Vec<Prediction> {
        let of = |column: usize| by_speed.iter().map(move |speed| speed[column]);
        let Some(first) = by_speed.first() else { return Vec::new() };
        let combined = |(column, combination): (usize, &Combination)| Prediction {
            parameter: first[column].parameter,
            ..combination.of(of(column))
        };
        self.0.iter().enumerate().map(combined).collect()
    }
}

impl Combination {
    /// Fits to true values, in the parameter's unit, and to the predictions for each of them.
    fn fit<I: Iterator<Item = Prediction>>(
        range: [f64; 2],
        scale: Scale,
        known: &[f64],
        of: impl Fn(usize) -> I,
    ) -> Result<Self, Error> {
        let unit = |value: f64| scale.share(range, value);
        let rows: Vec<Vec<f64>> = (0..known.len())
            .map(|entry| [1.0].into_iter().chain(of(entry).map(|it| unit(it.mean))).collect())
            .collect();
        let width = rows.first().map_or(0, Vec::len);
        let basis = Mat::from_fn(known.len(), width, |i, j| rows[i][j]);
        let truth = Mat::from_fn(known.len(), 1, |i, _| unit(known[i]));
        let mut normal = basis.transpose() * &basis;
        (1..width).for_each(|j| normal[(j, j)] += RIDGE * known.len() as f64);
        let right = basis.transpose() * truth;
        let coefficients = Cholesky::new(normal)?.solve(right.as_ref());
        let weights = (1..width).map(|j| coefficients[(j, 0)]).collect();
        let plain = Self { range, scale, offset: coefficients[(0, 0)], weights, spread: 1.0 };
        let square = |entry: usize| {
            let Prediction { mean, sd, .. } = plain.of(of(entry));
            ((unit(mean) - unit(known[entry])) / (sd / scale.slope(range, mean))).powi(2)
        };
        let mean_square = (0..known.len()).map(square).sum::<f64>() / known.len() as f64;
        Ok(Self { spread: mean_square.sqrt(), ..plain })
    }

    /// The combination of one or more predictions of the parameter, inside its range.
    fn of(&self, predictions: impl Iterator<Item = Prediction>) -> Prediction {
        let Self { range, scale, .. } = *self;
        let (mut unit, mut sd, mut parameter) = (self.offset, 0.0, None);
        for (prediction, weight) in predictions.zip(&self.weights) {
            unit += weight * scale.share(range, prediction.mean);
            sd += prediction.sd / scale.slope(range, prediction.mean) / self.weights.len() as f64;
            parameter = Some(prediction.parameter);
        }
        let mean = scale.at(range, unit.clamp(0.0, 1.0));
        let parameter = parameter.expect("a combination has at least one speed");
        Prediction { parameter, mean, sd: self.spread * sd * scale.slope(range, mean) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::Parameter;

    /// Two estimates of a value that shrink it to half, with errors of this size that are independent.
    fn shrunk(known: &[f64], error: f64) -> Vec<[Prediction; 2]> {
        let noise = |entry: usize, of: usize| {
            error * (((2 * entry + of) as f64 * 12.9898).sin() * 43_758.545).fract()
        };
        let prediction = |(entry, value): (usize, &f64)| {
            [0, 1].map(|of| Prediction {
                parameter: Parameter::BallastStiffness,
                mean: 15.0 + 0.5 * (value - 15.0) + noise(entry, of),
                sd: error,
            })
        };
        known.iter().enumerate().map(prediction).collect()
    }

    #[test]
    fn shrunk_estimates_are_stretched_and_the_deviation_is_that_of_the_errors() {
        let known: Vec<f64> = (0..400).map(|entry| 10.0 + f64::from(entry) / 40.0).collect();
        let of = shrunk(&known, 0.2);
        let found =
            Combination::fit([10.0, 20.0], Scale::Linear, &known, |i| of[i].into_iter()).unwrap();
        let sum: f64 = found.weights.iter().sum();
        assert!((1.8..2.0).contains(&sum), "{sum}");
        let errors =
            known.iter().zip(&of).map(|(value, of)| found.of(of.iter().copied()).mean - value);
        let rms = (errors.map(|error| error * error).sum::<f64>() / 400.0).sqrt();
        assert!((found.spread * 0.2 / rms - 1.0).abs() < 1e-9, "{} {rms}", found.spread);
        assert!(rms < 0.3, "{rms}");
    }

    #[test]
    fn equal_models_can_be_combined() {
        let known: Vec<f64> = (0..200).map(f64::from).collect();
        let same = |entry: usize| {
            let mean = known[entry];
            let one = Prediction { parameter: Parameter::RailpadStiffness, mean, sd: 1.0 };
            [one; 2].into_iter()
        };
        let found = Combination::fit([0.0, 199.0], Scale::Linear, &known, same).unwrap();
        assert!((found.weights[0] - found.weights[1]).abs() < 1e-6);
        assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-4);
    }
}
