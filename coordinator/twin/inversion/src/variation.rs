//! Variation between the sleepers of a recording: the prior's variation that maximises the evidence.
//!
//! Near a fitted track the log likelihood of the data is quadratic in the unknowns. The evidence of any
//! Gaussian prior then has a closed form (Laplace), and no forward model is needed to compare two priors.

use nalgebra::{Cholesky, DMatrix, DVector};
use tracktwin_diagnosis::{Calibration, Exception, Own, Unknowns, Variation};

/// Factors on a deviation or a length that the search tries.
const FACTORS: [f64; 4] = [0.5, 0.75, 1.35, 2.0];

/// Bounds of deviations (of the logarithm) and of lengths (in sleepers). The error of an odometer alone
/// makes sleepers differ by 1 to 2 %, and no stiffness of a track varies by more than a factor of three
/// about its mean.
const DEVIATION: [f64; 2] = [0.01, 1.0];
const LENGTH: [f64; 2] = [1.5, 12.0];

/// Log-normal prior of deviations and lengths: median of `smooth`, `independent` and `length`, and
/// the standard deviation of their logarithms. Sleepers of ballasted track differ by 5 to 30 %.
const MEDIAN: [f64; 3] = [0.15, 0.12, 3.0];
const SPREAD: [f64; 3] = [0.8, 0.8, 0.5];

/// Largest number of rounds over all deviations and lengths.
const ROUNDS: usize = 6;

/// Increase of the log evidence, in nats, that an exception needs: its prior probability is about one in a
/// hundred sleepers.
const EXCEPTION_NATS: f64 = 5.0;

/// Largest number of exceptions in one quantity, as a share of all sleepers.
const EXCEPTIONS_MAX: f64 = 0.2;

/// Quadratic log likelihood near a fitted track: `-0.5 x' H x + b' x` plus a constant.
pub(super) struct Quadratic {
    information: DMatrix<f64>,
    slope: DVector<f64>,
    mean: DVector<f64>,
}

impl Quadratic {
    /// Makes it from the whitened residual and derivatives of a fit; `x` is the distance from the prior's
    /// mean.
    pub(super) fn new(calibration: &Calibration, mean: DVector<f64>) -> Self {
        let jacobian = &calibration.jacobian;
        let at_mean = &calibration.residual + jacobian * (&calibration.values - &mean);
        let information = jacobian.transpose() * jacobian;
        Self { information, slope: jacobian.tr_mul(&at_mean), mean }
    }

    /// Log evidence of a prior in nats, up to a constant of the data.
    fn log_evidence(&self, unknowns: &Unknowns) -> f64 {
        let precision = unknowns.precision();
        let Some(prior) = Cholesky::new(precision.clone()) else { return f64::NEG_INFINITY };
        let Some(posterior) = Cholesky::new(precision + &self.information) else {
            return f64::NEG_INFINITY;
        };
        let gain = 0.5 * self.slope.dot(&posterior.solve(&self.slope));
        gain + 0.5 * (prior.ln_determinant() - posterior.ln_determinant())
            + unknowns.variation.iter().map(log_prior).sum::<f64>()
    }

    /// The values of greatest posterior probability under a prior.
    pub(super) fn best(&self, unknowns: &Unknowns) -> Option<DVector<f64>> {
        let posterior = Cholesky::new(unknowns.precision() + &self.information)?;
        Some(&self.mean + posterior.solve(&self.slope))
    }
}

/// Log density of a variation, up to a constant.
fn log_prior(variation: &Variation) -> f64 {
    let Variation { smooth, length, independent } = *variation;
    let of = |(value, (median, spread)): (f64, (f64, f64))| {
        -0.5 * ((value / median).ln() / spread).powi(2)
    };
    [smooth, independent, length].into_iter().zip(MEDIAN.into_iter().zip(SPREAD)).map(of).sum()
}

/// Sets the variation and the exceptions of `unknowns` to the values with the greatest evidence.
pub(super) fn learn(unknowns: &mut Unknowns, data: &Quadratic) {
    unknowns.exceptions.clear();
    vary(unknowns, data);
    if except(unknowns, data) {
        // Without its exceptions the rest of the track is more even.
        vary(unknowns, data);
    }
}

/// Changes one deviation or length after the other while the evidence rises.
fn vary(unknowns: &mut Unknowns, data: &Quadratic) {
    let mut best = data.log_evidence(unknowns);
    for _ in 0..ROUNDS {
        let before = best;
        for field in Own::ALL {
            for which in 0..3 {
                for factor in FACTORS {
                    let mut tried = unknowns.clone();
                    scale(&mut tried.variation[field as usize], which, factor);
                    let evidence = data.log_evidence(&tried);
                    if evidence > best {
                        best = evidence;
                        unknowns.variation = tried.variation;
                    }
                }
            }
        }
        if best - before < 0.1 {
            break;
        }
    }
}

fn scale(variation: &mut Variation, which: usize, factor: f64) {
    let [low, high] = if which == 2 { LENGTH } else { DEVIATION };
    let value = match which {
        0 => &mut variation.smooth,
        1 => &mut variation.independent,
        _ => &mut variation.length,
    };
    *value = (*value * factor).clamp(low, high);
}

/// Adds sleepers as exceptions while the evidence rises enough, the best one first; returns whether there
/// are any.
fn except(unknowns: &mut Unknowns, data: &Quadratic) -> bool {
    let sleepers = unknowns.ballast().len();
    let most = (EXCEPTIONS_MAX * sleepers as f64).ceil() as usize;
    let mut current = data.log_evidence(unknowns);
    loop {
        let room = |field: Own| {
            unknowns.exceptions.iter().filter(|known| known.field == field).count() < most
        };
        let fields = Own::ALL.into_iter().filter(|&field| room(field));
        let all = fields.flat_map(|field| (0..sleepers).map(move |it| (field, it)));
        let tried = all.map(|(field, sleeper)| Exception { field, sleeper });
        let new = tried.filter(|exception| !unknowns.exceptions.contains(exception));
        let with = |exception: Exception| {
            let mut with = unknowns.clone();
            with.exceptions.push(exception);
            (data.log_evidence(&with), exception)
        };
        let best = new.map(with).max_by(|one, other| one.0.total_cmp(&other.0));
        match best {
            Some((evidence, exception)) if evidence > current + EXCEPTION_NATS => {
                unknowns.exceptions.push(exception);
                current = evidence;
            }
            _ => return !unknowns.exceptions.is_empty(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use tracktwin_diagnosis::{Bands, Forward, Section};
    use tracktwin_parameters::TrackDesign;

    const SLEEPERS: usize = 24;

    fn unknowns() -> Unknowns {
        let section = Section::new(TrackDesign::v_track(), SLEEPERS, 1.0);
        Forward::new(section, Bands::new(200.0, 800.0), &[13.0], vec![0.0]).unknowns
    }

    /// Ballast measured with a deviation of 3 % at every sleeper: `scatter` is its own, and one sleeper
    /// is softer by a factor.
    fn measured(unknowns: &Unknowns, scatter: f64, soft: Option<(usize, f64)>) -> Quadratic {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut information = DMatrix::zeros(unknowns.count(), unknowns.count());
        let mut slope = DVector::zeros(unknowns.count());
        for (sleeper, index) in unknowns.ballast().enumerate() {
            let normal: f64 = StandardNormal.sample(&mut random);
            let softer = soft.filter(|(at, _)| *at == sleeper).map_or(0.0, |(_, by)| by);
            information[(index, index)] = 0.03f64.powi(-2);
            slope[index] = (scatter * normal - softer) / 0.03f64.powi(2);
        }
        Quadratic { information, slope, mean: unknowns.typical() }
    }

    #[test]
    fn the_scatter_of_a_track_is_learned_from_its_sleepers() {
        for scatter in [0.05, 0.15, 0.3] {
            let mut unknowns = unknowns();
            let data = measured(&unknowns, scatter, None);
            learn(&mut unknowns, &data);
            let Variation { smooth, independent, .. } = unknowns.variation[0];
            let learned = smooth.hypot(independent);
            // Twenty-four values know a deviation to 15 %; the prior's median adds its own pull.
            assert!((0.6..1.7).contains(&(learned / scatter)), "{scatter}: {learned}");
            assert!(unknowns.exceptions.is_empty());
        }
    }

    #[test]
    fn a_sleeper_far_from_its_neighbours_is_an_exception_and_leaves_theirs_alone() {
        let mut unknowns = unknowns();
        let data = measured(&unknowns, 0.05, Some((9, 0.9)));
        learn(&mut unknowns, &data);
        assert_eq!(unknowns.exceptions, [Exception { field: Own::BallastStiffness, sleeper: 9 }]);
        assert!(unknowns.variation[0].independent < 0.12, "{:?}", unknowns.variation[0]);
        let best = data.best(&unknowns).unwrap() - &data.mean;
        assert!((best[9] + 0.9).abs() < 0.12, "{}", best[9]);
        assert!(best[8].abs() < 0.15 && best[10].abs() < 0.15);
    }
}
