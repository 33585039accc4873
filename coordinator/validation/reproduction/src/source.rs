//! What each figure is drawn from, and by what.

use crate::compared_regressions::compared_regressions;
use crate::error::Error;
use crate::example::EvaluatedExample;
use crate::figure::Figure;
use crate::local_change::local_change;
use crate::one_parameter::{bending_stiffness, irregularity};
use crate::receptance::{hammer_tests, receptance};
use crate::row::Compared;
use crate::selector::selector;
use crate::sensitivity::sensitivity;
use crate::speed::speed;
use crate::step::step;
use crate::test_errors::test_errors;
use tracktwin_parameters::TrackDesign;
use tracktwin_surrogate::{Tested, Trained, TrainingSet};

/// What a figure is drawn from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// The track and the results of a library.
    Results(fn(&Results<'_>) -> Result<Compared, Error>),
    /// Trained models and the results that none of them has seen.
    Models(fn(&Predictions<'_>) -> Result<Compared, Error>),
    /// What trained models say of simulated passes.
    Examples(fn(&[EvaluatedExample]) -> Compared),
}

/// A library's results, and how they were made.
#[derive(Debug)]
pub struct Results<'a> {
    /// Rail, sleepers, wheel.
    pub design: &'a TrackDesign,
    /// Centre of the wavelet in rad.
    pub wavelet_centre_rad: f64,
    /// The results.
    pub set: &'a TrainingSet,
    /// Decides which half of them is searched.
    pub seed: u64,
}

/// Trained models, and what they predict for cases that none of them has seen.
pub struct Predictions<'a> {
    /// The results that the models were trained and tested on.
    pub results: &'a Results<'a>,
    /// The models.
    pub models: &'a Trained,
    /// True and predicted values by the global feature at 13 km/h, each in the parameter's unit.
    pub tested: &'a [Tested],
}

impl Figure {
    /// What it is drawn from.
    pub const fn source(self) -> Source {
        match self {
            Self::Fig9 => Source::Results(|of| Ok(receptance(&hammer_tests(of.design)?))),
            Self::Fig10 => Source::Results(|of| speed(of.set, of.wavelet_centre_rad)),
            Self::Fig12 => Source::Results(|of| sensitivity(of.set)),
            Self::Fig13 => Source::Results(|of| selector(of.set, of.seed)),
            Self::Fig14 => Source::Models(|of| test_errors(of.models, of.tested)),
            Self::Fig16 => Source::Examples(step),
            Self::Fig17 => Source::Examples(irregularity),
            Self::Fig18 => Source::Examples(bending_stiffness),
            Self::Fig19 => Source::Examples(local_change),
            Self::Fig25 => Source::Models(|of| compared_regressions(of.results, of.models)),
        }
    }

    /// Whether it asks trained models.
    pub const fn needs_models(self) -> bool {
        matches!(self.source(), Source::Models(_) | Source::Examples(_))
    }

    /// Whether it is one of the numerical examples, whose passes are simulated.
    pub const fn is_example(self) -> bool {
        matches!(self.source(), Source::Examples(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example::examples;

    #[test]
    fn figures_that_are_drawn_from_examples_are_those_that_have_some() {
        for figure in Figure::ALL {
            assert_eq!(examples(figure).is_empty(), !figure.is_example(), "{figure}");
        }
    }
}
