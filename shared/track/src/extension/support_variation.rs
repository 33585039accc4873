//! Railpads and ballast that differ from sleeper to sleeper.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening, Stage,
};
use crate::model::{Assembly, Support};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "support_variation",
    summary: "railpads and ballast differ from sleeper to sleeper",
    family: EffectFamily::Support,
    group: LookAlikeGroup::Support,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("ballast_cv", "1", "scatter of the ballast stiffness over its mean")
            .ranges([0.05, 0.4], [0.1, 0.5], 0.2)
            .bound(Bound::NotNegative)
            .or(0.0),
        KindParameter::new("railpad_cv", "1", "scatter of the railpad stiffness over its mean")
            .ranges([0.05, 0.4], [0.1, 0.5], 0.2)
            .bound(Bound::NotNegative)
            .or(0.0),
        KindParameter::new("length_m", "m", "distance at which the correlation falls to 1/e")
            .ranges([0.1, 2.0], [0.5, 10.0], 0.4)
            .or(0.4),
        KindParameter::new("seed", "1", "seed of the draw").bound(Bound::NotNegative).or(1.0),
    ],
    look_alikes: &["hanging_sleeper", "missing_railpad"],
    would_separate: "nothing needs to: it is what the baseline's own values at each sleeper are",
    screening: Screening::not_tried("the baseline fits every support by itself"),
    build: |inputs| {
        Ok(Arc::new(SupportVariation {
            sleepers: inputs.sleepers(),
            ballast_cv: inputs.value("ballast_cv"),
            railpad_cv: inputs.value("railpad_cv"),
            correlation: (-inputs.design.sleeper.spacing_m / inputs.value("length_m")).exp(),
            seed: inputs.value("seed") as u64,
        }))
    },
};

/// Logarithms of the stiffness that are a Gauss-Markov sequence along the track (mismatch
/// catalogue 11); damping stays.
#[derive(Debug)]
struct SupportVariation {
    sleepers: Vec<usize>,
    ballast_cv: f64,
    railpad_cv: f64,
    /// From one sleeper to the next.
    correlation: f64,
    seed: u64,
}

impl Extension for SupportVariation {
    fn stage(&self) -> Stage {
        Stage::Variation
    }

    fn assemble(&self, assembly: &mut Assembly) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let ballast = self.factors(&mut random, self.ballast_cv);
        let railpad = self.factors(&mut random, self.railpad_cv);
        for ((&index, ballast), railpad) in self.sleepers.iter().zip(ballast).zip(railpad) {
            let support = assembly.supports()[index];
            let ballast_stiffness = ballast * support.ballast_stiffness;
            let railpad_stiffness = railpad * support.railpad_stiffness;
            let changed = Support { railpad_stiffness, ballast_stiffness, ..support };
            assembly.set_support(index, changed);
        }
    }
}

impl SupportVariation {
    /// Factors of mean one and coefficient of variation `cv`, one per sleeper.
    fn factors(&self, random: &mut impl Rng, cv: f64) -> Vec<f64> {
        let variance = (1.0 + cv * cv).ln();
        let mut value = standard_normal(random);
        let mut last = self.sleepers.first().copied().unwrap_or_default();
        let mut next = |sleeper: usize| {
            if sleeper > last {
                let correlation = self.correlation.powf((sleeper - last) as f64);
                let fresh = (1.0 - correlation * correlation).sqrt();
                value = correlation * value + fresh * standard_normal(random);
                last = sleeper;
            }
            (variance.sqrt() * value - 0.5 * variance).exp()
        };
        self.sleepers.iter().map(|&sleeper| next(sleeper)).collect()
    }
}

/// A standard normal number (Box & Muller 1958).
fn standard_normal(random: &mut impl Rng) -> f64 {
    let unit = |bits: u64| ((bits >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let radius = (-2.0 * unit(random.next_u64()).ln()).sqrt();
    radius * (TAU * unit(random.next_u64())).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::testing::{assert_felt_alike_in_both_solvers, instance};

    fn draw(cv: f64, correlation: f64, count: usize) -> Vec<f64> {
        draw_at(cv, correlation, (0..count).collect())
    }

    fn draw_at(cv: f64, correlation: f64, sleepers: Vec<usize>) -> Vec<f64> {
        let (ballast_cv, railpad_cv, seed) = (cv, cv, 7);
        let variation = SupportVariation { sleepers, ballast_cv, railpad_cv, correlation, seed };
        variation.factors(&mut ChaCha8Rng::seed_from_u64(seed), cv)
    }

    #[test]
    fn the_factors_have_their_mean_scatter_and_correlation() {
        let factors = draw(0.2, 0.7, 40_000);
        let count = factors.len() as f64;
        let mean = factors.iter().sum::<f64>() / count;
        let cv = (factors.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / count).sqrt() / mean;
        let product = |pair: &[f64]| (pair[0] - mean) * (pair[1] - mean);
        let shared = factors.windows(2).map(product).sum::<f64>() / (count - 1.0);
        // Some 7000 independent draws: 0.0024 is one standard error of mean and scatter.
        assert!((mean - 1.0).abs() < 0.01, "{mean}");
        assert!((cv - 0.2).abs() < 0.01, "{cv}");
        // The logarithm makes 0.7 into 0.695.
        assert!((shared / (mean * cv).powi(2) - 0.7).abs() < 0.03);
    }

    #[test]
    fn sleepers_far_apart_have_nothing_in_common() {
        let every_tenth = draw_at(0.2, 0.7, (0..20_000).map(|number| 10 * number).collect());
        let shared: f64 =
            every_tenth.windows(2).map(|pair| (pair[0] - 1.0) * (pair[1] - 1.0)).sum();
        // 0.7^10 is 0.03; 0.007 is one standard error.
        assert!((shared / 20_000.0 / 0.04).abs() < 0.06, "{shared}");
    }

    #[test]
    fn without_scatter_nothing_changes() {
        assert_eq!(draw(0.0, 0.7, 5), [1.0; 5]);
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let variation = instance("support_variation").with("ballast_cv", 0.3);
        assert_felt_alike_in_both_solvers(&variation.with("railpad_cv", 0.3));
    }
}
