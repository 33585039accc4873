//! Rows of a comparison: one per statement of the paper, and one per check of this program.

use crate::{Figure, Picture};
use serde::Serialize;

/// The format of `reproduce.json`.
pub const FORMAT: &str = "reproduction/1";

/// Verdict on a statement of the paper, or on a check of this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ClaimVerdict {
    /// Within the stated tolerance.
    Reproduced,
    /// Beyond it.
    Differs,
    /// Undecided, because of chance or of information missing in the paper.
    CannotTell,
    /// A check of this program: within the stated tolerance.
    Holds,
    /// A check of this program: beyond it.
    Fails,
    /// A check of this program: undecided because of chance.
    Undecided,
}

impl ClaimVerdict {
    /// `yes` is reproduced, else it differs.
    pub(crate) const fn of(yes: bool) -> Self {
        if yes { Self::Reproduced } else { Self::Differs }
    }

    /// The same verdict as that on a check of this program.
    const fn on_check(self) -> Self {
        match self {
            Self::Reproduced | Self::Holds => Self::Holds,
            Self::Differs | Self::Fails => Self::Fails,
            Self::CannotTell | Self::Undecided => Self::Undecided,
        }
    }

    /// Whether this is a verdict on a check of this program, not on a statement of the paper.
    pub const fn is_of_check(self) -> bool {
        matches!(self, Self::Holds | Self::Fails | Self::Undecided)
    }

    /// Text of the verdict for readers.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Differs => "differs",
            Self::CannotTell => "cannot tell",
            Self::Holds => "holds",
            Self::Fails => "fails",
            Self::Undecided => "undecided",
        }
    }
}

/// A statement of the paper compared with the result of this program, or a check of this program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ClaimRow {
    /// Figure that the row belongs to.
    pub figure: Figure,
    /// Statement of the paper, or what is checked.
    pub claim: String,
    /// Number or finding of the paper; of a check what is expected.
    pub paper: String,
    /// Number or finding of this program.
    pub ours: String,
    /// Verdict of the comparison.
    pub verdict: ClaimVerdict,
    /// Tolerance, and the reason for a difference if it is known.
    pub why: String,
}

/// Rows and pictures of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The figure.
    pub figure: Figure,
    /// The rows.
    pub rows: Vec<ClaimRow>,
    /// Pictures of the results of this program, drawn like those of the paper.
    pub pictures: Vec<Picture>,
    /// Caption of the pictures.
    pub caption: String,
}

impl Compared {
    pub(crate) fn new(figure: Figure, caption: &str) -> Self {
        Self { figure, rows: Vec::new(), pictures: Vec::new(), caption: caption.to_owned() }
    }

    /// Adds the row of a statement of the paper.
    pub(crate) fn row(
        &mut self,
        claim: impl Into<String>,
        [paper, ours]: [String; 2],
        verdict: ClaimVerdict,
        why: impl Into<String>,
    ) {
        let (figure, claim, why) = (self.figure, claim.into(), why.into());
        self.rows.push(ClaimRow { figure, claim, paper, ours, verdict, why });
    }

    /// Adds the row of a check of this program: of its own inputs, against the truth, or of what no
    /// statement of the paper says.
    pub(crate) fn check(
        &mut self,
        what: impl Into<String>,
        [expected, ours]: [String; 2],
        verdict: ClaimVerdict,
        why: impl Into<String>,
    ) {
        self.row(what, [expected, ours], verdict.on_check(), why);
    }
}

/// Provenance of the comparison.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// Version of this program.
    pub code_version: &'static str,
    /// The campaign.
    pub campaign: String,
    /// Digest of the results of the campaign.
    pub library_digest: String,
    /// Number of finished cases of the campaign.
    pub library_entries: usize,
}

/// Comparison of the results of the paper with those of this program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reproduction {
    /// [`FORMAT`].
    pub format: &'static str,
    /// Provenance of the results of this program.
    #[serde(flatten)]
    pub provenance: Provenance,
    /// All rows, in the order of the paper.
    pub rows: Vec<ClaimRow>,
    /// The figures with their pictures, for a page.
    #[serde(skip)]
    pub figures: Vec<Compared>,
}

impl Reproduction {
    /// All rows of these figures.
    pub fn new(provenance: Provenance, figures: Vec<Compared>) -> Self {
        let rows = figures.iter().flat_map(|figure| figure.rows.iter().cloned()).collect();
        Self { format: FORMAT, provenance, rows, figures }
    }

    /// Number of rows with this verdict.
    pub fn count(&self, verdict: ClaimVerdict) -> usize {
        self.rows.iter().filter(|row| row.verdict == verdict).count()
    }

    /// Number of checks of this program; the other rows are statements of the paper.
    pub fn checks(&self) -> usize {
        self.rows.iter().filter(|row| row.verdict.is_of_check()).count()
    }

    /// The record as the text of `reproduce.json`.
    pub fn json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("rows of text become JSON");
        format!("{text}\n")
    }
}

#[cfg(test)]
mod tests {
    use super::ClaimVerdict::{CannotTell, Differs, Fails, Holds, Reproduced, Undecided};
    use super::*;

    #[test]
    fn checks_of_the_program_are_counted_apart_from_statements_of_the_paper() {
        let mut compared = Compared::new(Figure::Fig19, "");
        let texts = || [String::new(), String::new()];
        for verdict in [Reproduced, Differs, CannotTell] {
            compared.row("statement", texts(), verdict, "");
            compared.check("check", texts(), verdict, "");
        }
        compared.check("check", texts(), Reproduced, "");
        let provenance = Provenance {
            code_version: "0",
            campaign: String::new(),
            library_digest: String::new(),
            library_entries: 0,
        };
        let all = Reproduction::new(provenance, vec![compared]);
        assert_eq!((all.rows.len(), all.checks()), (7, 4));
        let counts = [Reproduced, Differs, CannotTell, Holds, Fails, Undecided];
        assert_eq!(counts.map(|verdict| all.count(verdict)), [1, 1, 1, 2, 1, 1]);
        assert!(all.json().contains(r#""verdict": "holds""#), "{}", all.json());
    }
}
