//! Additional uncertainty from the unevenness of the track.
//!
//! The tracks of the library are even. The Gaussian processes resolve only a part of a sleeper's deviation
//! from its neighbours, and no test on the library shows the rest. The unevenness follows from the
//! variation of the estimated means along the track beyond their standard deviations, and is at least
//! [`LEAST`].

use crate::evaluation::{Estimate, Estimates};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_parameters::Parameter;

/// Smallest unevenness that is assumed for any track.
const LEAST: f64 = 0.05;
/// Largest unevenness that is estimated.
const MOST: f64 = 0.6;
/// Ratio of the standard deviation of the estimated means along a track to that of the true values;
/// measured with `tracktwin coverage` on tracks of 15 and 30 % unevenness (`docs/models.md`).
const SEEN: f64 = 0.4;
/// Share of the variance of the estimates that differs from sleeper to sleeper on an even track; the rest
/// is an error common to the track. Measured with `tracktwin coverage`.
const OWN_SHARE: f64 = 0.5;
/// Share of a sleeper's own deviation that its estimate does not contain; measured with `tracktwin
/// coverage`.
const MISSED: f64 = 0.85;
/// Smallest number of sleepers from which the unevenness is estimated.
const SLEEPERS_MIN: usize = 5;
/// Parameters that differ from sleeper to sleeper.
const OWN: [Parameter; 2] = [Parameter::RailpadStiffness, Parameter::BallastStiffness];

/// Assumed unevenness of the sleepers of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unevenness {
    /// Standard deviation of railpad and ballast stiffness from sleeper to sleeper, divided by the mean.
    pub scatter: f64,
    /// Smallest value of `scatter` that is assumed.
    pub least: f64,
    /// The parameter whose means determined `scatter`; `None` if the minimum was assumed.
    pub learned_from: Option<Parameter>,
}

impl Unevenness {
    /// Estimates the unevenness from the estimates of these sleepers, which must have the standard
    /// deviations of an even track.
    ///
    /// The function uses the parameter with the smallest standard deviations, because this parameter is the
    /// most informative.
    pub(crate) fn of(told: &[&Estimates]) -> Self {
        let learned = OWN
            .into_iter()
            .filter_map(|parameter| {
                let estimates: Vec<Estimate> =
                    told.iter().filter_map(|of| of.get(&parameter)).copied().collect();
                (estimates.len() >= SLEEPERS_MIN).then(|| (parameter, variances(&estimates)))
            })
            .min_by(|(_, a), (_, b)| a.expected.total_cmp(&b.expected));
        let excess = learned.as_ref().map_or(0.0, |(_, of)| of.seen - of.expected).max(0.0);
        let scatter = (LEAST * LEAST + excess / (SEEN * SEEN)).sqrt().min(MOST);
        let learned_from = learned.filter(|_| excess > 0.0).map(|(parameter, _)| parameter);
        Self { scatter, least: LEAST, learned_from }
    }

    /// Widens the standard deviations of the parameters that differ from sleeper to sleeper, and returns
    /// the standard deviations of an even track.
    pub(crate) fn widen(&self, estimates: &mut Estimates) -> BTreeMap<Parameter, f64> {
        let even =
            estimates.iter().map(|(&parameter, estimate)| (parameter, estimate.sd)).collect();
        for parameter in OWN {
            if let Some(estimate) = estimates.get_mut(&parameter) {
                estimate.sd = estimate.sd.hypot(MISSED * self.scatter * estimate.mean);
            }
        }
        even
    }

    /// The assumption as a sentence.
    pub fn sentence(&self) -> String {
        let how = if self.learned_from.is_some() {
            "from the estimates along the track"
        } else {
            "the minimum: this recording shows no more"
        };
        format!(
            "The assumed unevenness of railpads and ballast is {:.0} % ({how}); the standard \
                 deviations of k_p and k_b include it, because an estimate resolves little of a \
                 single sleeper's deviation.",
            100.0 * self.scatter
        )
    }
}

/// Variances of the logarithm along a track.
struct Variances {
    /// Variance of the estimated means.
    seen: f64,
    /// Variance of the means expected for an even track, from the standard deviations of the estimates.
    expected: f64,
}

fn variances(estimates: &[Estimate]) -> Variances {
    let n = estimates.len() as f64;
    let middle = estimates.iter().map(|of| of.mean.ln()).sum::<f64>() / n;
    let squares: f64 = estimates.iter().map(|of| (of.mean.ln() - middle).powi(2)).sum();
    let variance = estimates.iter().map(|of| (of.sd / of.mean).powi(2)).sum::<f64>() / n;
    let expected = OWN_SHARE * variance;
    Variances { seen: squares / (n - 1.0), expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ballast stiffness whose means vary by `scatter`, each with a standard deviation of 4 %.
    fn along(scatter: f64) -> Vec<Estimates> {
        let mean = |sleeper: u32| 1e7 * (scatter * 2f64.sqrt() * f64::from(sleeper).cos()).exp();
        let estimate = |mean: f64| Estimate { mean, sd: 0.04 * mean };
        (0..40).map(|n| [(Parameter::BallastStiffness, estimate(mean(n)))].into()).collect()
    }

    fn told(estimates: &[Estimates]) -> Vec<&Estimates> {
        estimates.iter().collect()
    }

    #[test]
    fn means_that_vary_no_more_than_their_sd_tell_of_the_least_scatter() {
        let even = Unevenness::of(&told(&along(0.02)));
        assert_eq!(even, Unevenness { scatter: LEAST, least: LEAST, learned_from: None });
        assert_eq!(Unevenness::of(&told(&along(0.3)[..4])).scatter, LEAST);
    }

    #[test]
    fn means_that_vary_more_tell_of_more_scatter() {
        let uneven = Unevenness::of(&told(&along(0.12)));
        let expected = 0.12f64.powi(2) - OWN_SHARE * 0.04f64.powi(2);
        let expected = (LEAST.powi(2) + expected / SEEN.powi(2)).sqrt();
        // The cosine's mean square over forty sleepers is a half within 2 %.
        assert!((uneven.scatter / expected - 1.0).abs() < 0.03, "{uneven:?}");
        assert_eq!(uneven.learned_from, Some(Parameter::BallastStiffness));
    }

    #[test]
    fn only_what_differs_from_sleeper_to_sleeper_is_widened() {
        let mut estimates = along(0.0)[0].clone();
        estimates.insert(Parameter::IrregularityLevel, Estimate { mean: 3.0, sd: 0.2 });
        let unevenness = Unevenness { scatter: 0.1, least: LEAST, learned_from: None };
        let even = unevenness.widen(&mut estimates);
        assert_eq!(even[&Parameter::BallastStiffness], 0.04e7);
        let wide = estimates[&Parameter::BallastStiffness].sd;
        assert!((wide - 1e7 * 0.04f64.hypot(MISSED * 0.1)).abs() < 1.0);
        assert_eq!(estimates[&Parameter::IrregularityLevel].sd, 0.2);
    }
}
