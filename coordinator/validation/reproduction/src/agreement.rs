//! Agreement of estimates with the truth, relative to their stated uncertainty.

use crate::average::DEVIATIONS;
use crate::picture::{Picture, Scale, Style};
use crate::{ClaimVerdict, Compared, EvaluatedExample};
use tracktwin_parameters::Parameter;

/// Share of a normal distribution beyond [`DEVIATIONS`] standard deviations.
const BEYOND: f64 = 0.045_500_26;

/// More than the allowed number lie beyond by chance in no more than this share of trials.
const CHANCE: f64 = 0.05;

/// Standard deviation of a parameter of which only the range is known, as a share of it.
const UNKNOWN: f64 = 0.288_675;

/// Largest standard deviation, as a share of the range, of estimates that can count as correct: half
/// that of a uniform distribution over the range. Less certain estimates would agree with any truth.
pub const SURE: f64 = 0.5 * UNKNOWN;

/// Estimates beside the truth.
pub(crate) struct Agreement {
    /// Estimates beyond two of their own standard deviations.
    outside: usize,
    /// All of them.
    total: usize,
    /// How many may lie beyond by chance. The errors of the sleepers of an example count as one.
    allowed: usize,
    /// Mean absolute error, as a share of the range.
    error: f64,
    /// Mean standard deviation, as a share of the range.
    sd: f64,
}

impl Agreement {
    /// Of a parameter at these sleepers, counted from 1, of all examples.
    pub(crate) fn new(told: &[EvaluatedExample], sleepers: &[usize], parameter: Parameter) -> Self {
        let [low, high] = parameter.range();
        let pairs = told.iter().flat_map(|of| sleepers.iter().map(move |&at| (of, at)));
        let pairs: Vec<_> =
            pairs.map(|(of, at)| (of.truth(at, parameter), of.estimate(at, parameter))).collect();
        let n = pairs.len() as f64 * (high - low);
        let beyond =
            pairs.iter().filter(|(truth, of)| (of.mean - truth).abs() > DEVIATIONS * of.sd);
        Self {
            outside: beyond.count(),
            total: pairs.len(),
            allowed: allowed(told.len()) * sleepers.len(),
            error: pairs.iter().map(|(truth, of)| (of.mean - truth).abs()).sum::<f64>() / n,
            sd: pairs.iter().map(|(_, of)| of.sd).sum::<f64>() / n,
        }
    }

    /// Adds the row of this claim.
    pub(crate) fn row(&self, compared: &mut Compared, claim: String, paper: &str) {
        let inside = self.total - self.outside;
        let ours = format!(
            "{inside} of {} within two standard deviations; mean error {:.1} %, mean standard \
             deviation {:.1} % of the range",
            self.total,
            100.0 * self.error,
            100.0 * self.sd
        );
        let why = format!(
            "the sleepers of an example share their error: chance alone leaves more than {} of {} \
             outside once in twenty times at most; estimates less sure than {:.0} % of the range, \
             half of what knowing the range alone gives, agree with anything",
            self.allowed,
            self.total,
            100.0 * SURE
        );
        let verdict = if self.outside > self.allowed {
            ClaimVerdict::Differs
        } else if self.sd > SURE {
            ClaimVerdict::CannotTell
        } else {
            ClaimVerdict::Reproduced
        };
        compared.row(claim, [paper.to_owned(), ours], verdict, why);
    }
}

/// How many of `total` normal estimates may lie beyond, before chance is no longer the reason.
pub(crate) fn allowed(total: usize) -> usize {
    // Binomial distribution, term by term.
    let n = total as f64;
    let mut term = (1.0 - BEYOND).powf(n);
    let mut sum = term;
    let mut count = 0;
    while 1.0 - sum > CHANCE && count < total {
        let k = count as f64;
        term *= (n - k) / (k + 1.0) * BEYOND / (1.0 - BEYOND);
        sum += term;
        count += 1;
    }
    count
}

/// What values of a parameter are divided by in pictures, and the unit that they have then.
pub(crate) fn unit(parameter: Parameter) -> (f64, String) {
    let divisor = if parameter.range()[1] >= 1e6 { 1e6 } else { 1.0 };
    let unit = if divisor > 1.0 { "MN/m".to_owned() } else { parameter.unit().to_owned() };
    (divisor, unit.replace("1e-4", "10⁻⁴").replace("m2", "m²"))
}

/// Truth and estimates of a parameter along an example.
pub(crate) fn picture(told: &EvaluatedExample, parameter: Parameter) -> Picture {
    let (divisor, unit) = unit(parameter);
    let numbers = 1..=told.sleepers.len();
    let estimates = || numbers.clone().map(|at| (at as f64, told.estimate(at, parameter)));
    let truth =
        numbers.clone().map(|at| (at as f64, told.truth(at, parameter) / divisor)).collect();
    let band = estimates().map(|(_, of)| DEVIATIONS * of.sd / divisor).collect();
    let means = estimates().map(|(at, of)| (at, of.mean / divisor)).collect();
    let y = Scale::linear(format!("{} in {unit}", parameter.symbol()));
    let mut picture = Picture::new(told.example.name.clone(), Scale::linear("sleeper"), y)
        .with("told", Style::Band(band), means)
        .with("true", Style::Truth, truth);
    picture.names = numbers.map(|at| (at as f64, at.to_string())).collect();
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Figure;
    use crate::testing::told;

    #[test]
    fn one_example_of_three_may_lie_outside_and_two_may_not() {
        let row = |biased: usize| {
            let parameter = Parameter::IrregularityLevel;
            let mut told = told(Figure::Fig17, 0.02, |of, at, it| of.sleepers[at - 1][it]);
            for sleeper in told[..biased].iter_mut().flat_map(|of| &mut of.sleepers) {
                sleeper.get_mut(&parameter).unwrap().mean += 1.0;
            }
            let mut compared = Compared::new(Figure::Fig17, "");
            let all: Vec<usize> = (1..=9).collect();
            Agreement::new(&told, &all, parameter).row(&mut compared, String::new(), "");
            compared.rows.remove(0)
        };
        assert_eq!(row(1).verdict, ClaimVerdict::Reproduced);
        assert!(row(1).why.contains("more than 9 of 27"), "{}", row(1).why);
        assert_eq!(row(2).verdict, ClaimVerdict::Differs);
    }

    #[test]
    fn chance_leaves_a_few_outside() {
        // P(X = 0) of 20 is 0.39, up to 1 0.77, up to 2 0.94, up to 3 0.988.
        assert_eq!(allowed(20), 3);
        // P(X = 0) of 3 is 0.87, up to 1 0.994.
        assert_eq!(allowed(3), 1);
        assert_eq!(allowed(1), 0);
        assert_eq!(allowed(0), 0);
    }
}
