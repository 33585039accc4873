//! Variation between the sleepers of a recording: the prior's variation that maximises the evidence.
//!
//! Near a fitted track the log likelihood of the data is quadratic in the unknowns. The evidence of any
//! Gaussian prior then has a closed form (Laplace), and no forward model is needed to compare two priors.

use nalgebra::{Cholesky, DMatrix, DVector};
use tracktwin_diagnosis::{Calibration, Candidate, Exception, Own, Unknowns, Variation};

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

/// Quadratic log likelihood near a fitted track, integrated over the parameters of known physics:
/// `-0.5 x' H x + b' x` plus a constant.
pub(super) struct Quadratic {
    information: DMatrix<f64>,
    slope: DVector<f64>,
    mean: DVector<f64>,
}

impl Quadratic {
    /// Makes it from the whitened residual and derivatives of a fit with `known` physics; `x` is the distance
    /// from the prior's mean. `None` if a number is not finite.
    pub(super) fn new(
        calibration: &Calibration,
        mean: DVector<f64>,
        known: &[Candidate],
    ) -> Option<Self> {
        let jacobian = &calibration.jacobian;
        let priors = |candidate: &Candidate| -> Vec<(f64, f64)> {
            candidate.free.iter().map(|parameter| candidate.prior(parameter)).collect()
        };
        let priors: Vec<(f64, f64)> = known.iter().flat_map(priors).collect();
        let (count, further) = (mean.len(), priors.len());
        let means = priors.iter().map(|(mean, _)| *mean);
        let all = DVector::from_iterator(count + further, mean.iter().copied().chain(means));
        let at_mean = &calibration.residual + jacobian * (&calibration.values - all);
        let information = jacobian.transpose() * jacobian;
        let slope = jacobian.tr_mul(&at_mean);
        if further == 0 {
            return Some(Self { information, slope, mean });
        }
        // A Gaussian integral over the last parameters with their prior: the Schur complement.
        let mut own = information.view((count, count), (further, further)).into_owned();
        for (index, (_, deviation)) in priors.iter().enumerate() {
            own[(index, index)] += deviation.powi(-2);
        }
        let own = Cholesky::new(own)?;
        let both = information.view((0, count), (count, further)).into_owned();
        let rest = slope.rows(count, further).into_owned();
        Some(Self {
            information: information.view((0, 0), (count, count))
                - &both * own.solve(&both.transpose()),
            slope: slope.rows(0, count) - both * own.solve(&rest),
            mean,
        })
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
    use tracktwin_track::extension::{ExtensionInstance, Kind};

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

    #[test]
    fn parameters_of_known_physics_are_integrated_out() {
        let unknowns = unknowns();
        let (count, rows) = (unknowns.count(), 3 * unknowns.count());
        let kind = Kind::from_name("sleeper_bolt").unwrap();
        let candidate = Candidate {
            kind,
            extension: ExtensionInstance::new("sleeper_bolt"),
            free: vec![kind.parameter("stiffness_N_per_m").unwrap()],
            trials: vec![vec![3e7]],
            length_ratio: 1.0,
        };
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut normal = || StandardNormal.sample(&mut random);
        let jacobian = DMatrix::from_fn(rows, count + 1, |_, _| normal());
        let residual = DVector::from_fn(rows, |_, _| normal());
        let (mean, deviation) = candidate.prior(candidate.free[0]);
        let mut precision = DMatrix::zeros(count + 1, count + 1);
        precision.view_mut((0, 0), (count, count)).copy_from(&unknowns.precision());
        precision[(count, count)] = deviation.powi(-2);
        let mut at = DVector::from_fn(count + 1, |_, _| 0.0);
        at.rows_mut(0, count).copy_from(&unknowns.typical());
        at[count] = mean;
        // The fit is somewhere near.
        let values = &at + DVector::from_fn(count + 1, |_, _| 0.1);
        let posterior = Cholesky::new(precision + jacobian.transpose() * &jacobian).unwrap();
        let right = jacobian.tr_mul(&(&residual + &jacobian * (&values - &at)));
        let expected = &at + posterior.solve(&right);
        let calibration = Calibration {
            gradient: DVector::zeros(count + 1),
            values,
            residual,
            jacobian,
            precision: posterior,
            objective: 0.0,
            log_evidence: 0.0,
            others: Vec::new(),
        };
        let data = Quadratic::new(&calibration, unknowns.typical(), &[candidate]).unwrap();
        let best = data.best(&unknowns).unwrap();
        assert!((best - expected.rows(0, count)).amax() < 1e-8);
    }
}
