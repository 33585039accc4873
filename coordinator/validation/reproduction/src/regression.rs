//! Regressions beside the Gaussian processes: a decision tree, a support vector machine, bagged
//! trees.

use crate::{Error, Figure};
use smartcore::ensemble::random_forest_regressor::{
    RandomForestRegressor, RandomForestRegressorParameters,
};
use smartcore::error::Failed;
use smartcore::linalg::basic::matrix::DenseMatrix;
use smartcore::svm::Kernels;
use smartcore::svm::svr::{SVR, SVRParameters};
use smartcore::tree::decision_tree_regressor::{
    DecisionTreeRegressor, DecisionTreeRegressorParameters,
};

/// Cases that train the support vector machine at most; its time grows with their square.
pub(crate) const SVM_CASES: usize = 2000;

/// Fewest cases in a leaf: of MATLAB's Medium Tree, and of the trees of its Bagged Trees.
const TREE_LEAF: usize = 12;
const BAGGED_LEAF: usize = 8;

/// Trees of MATLAB's Bagged Trees.
const TREES: usize = 30;

/// Interquartile range of a normal distribution over its standard deviation, as in MATLAB's
/// defaults of the support vector machine.
const NORMAL_IQR: f64 = 1.349;

/// Seed of the bootstrap samples.
const SEED: u64 = 1;

/// A regression with the settings of MATLAB's Regression Learner, as in the paper (section 6.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Regression {
    /// Medium Tree: leaves of at least 12 cases.
    Tree,
    /// Medium Gaussian SVM: kernel scale `sqrt(m)` for m inputs; box constraint and half-width of
    /// the insensitive zone from the interquartile range of the targets.
    SupportVectors,
    /// Bagged Trees: 30 trees on bootstrap samples, all inputs at every split, leaves of at least 8
    /// cases.
    BaggedTrees,
}

impl Regression {
    /// All of them, in the order of the paper's Fig. 25.
    pub(crate) const ALL: [Self; 3] = [Self::Tree, Self::SupportVectors, Self::BaggedTrees];

    /// What legends call it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Tree => "tree",
            Self::SupportVectors => "SVM",
            Self::BaggedTrees => "bagged trees",
        }
    }

    /// Values predicted for the `tested` inputs after training on `inputs` (a row a case) with
    /// their `targets` on [0, 1]; kept within [0, 1].
    ///
    /// # Errors
    /// [`Error::Regression`].
    pub(crate) fn predict(
        self,
        inputs: &[Vec<f64>],
        targets: &[f64],
        tested: &[Vec<f64>],
    ) -> Result<Vec<f64>, Error> {
        let predicted = match self {
            Self::Tree => tree(inputs, targets, tested),
            Self::SupportVectors => {
                let count = inputs.len().min(SVM_CASES);
                support_vectors(&inputs[..count], &targets[..count], tested)
            }
            Self::BaggedTrees => bagged_trees(inputs, targets, tested),
        };
        let (figure, method) = (Figure::Fig25, self.name());
        let predicted = predicted.map_err(|failed| {
            let message = failed.to_string();
            Error::Regression { figure, method, message }
        })?;
        Ok(predicted.into_iter().map(|value| value.clamp(0.0, 1.0)).collect())
    }
}

fn tree(inputs: &[Vec<f64>], targets: &[f64], tested: &[Vec<f64>]) -> Result<Vec<f64>, Failed> {
    let settings = DecisionTreeRegressorParameters::default().with_min_samples_leaf(TREE_LEAF);
    let trained = DecisionTreeRegressor::fit(&matrix(inputs)?, &targets.to_vec(), settings)?;
    trained.predict(&matrix(tested)?)
}

fn bagged_trees(
    inputs: &[Vec<f64>],
    targets: &[f64],
    tested: &[Vec<f64>],
) -> Result<Vec<f64>, Failed> {
    let settings = RandomForestRegressorParameters::default()
        .with_n_trees(TREES)
        .with_m(inputs[0].len())
        .with_min_samples_leaf(BAGGED_LEAF)
        .with_seed(SEED);
    let trained = RandomForestRegressor::fit(&matrix(inputs)?, &targets.to_vec(), settings)?;
    trained.predict(&matrix(tested)?)
}

fn support_vectors(
    inputs: &[Vec<f64>],
    targets: &[f64],
    tested: &[Vec<f64>],
) -> Result<Vec<f64>, Failed> {
    let columns = inputs[0].len();
    // smartcore 0.7.0 cuts every row to as many numbers as there are rows. Copies of all cases,
    // each with its part of the box constraint, are the same machine.
    let copies = columns.div_ceil(inputs.len());
    let scale = interquartile_range(targets) / NORMAL_IQR;
    let kernel = Kernels::rbf().with_gamma(1.0 / columns as f64);
    let settings = SVRParameters::default()
        .with_c(scale / copies as f64)
        .with_eps(0.1 * scale)
        .with_kernel(kernel);
    let (inputs, targets) = (matrix(&vec![inputs; copies].concat())?, targets.repeat(copies));
    let tested = matrix(tested)?;
    SVR::fit(&inputs, &targets, &settings)?.predict(&tested)
}

fn matrix(rows: &[Vec<f64>]) -> Result<DenseMatrix<f64>, Failed> {
    let columns = rows.first().map_or(0, Vec::len);
    DenseMatrix::new(rows.len(), columns, rows.concat(), false)
}

/// Distance between the quartiles of values.
fn interquartile_range(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[3 * (sorted.len() - 1) / 4] - sorted[(sorted.len() - 1) / 4]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::random;

    /// Cases of three inputs, and a smooth function of two of them on [0, 1].
    fn cases(range: std::ops::Range<usize>) -> (Vec<Vec<f64>>, Vec<f64>) {
        let inputs: Vec<Vec<f64>> = range
            .map(|case| (0..3).map(|j| 3.4 * (random(3 * case + j) - 0.5)).collect())
            .collect();
        let target = |of: &Vec<f64>| 0.5 + 0.25 * (1.5 * of[0]).sin() + 0.12 * of[1];
        let targets = inputs.iter().map(target).collect();
        (inputs, targets)
    }

    fn error(regression: Regression) -> f64 {
        let ((inputs, targets), (tested, truth)) = (cases(0..600), cases(600..900));
        let predicted = regression.predict(&inputs, &targets, &tested).unwrap();
        let errors = predicted.iter().zip(&truth).map(|(of, truth)| (of - truth).abs());
        errors.sum::<f64>() / truth.len() as f64
    }

    #[test]
    fn every_regression_learns_a_smooth_function_and_bagging_helps_the_tree() {
        let (tree, svm, bagged) = (
            error(Regression::Tree),
            error(Regression::SupportVectors),
            error(Regression::BaggedTrees),
        );
        // A constant has about 0.17. The insensitive zone of the SVM is 0.03 wide on either side.
        assert!(tree < 0.06 && svm < 0.03, "{tree} {svm}");
        assert!(bagged < 0.8 * tree, "{bagged} {tree}");
    }

    #[test]
    fn a_support_vector_machine_of_more_inputs_than_cases_is_the_same() {
        let ((inputs, targets), (tested, _)) = (cases(0..60), cases(60..90));
        let repeated =
            |rows: &[Vec<f64>]| rows.iter().map(|row| row.repeat(40)).collect::<Vec<_>>();
        let svm = Regression::SupportVectors;
        let few = svm.predict(&inputs, &targets, &tested).unwrap();
        let many = svm.predict(&repeated(&inputs), &targets, &repeated(&tested)).unwrap();
        // The kernel's scale grows with the number of inputs. The solver stops at 1e-3.
        for (few, many) in few.iter().zip(&many) {
            assert!((few - many).abs() < 5e-3, "{few} {many}");
        }
    }

    #[test]
    fn predictions_stay_inside_the_range_of_the_targets() {
        let (inputs, _) = cases(0..50);
        let targets: Vec<f64> = (0..50).map(|case| f64::from(case % 2)).collect();
        let far: Vec<Vec<f64>> = (0..20).map(|at| vec![f64::from(at) - 10.0; 3]).collect();
        for regression in Regression::ALL {
            let predicted = regression.predict(&inputs, &targets, &far).unwrap();
            assert!(predicted.iter().all(|of| (0.0..=1.0).contains(of)), "{regression:?}");
        }
    }

    #[test]
    fn the_interquartile_range_of_an_even_spread_is_half_of_it() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert!((interquartile_range(&values) - 50.0).abs() < 1e-12);
    }
}
