//! Linear map from ln-powers to the inputs of a Gaussian process: subtract the mean, then multiply by a
//! matrix.

use crate::{Error, whitening};
use faer::{Mat, MatRef};
use serde::{Deserialize, Serialize};

/// Method that computes the inputs of a Gaussian process from a feature vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum InputScaling {
    /// The feature vector itself, as in the paper.
    Raw,
    /// Every bin is divided by its standard deviation over the training set; a bin with zero standard
    /// deviation gets weight zero.
    Standardised,
    /// Projection on the directions that separate parameters, scaled by the standard deviation that the
    /// random surface causes.
    Whitened {
        /// Number of directions.
        components: usize,
        /// Share of the mean variance over all bins that is added to the variance of every bin.
        shrinkage: f64,
    },
}

/// `z = (x - offset) projection`.
#[derive(Clone, Debug)]
pub struct InputMap {
    /// Method of the projection.
    pub scaling: InputScaling,
    /// Mean feature vector of the training set, d values.
    pub offset: Vec<f64>,
    /// Projection matrix, d x m.
    pub projection: Mat<f64>,
}

impl InputMap {
    /// Fits the map to training `features` (n x d) of cases with these `parameters` (n x p).
    ///
    /// # Errors
    /// For [`InputScaling::Whitened`]: [`Error::NotPositiveDefinite`] if there are too few entries or a
    /// parameter is constant; [`Error::NoEigenvalues`] if the eigenvalue iteration does not converge.
    pub fn fit(
        scaling: InputScaling,
        features: MatRef<'_, f64>,
        parameters: MatRef<'_, f64>,
    ) -> Result<Self, Error> {
        let (n, d) = (features.nrows(), features.ncols());
        let offset: Vec<f64> =
            features.col_iter().map(|column| column.iter().sum::<f64>() / n as f64).collect();
        let centred = centred(features, &offset);
        let projection = match scaling {
            InputScaling::Raw => Mat::identity(d, d),
            InputScaling::Standardised => {
                let deviations: Vec<f64> = centred
                    .col_iter()
                    .map(|column| (column.squared_norm_l2() / n as f64).sqrt())
                    .collect();
                let weight = |i: usize| if deviations[i] > 0.0 { 1.0 / deviations[i] } else { 0.0 };
                Mat::from_fn(d, d, |i, j| if i == j { weight(i) } else { 0.0 })
            }
            InputScaling::Whitened { components, shrinkage } => {
                whitening::directions(centred.as_ref(), parameters, components, shrinkage)?
            }
        };
        Ok(Self { scaling, offset, projection })
    }

    /// Inputs (t x m) of `features` (t x d).
    pub fn apply(&self, features: MatRef<'_, f64>) -> Mat<f64> {
        centred(features, &self.offset) * &self.projection
    }
}

fn centred(features: MatRef<'_, f64>, offset: &[f64]) -> Mat<f64> {
    Mat::from_fn(features.nrows(), features.ncols(), |i, j| features[(i, j)] - offset[j])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standardised_inputs_have_mean_zero_and_variance_one() {
        let features = Mat::from_fn(50, 2, |i, j| 3.0 + ((1 + j) * i) as f64);
        let map = InputMap::fit(
            InputScaling::Standardised,
            features.as_ref(),
            Mat::zeros(50, 0).as_ref(),
        );
        let inputs = map.unwrap().apply(features.as_ref());
        for column in inputs.col_iter() {
            // Sums of fifty numbers of size one, rounded.
            assert!(column.iter().sum::<f64>().abs() < 1e-12);
            assert!((column.squared_norm_l2() / 50.0 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_bin_that_never_changes_has_no_say() {
        let features = Mat::from_fn(5, 2, |i, j| if j == 1 { 2.0 } else { i as f64 });
        let none = Mat::zeros(5, 0);
        let map = InputMap::fit(InputScaling::Standardised, features.as_ref(), none.as_ref());
        assert_eq!(map.unwrap().projection[(1, 1)], 0.0);
    }
}
