//! Source of the data of each figure, and the function that compares it.

use crate::best_matches::best_matches;
use crate::compared_regressions::compared_regressions;
use crate::error::Error;
use crate::example::{EvaluatedExample, examples};
use crate::example_track::RecordedExample;
use crate::example_tracks::example_tracks;
use crate::figure::Figure;
use crate::irregularity_spectrum::irregularity_spectrum;
use crate::local_change::local_change;
use crate::local_spectra::local_spectra;
use crate::one_parameter::{bending_stiffness, irregularity};
use crate::receptance::{envelopes, hammer_tests, receptance};
use crate::row::Compared;
use crate::selector::selector;
use crate::sensitivity::sensitivity;
use crate::speed::speed;
use crate::step::step;
use crate::test_errors::test_errors;
use crate::time_frequency::time_frequency;
use tracktwin_experiment::Experiment;
use tracktwin_surrogate::{Tested, Trained, TrainingSet};

/// Source of the data of a figure.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// The experiment and the results of a library.
    Results(fn(&Results<'_>) -> Result<Compared, Error>),
    /// Trained models, and results that were not used for training.
    Models(fn(&Predictions<'_>) -> Result<Compared, Error>),
    /// Simulated passes over examples.
    Passes(fn(&Experiment, &[RecordedExample]) -> Result<Compared, Error>),
    /// Estimates of trained models from simulated passes.
    Examples(fn(&[EvaluatedExample]) -> Compared),
}

/// Results of a library, with their experiment.
#[derive(Debug)]
pub struct Results<'a> {
    /// Track, vehicle and features of the cases.
    pub experiment: &'a Experiment,
    /// The results.
    pub set: &'a TrainingSet,
    /// Seed that selects the half of the results that is searched.
    pub seed: u64,
}

/// Trained models, and their predictions for cases that were not used for training.
pub struct Predictions<'a> {
    /// The results that the models were trained and tested on.
    pub results: &'a Results<'a>,
    /// The models.
    pub models: &'a Trained,
    /// True and predicted values by the global feature at 13 km/h, each in the parameter's unit.
    pub tested: &'a [Tested],
}

impl Figure {
    /// Source of the data of the figure.
    pub const fn source(self) -> Source {
        match self {
            Self::Fig2 => Source::Passes(time_frequency),
            Self::Fig3 => Source::Passes(local_spectra),
            Self::Fig8 => Source::Results(|of| irregularity_spectrum(of.experiment)),
            Self::Fig9 => Source::Results(|of| {
                let design = &of.experiment.design;
                Ok(receptance(&hammer_tests(design)?, &envelopes(design, of.set)?))
            }),
            Self::Fig10 => {
                Source::Results(|of| speed(of.set, of.experiment.features.wavelet_centre_rad))
            }
            Self::Fig11 => Source::Results(|of| best_matches(of.set, of.seed)),
            Self::Fig12 => Source::Results(|of| sensitivity(of.set)),
            Self::Fig13 => Source::Results(|of| selector(of.set, of.seed)),
            Self::Fig14 => Source::Models(|of| test_errors(of.models, of.tested)),
            Self::Fig15 => Source::Results(|of| example_tracks(of.experiment)),
            Self::Fig16 => Source::Examples(step),
            Self::Fig17 => Source::Examples(irregularity),
            Self::Fig18 => Source::Examples(bending_stiffness),
            Self::Fig19 => Source::Examples(local_change),
            Self::Fig25 => Source::Models(|of| compared_regressions(of.results, of.models)),
        }
    }

    /// Whether the figure needs trained models.
    pub const fn needs_models(self) -> bool {
        matches!(self.source(), Source::Models(_) | Source::Examples(_))
    }

    /// Whether the figure needs simulated passes over its own tracks.
    pub fn needs_passes(self) -> bool {
        !examples(self).is_empty()
    }

    /// Whether the track of a campaign must be long enough for an example.
    pub fn needs_example_track(self) -> bool {
        self.needs_passes() || self == Self::Fig15
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_that_are_drawn_from_passes_are_those_that_have_examples() {
        for figure in Figure::ALL {
            let passes = matches!(figure.source(), Source::Passes(_) | Source::Examples(_));
            assert_eq!(passes, figure.needs_passes(), "{figure}");
        }
    }
}
