//! From a library and models to the paper's figures: asks the models.

use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::train;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::TrackDesign;
use tracktwin_reproduction::{
    Compared, EXAMPLE_SPANS, Error, EvaluatedExample, Figure, Predictions, RecordedExample,
    Results, SPEED_KM_H, Source,
};
use tracktwin_signal::FeatureSet;
use tracktwin_surrogate::{Tested, Trained, TrainingSet};

/// Why a figure can't be reproduced.
#[derive(Debug, thiserror::Error)]
pub enum ReproducingError {
    /// The library or the models lack something.
    #[error(transparent)]
    Figure(#[from] Error),
    /// The campaign's track is not the paper's.
    #[error(
        "the paper's figures are of V-Track, but the campaign's track has another design: use a \
             library of the built-in campaign"
    )]
    OtherTrack,
    /// The track of the campaign is too short for the examples.
    #[error(
        "the examples need {needed} spans, but the campaign's track has {spans}: use a \
             library of the built-in campaign, or omit fig2, fig3 and fig15 to fig19"
    )]
    TooShort {
        /// Spans of the campaign's track.
        spans: usize,
        /// How many it takes.
        needed: usize,
    },
    /// An example can't be evaluated.
    #[error(transparent)]
    Evaluation(#[from] tracktwin_evaluation::Error),
    /// Models and library don't fit.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
}

/// Refuses a campaign on another track than the paper's.
///
/// # Errors
/// [`ReproducingError::OtherTrack`] or [`ReproducingError::TooShort`].
pub fn check(experiment: &Experiment, figures: &[Figure]) -> Result<(), ReproducingError> {
    if experiment.design != TrackDesign::v_track() {
        return Err(ReproducingError::OtherTrack);
    }
    let (spans, needed) = (experiment.spans, EXAMPLE_SPANS);
    if spans < needed && figures.iter().any(|figure| figure.needs_example_track()) {
        return Err(ReproducingError::TooShort { spans, needed });
    }
    Ok(())
}

/// A figure beside the paper's; none where it asks models and there are none.
///
/// # Errors
/// [`ReproducingError`].
pub fn compared(
    figure: Figure,
    results: &Results<'_>,
    evaluator: Option<&Evaluator>,
    recordings: Vec<RecordedExample>,
) -> Result<Option<Compared>, ReproducingError> {
    Ok(match (figure.source(), evaluator) {
        (Source::Results(compare), _) => Some(compare(results)?),
        (Source::Passes(compare), _) => Some(compare(results.experiment, &recordings)?),
        (Source::Models(_) | Source::Examples(_), None) => None,
        (Source::Models(compare), Some(evaluator)) => {
            let models = evaluator.models();
            let tested = &tested(results.set, models)?;
            Some(compare(&Predictions { results, models, tested })?)
        }
        (Source::Examples(compare), Some(evaluator)) => {
            Some(compare(&evaluated(evaluator, recordings)?))
        }
    })
}

/// True and predicted values by the global feature at the paper's speed; none without its models.
fn tested(set: &TrainingSet, models: &Trained) -> Result<Vec<Tested>, ReproducingError> {
    let single = models.group(&[SPEED_KM_H], FeatureSet::Gf.name());
    let tested = single.map(|group| train::tested_by(set, models, group)).transpose()?;
    Ok(tested.unwrap_or_default())
}

/// Evaluations of the examples' recordings.
fn evaluated(
    evaluator: &Evaluator,
    recordings: Vec<RecordedExample>,
) -> Result<Vec<EvaluatedExample>, ReproducingError> {
    let told = |(example, recording)| {
        Ok(EvaluatedExample::new(example, &evaluator.evaluate(&recording)?)?)
    };
    recordings.into_iter().map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_track_and_one_that_is_too_short_are_refused() {
        let other = Experiment::new(TrackDesign::v_track().enlarged(5.0));
        assert!(matches!(check(&other, &[]), Err(ReproducingError::OtherTrack)));
        let short = Experiment { spans: 22, ..Experiment::new(TrackDesign::v_track()) };
        assert!(check(&short, &[Figure::Fig12]).is_ok());
        let message = check(&short, &[Figure::Fig16]).unwrap_err().to_string();
        assert!(message.contains("24 spans"), "{message}");
    }
}
