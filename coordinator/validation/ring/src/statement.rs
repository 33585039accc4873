//! A statement about the ring: what the paper says, what an evaluation gives, and the verdict.

use crate::Method;
use serde::Serialize;
use tracktwin_reproduction::ClaimVerdict;

/// One statement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Statement {
    /// Figure or section of the paper that it belongs to.
    pub figure: &'static str,
    /// The method whose estimates are judged.
    pub method: &'static str,
    /// The statement.
    pub claim: String,
    /// What the paper says of it, or the truth.
    pub expected: String,
    /// What was found.
    pub found: String,
    /// The tolerance that decides.
    pub tolerance: String,
    /// Whether the statement holds.
    pub verdict: ClaimVerdict,
}

/// What is found of a statement; none where the ring has nothing to decide it by.
pub(crate) struct Found {
    pub(crate) text: String,
    pub(crate) within: bool,
}

impl Found {
    pub(crate) fn new(within: bool, text: impl Into<String>) -> Self {
        Self { text: text.into(), within }
    }
}

impl Statement {
    /// A statement that is decided by `found`.
    pub(crate) fn of(
        (figure, method): (&'static str, Method),
        [claim, expected, tolerance]: [&str; 3],
        found: Option<Found>,
    ) -> Self {
        let verdict = match &found {
            None => ClaimVerdict::CannotTell,
            Some(Found { within: true, .. }) => ClaimVerdict::Reproduced,
            Some(_) => ClaimVerdict::Differs,
        };
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

/// A share in per cent, `87 %`.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}
