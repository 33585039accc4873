//! A statement about the ring: finding of the paper, finding of an evaluation, and verdict.

use crate::Method;
use crate::estimates::median;
use serde::Serialize;
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;
use tracktwin_reproduction::{ClaimVerdict, SURE};

/// One statement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Statement {
    /// Figure or section of the paper that it belongs to.
    pub figure: &'static str,
    /// The method whose estimates are compared.
    pub method: &'static str,
    /// The statement.
    pub claim: String,
    /// Finding of the paper, or the truth.
    pub expected: String,
    /// Finding of the evaluation.
    pub found: String,
    /// Tolerance of the verdict.
    pub tolerance: String,
    /// Whether the statement holds.
    pub verdict: ClaimVerdict,
}

/// What is found of a statement; none where the ring has nothing to decide it by.
pub(crate) struct Found {
    text: String,
    verdict: ClaimVerdict,
}

impl Found {
    pub(crate) fn new(within: bool, text: impl Into<String>) -> Self {
        let verdict = if within { ClaimVerdict::Reproduced } else { ClaimVerdict::Differs };
        Self { text: text.into(), verdict }
    }

    /// A finding that does not decide the statement.
    pub(crate) fn undecided(text: impl Into<String>) -> Self {
        Self { text: text.into(), verdict: ClaimVerdict::CannotTell }
    }

    /// The same, undecided where estimates agree that are not sure; `sds` are their standard
    /// deviations as shares of the parameter's range.
    pub(crate) fn if_sure(mut self, sds: impl IntoIterator<Item = f64>) -> Self {
        if let Some(sd) = median(sds)
            && sd > SURE
            && self.verdict == ClaimVerdict::Reproduced
        {
            self.verdict = ClaimVerdict::CannotTell;
            let (text, sd) = (self.text, rounded(sd, 2));
            self.text =
                format!("{text}; median standard deviation {sd} of the range, too wide to decide");
        }
        self
    }
}

impl Statement {
    /// A statement that is decided by `found`.
    pub(crate) fn of(
        (figure, method): (&'static str, Method),
        [claim, expected, tolerance]: [&str; 3],
        found: Option<Found>,
    ) -> Self {
        let verdict = found.as_ref().map_or(ClaimVerdict::CannotTell, |found| found.verdict);
        let nothing = || "nothing here to decide it by".to_owned();
        Self {
            figure,
            method: method.label(),
            claim: claim.to_owned(),
            expected: expected.to_owned(),
            found: found.map_or_else(nothing, |found| found.text),
            tolerance: tolerance.to_owned(),
            verdict,
        }
    }
}

/// A statement for each of some parameters; `claim` gets the parameter's label.
pub(crate) fn each(
    source: (&'static str, Method),
    parameters: &[Parameter],
    claim: impl Fn(&str) -> String,
    [expected, tolerance]: [&str; 2],
    found: impl Fn(Parameter) -> Option<Found>,
) -> Vec<Statement> {
    let of = |&parameter: &Parameter| {
        let claim = claim(parameter.label());
        Statement::of(source, [&claim, expected, tolerance], found(parameter))
    };
    parameters.iter().map(of).collect()
}

/// A tolerance together with the limit of [`Found::if_sure`].
pub(crate) fn sure(tolerance: &str) -> String {
    format!(
        "{tolerance}; undecided if the median standard deviation is above {} of the range",
        percent(SURE)
    )
}

/// A share in per cent, `87 %`.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_that_are_not_sure_cannot_agree_but_can_differ() {
        let verdict = |within: bool, sd: f64| Found::new(within, "80 %").if_sure([sd]).verdict;
        assert_eq!(verdict(true, 0.1), ClaimVerdict::Reproduced);
        assert_eq!(verdict(true, 0.2), ClaimVerdict::CannotTell);
        assert_eq!(verdict(false, 0.2), ClaimVerdict::Differs);
    }
}
