//! Rows of a comparison, one per claim.

use crate::{Figure, Picture};
use serde::Serialize;

/// The format of `reproduce.json`.
pub const FORMAT: &str = "reproduction/1";

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ClaimVerdict {
    /// Within the stated tolerance.
    Reproduced,
    /// Beyond it.
    Differs,
    /// Undecided, because of chance or of information missing in the paper.
    CannotTell,
}

impl ClaimVerdict {
    /// `yes` is reproduced, else it differs.
    pub(crate) const fn of(yes: bool) -> Self {
        if yes { Self::Reproduced } else { Self::Differs }
    }

    /// Text of the verdict for readers.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Differs => "differs",
            Self::CannotTell => "cannot tell",
        }
    }
}

/// A claim of the paper, compared with the result of this program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ClaimRow {
    /// Figure that the claim belongs to.
    pub figure: Figure,
    /// Statement of the paper.
    pub claim: String,
    /// Number or finding of the paper.
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
    /// One row per claim.
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

    /// Adds the row of a claim.
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
    /// One row per claim, in the order of the paper.
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

    /// The record as the text of `reproduce.json`.
    pub fn json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("rows of text become JSON");
        format!("{text}\n")
    }
}
