#!/usr/bin/env python3
"""How well anyone could tell a track's parameters from the global feature at one speed.

    tracktwin library export --library URL --out training.parquet
    python3 tests/benches/limit.py training.parquet --speed 13

Needs NumPy, pandas with pyarrow, and scikit-learn. Prints the test MASE (paper, eq. 11) in per cent of what
reads the same halves of a library as `tracktwin train`: ridge regression on 304 levels, ridge
regression on products of 20 principal components, neural networks, and Bayes's rule with the levels'
mean as a polynomial of the parameters and one covariance of the scatter about it.
"""

import argparse

import numpy as np
import pandas as pd
from sklearn.decomposition import PCA
from sklearn.linear_model import RidgeCV
from sklearn.neural_network import MLPRegressor
from sklearn.preprocessing import PolynomialFeatures

TOLD = ["ballast_stiffness_N_m", "irregularity_level", "sleeper_EI_N_m2", "railpad_stiffness_N_m"]
ALL = TOLD + ["railpad_damping_N_s_m", "ballast_damping_N_s_m"]
STRENGTHS = np.logspace(-1, 5, 13)
SAMPLES = 40_000


def linear(features, parameters, tested):
    return RidgeCV(STRENGTHS).fit(features, parameters).predict(tested)


def products(features, parameters, tested):
    components = PCA(20, whiten=True).fit(features)
    pairs = PolynomialFeatures(2, include_bias=False)
    train = pairs.fit_transform(components.transform(features))
    return linear(train, parameters, pairs.transform(components.transform(tested)))


def networks(features, parameters, tested):
    def network(seed):
        shape = {"hidden_layer_sizes": (64, 32), "alpha": 1.0, "learning_rate_init": 2e-3}
        return MLPRegressor(**shape, early_stopping=True, max_iter=300, random_state=seed)

    fitted = [network(seed).fit(features, parameters) for seed in range(4)]
    return np.mean([network.predict(tested) for network in fitted], axis=0)


def bayes(features, parameters, tested):
    powers = PolynomialFeatures(4)
    mean = RidgeCV(np.logspace(-6, 2, 9)).fit(powers.fit_transform(parameters), features)
    scatter = features - mean.predict(powers.transform(parameters))
    values, vectors = np.linalg.eigh(np.cov(scatter.T))
    white = vectors / np.sqrt(np.maximum(values, 1e-6 * values[-1]))
    drawn = np.random.default_rng(1).random((SAMPLES, parameters.shape[1]))
    expected = mean.predict(powers.transform(drawn)) @ white
    squares = 0.5 * (expected**2).sum(axis=1)
    told = []
    for block in np.array_split(tested @ white, 50):
        evidence = block @ expected.T - squares
        weights = np.exp(evidence - evidence.max(axis=1, keepdims=True))
        told.append(weights @ drawn / weights.sum(axis=1, keepdims=True))
    return np.concatenate(told)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("training", help="what `tracktwin library export` wrote")
    arguments.add_argument("--speed", type=float, default=13.0, help="in km/h")
    given = arguments.parse_args()
    table = pd.read_parquet(given.training)
    table = table[table.speed_km_h == given.speed].sort_values("sobol_index")
    features = np.stack(table.log_power.values)
    parameters = table[ALL].to_numpy(float)
    low, high = parameters.min(axis=0), parameters.max(axis=0)
    parameters = (parameters - low) / (high - low)
    half = len(table) // 2
    features = (features - features[:half].mean(axis=0)) / features[:half].std(axis=0)
    print(f"{half} cases to learn from, {len(table) - half} to test; test MASE in %")
    print("estimator  " + "  ".join(f"{name:>22}" for name in TOLD))
    for estimator in [linear, products, networks, bayes]:
        told = estimator(features[:half], parameters[:half], features[half:])
        mase = 100 * np.abs(told - parameters[half:]).mean(axis=0)
        print(f"{estimator.__name__:10} " + "  ".join(f"{error:22.1f}" for error in mase[: len(TOLD)]), flush=True)


if __name__ == "__main__":
    main()
