//! The figures of the paper that are reproduced.

use serde::{Serialize, Serializer};
use std::str::FromStr;

/// A figure of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Figure {
    /// A stretch of acceleration with its CWT and SSWT.
    Fig2,
    /// LWPS at six sleepers.
    Fig3,
    /// Power spectral density of the irregularity.
    Fig8,
    /// Receptance of the nominal track.
    Fig9,
    /// LWPS at several speeds.
    Fig10,
    /// Best matches of the model selector.
    Fig11,
    /// Sensitivity of the LWPS to each parameter.
    Fig12,
    /// Error of the model selector by size of the library.
    Fig13,
    /// Errors of the models on the test half.
    Fig14,
    /// The tracks of the numerical examples.
    Fig15,
    /// Numerical example: a step in railpad and ballast.
    Fig16,
    /// Numerical example: levels of irregularity.
    Fig17,
    /// Numerical example: bending stiffness of the sleepers.
    Fig18,
    /// Numerical example: stiffness reduced at one, three and five sleepers.
    Fig19,
    /// Comparison of Gaussian processes with other regressions.
    Fig25,
}

impl Figure {
    /// All figures, in the order of the paper.
    pub const ALL: [Self; 15] = [
        Self::Fig2,
        Self::Fig3,
        Self::Fig8,
        Self::Fig9,
        Self::Fig10,
        Self::Fig11,
        Self::Fig12,
        Self::Fig13,
        Self::Fig14,
        Self::Fig15,
        Self::Fig16,
        Self::Fig17,
        Self::Fig18,
        Self::Fig19,
        Self::Fig25,
    ];

    /// Name of the figure in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fig2 => "fig2",
            Self::Fig3 => "fig3",
            Self::Fig8 => "fig8",
            Self::Fig9 => "fig9",
            Self::Fig10 => "fig10",
            Self::Fig11 => "fig11",
            Self::Fig12 => "fig12",
            Self::Fig13 => "fig13",
            Self::Fig14 => "fig14",
            Self::Fig15 => "fig15",
            Self::Fig16 => "fig16",
            Self::Fig17 => "fig17",
            Self::Fig18 => "fig18",
            Self::Fig19 => "fig19",
            Self::Fig25 => "fig25",
        }
    }

    /// Title of the figure.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Fig2 => "Acceleration, CWT and SSWT of five bays",
            Self::Fig3 => "Spectra at six sleepers",
            Self::Fig8 => "Power spectrum of the irregularity",
            Self::Fig9 => "Receptance of the nominal track",
            Self::Fig10 => "Spectra at several speeds",
            Self::Fig11 => "Best matches of the model selector",
            Self::Fig12 => "Sensitivity of the spectra to each parameter",
            Self::Fig13 => "Model selector and the size of the library",
            Self::Fig14 => "Errors of the models on the test half",
            Self::Fig15 => "Tracks of the examples",
            Self::Fig16 => "Example: a step in railpad and ballast",
            Self::Fig17 => "Example: levels of irregularity",
            Self::Fig18 => "Example: bending stiffness of the sleepers",
            Self::Fig19 => "Example: stiffness reduced at a few sleepers",
            Self::Fig25 => "Gaussian processes and other regressions",
        }
    }
}

impl std::fmt::Display for Figure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Figure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|figure| figure.name() == text).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|figure| figure.name()).collect();
            format!("unknown figure `{text}`; known figures: {}", known.join(", "))
        })
    }
}

impl Serialize for Figure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_figure_and_others_to_the_known_ones() {
        for figure in Figure::ALL {
            assert_eq!(figure.name().parse(), Ok(figure));
        }
        let message = "fig20".parse::<Figure>().unwrap_err();
        assert!(message.contains("`fig20`") && message.contains("fig9, fig10"), "{message}");
    }
}
