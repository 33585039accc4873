//! The process itself: closed forms, another program's values, derivatives, folds.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use faer::{Mat, MatRef};
use tracktwin_surrogate::{
    Factor, Hyperparameters, MeanFunction, distances, distances_within, folds,
};

fn inputs(n: usize) -> Mat<f64> {
    Mat::from_fn(n, 4, |i, j| {
        let (i, j) = (i as f64, j as f64);
        (1.3 * i + 2.1 * j).sin() + 0.1 * i / 30.0 * (j + 1.0)
    })
}

/// Inputs without a linear relation between them, as a linear mean needs.
fn independent_inputs(n: usize) -> Mat<f64> {
    Mat::from_fn(n, 4, |i, j| (0.7 * i as f64 * (j as f64 + 1.0) + j as f64).sin())
}

fn targets(x: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(x.nrows(), 1, |i, _| {
        x[(i, 0)].cos() + 0.3 * x[(i, 1)] + 0.05 * (7.0 * i as f64).sin()
    })
}

/// A factor around the mean of zero.
fn plain(x: MatRef<'_, f64>, length: f64, noise_ratio: f64) -> Factor {
    let basis = Mat::zeros(x.nrows(), 0);
    let at = Hyperparameters { length, noise_ratio };
    Factor::new(distances_within(x).as_ref(), basis.as_ref(), at).unwrap()
}

#[test]
fn the_likelihood_of_two_entries_is_the_closed_form() {
    // Two entries a distance 1 apart, K = [[a, b], [b, a]], y = (1, 3):
    // y' K^-1 y = (a 1 - 2 b 3 + a 9) / (a^2 - b^2), s^2 is half of it,
    // ln L = -ln(2 pi s^2) - 1 - ln(a^2 - b^2) / 2.
    let (a, b) = (1.25f64, (-0.5f64).exp());
    let s2 = (10.0 * a - 6.0 * b) / (a * a - b * b) / 2.0;
    let expected = -(2.0 * std::f64::consts::PI * s2).ln() - 1.0 - 0.5 * (a * a - b * b).ln();
    let x = Mat::from_fn(2, 1, |i, _| i as f64);
    let y = Mat::from_fn(2, 1, |i, _| 1.0 + 2.0 * i as f64);
    let found = plain(x.as_ref(), 2.0, 0.25).weights(y.as_ref());
    // A dozen roundings of numbers near one.
    assert!((found.signal_variances[0] - s2).abs() < 1e-14 * s2);
    assert!((found.log_likelihoods[0] - expected).abs() < 1e-13);
}

#[test]
fn likelihood_mean_and_deviation_are_those_of_scikit_learn() {
    // Made by scikit-learn 1.9.1: ConstantKernel * Matern(nu=0.5) + WhiteKernel on these inputs.
    let golden: serde_json::Value =
        serde_json::from_str(include_str!("data/scikit_learn.json")).unwrap();
    let number = |name: &str| golden[name].as_f64().unwrap();
    let x = inputs(30);
    let factor = plain(x.as_ref(), number("length"), number("noise_ratio"));
    let found = factor.weights(targets(&x).as_ref());
    // Two orders of summation of thirty terms, through a matrix of condition 500.
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{a} {b}");
    close(found.signal_variances[0], number("signal_variance"));
    close(found.log_likelihoods[0], number("log_likelihood"));

    let t = Mat::from_fn(5, 4, |i, j| (0.9 * i as f64 + 1.7 * j as f64).cos());
    let away = distances(x.as_ref(), t.as_ref());
    let variances = factor.variances(away.as_ref(), Mat::zeros(5, 0).as_ref());
    for i in 0..5 {
        let mean: f64 =
            (0..30).map(|n| (-away[(n, i)] / number("length")).exp() * found.weights[(n, 0)]).sum();
        close(mean, golden["means"][i].as_f64().unwrap());
        let sd = (found.signal_variances[0] * variances[i]).sqrt();
        close(sd, golden["sds"][i].as_f64().unwrap());
    }
}

#[test]
fn the_gradient_is_that_of_scikit_learn() {
    let golden: serde_json::Value =
        serde_json::from_str(include_str!("data/scikit_learn.json")).unwrap();
    let number = |name: &str| golden[name].as_f64().unwrap();
    let x = inputs(30);
    let factor = plain(x.as_ref(), number("length"), number("noise_ratio"));
    let found = factor.weights(targets(&x).as_ref());
    let [length, noise] = factor.gradients(distances_within(x.as_ref()).as_ref(), &found)[0];
    assert!((length - number("gradient_log_length")).abs() < 1e-10);
    assert!((noise - number("gradient_log_noise")).abs() < 1e-10);
}

#[test]
fn the_gradient_is_the_slope_of_the_likelihood() {
    let x = independent_inputs(60);
    let y = targets(&x);
    let away = distances_within(x.as_ref());
    let basis = MeanFunction::Linear.basis(x.as_ref());
    let factor = |ln_length: f64, ln_noise: f64| {
        let at = Hyperparameters { length: ln_length.exp(), noise_ratio: ln_noise.exp() };
        Factor::new(away.as_ref(), basis.as_ref(), at).unwrap()
    };
    let likelihood = |l, r| factor(l, r).weights(y.as_ref()).log_likelihoods[0];
    let (l, r, h) = (0.4f64, -2.5, 1e-5);
    let here = factor(l, r);
    let [length, noise] = here.gradients(away.as_ref(), &here.weights(y.as_ref()))[0];
    let by_length = (likelihood(l + h, r) - likelihood(l - h, r)) / (2.0 * h);
    let by_noise = (likelihood(l, r + h) - likelihood(l, r - h)) / (2.0 * h);
    // Central differences: h^2 of the third derivative (1e-9) and rounding 1e-13 / h (1e-8).
    assert!((length - by_length).abs() < 1e-6, "{length} {by_length}");
    assert!((noise - by_noise).abs() < 1e-6, "{noise} {by_noise}");
}

#[test]
fn without_noise_the_process_passes_through_its_entries() {
    let x = inputs(40);
    let y = targets(&x);
    let factor = plain(x.as_ref(), 1.0, 0.0);
    let found = factor.weights(y.as_ref());
    let away = distances(x.as_ref(), x.as_ref());
    let variances = factor.variances(away.as_ref(), Mat::zeros(40, 0).as_ref());
    for i in 0..40 {
        let mean: f64 = (0..40).map(|n| (-away[(n, i)]).exp() * found.weights[(n, 0)]).sum();
        // An entry's distance to itself comes out as up to 1e-7 (cancellation), and the kernel
        // is as steep there as its length allows.
        assert!((mean - y[(i, 0)]).abs() < 1e-6, "entry {i}");
        assert!(variances[i] < 1e-6, "entry {i}");
    }
}

#[test]
fn folds_are_what_honest_refits_without_each_fold_give() {
    let x = independent_inputs(41);
    let y = targets(&x);
    let away = distances_within(x.as_ref());
    let basis = MeanFunction::Linear.basis(x.as_ref());
    let at = Hyperparameters { length: 2.0, noise_ratio: 0.05 };
    let factor = Factor::new(away.as_ref(), basis.as_ref(), at).unwrap();
    let fast = folds(&factor, factor.weights(y.as_ref()).weights.as_ref(), 5).unwrap();
    for fold in 0..5 {
        let kept: Vec<usize> = (0..41).filter(|i| i % 5 != fold).collect();
        let rows = |m: &Mat<f64>, rows: &[usize]| {
            Mat::from_fn(rows.len(), m.ncols(), |i, j| m[(rows[i], j)])
        };
        let x_kept = rows(&x, &kept);
        let within = distances_within(x_kept.as_ref());
        let refit = Factor::new(within.as_ref(), rows(&basis, &kept).as_ref(), at).unwrap();
        let found = refit.weights(rows(&y, &kept).as_ref());
        for i in (fold..41).step_by(5) {
            let to_kept = distances(x_kept.as_ref(), x.subrows(i, 1));
            let known: f64 = (0..kept.len())
                .map(|n| (-to_kept[(n, 0)] / at.length).exp() * found.weights[(n, 0)])
                .sum();
            let mean = known + basis.row(i) * found.coefficients.col(0);
            let variance = refit.variances(to_kept.as_ref(), basis.subrows(i, 1))[0];
            // The same numbers through matrices of condition below 1000.
            assert!((fast.errors[(i, 0)] - (y[(i, 0)] - mean)).abs() < 1e-11, "entry {i}");
            assert!((fast.variances[i] - variance).abs() < 1e-11, "entry {i}");
        }
    }
}
