//! Computes the figures of the paper from a library and models.

use crate::pipeline::compute::compute;
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::invert::{InvertingError, invert};
use crate::pipeline::train;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::{Preset, TrackDesign};
use tracktwin_reproduction::{
    Compared, EXAMPLE_SPANS, Error, EvaluatedExample, Figure, Predictions, RecordedExample,
    Results, SPEED_KM_H, Source,
};
use tracktwin_signal::FeatureSet;
use tracktwin_surrogate::{Tested, Trained, TrainingSet};

/// Reasons for not reproducing a figure.
#[derive(Debug, thiserror::Error)]
pub enum ReproducingError {
    /// The library or the models lack required data.
    #[error(transparent)]
    Figure(#[from] Error),
    /// The track of the campaign is not V-Track, the track of the paper.
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
        /// Number of spans of the campaign's track.
        spans: usize,
        /// Required number of spans.
        needed: usize,
    },
    /// The recording of an example cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] tracktwin_evaluation::Error),
    /// The recording of an example cannot be evaluated by inversion.
    #[error(transparent)]
    Inversion(#[from] InvertingError),
    /// The models do not belong to the library.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
}

/// Checks that the campaign's track is that of the paper and long enough for these figures.
///
/// # Errors
/// Returns [`ReproducingError::OtherTrack`] or [`ReproducingError::TooShort`].
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

/// Computes a figure and compares it with the paper. Returns `None` if the figure needs models and
/// `evaluator` is `None`.
///
/// # Errors
/// Returns [`ReproducingError`] if data are missing or an example cannot be evaluated.
pub async fn compared(
    figure: Figure,
    results: &Results<'_>,
    evaluator: Option<&Evaluator>,
    recordings: Vec<RecordedExample>,
) -> Result<Option<Compared>, ReproducingError> {
    Ok(match (figure.source(), evaluator) {
        (Source::Results(compare), _) => Some(compute(|| compare(results))?),
        (Source::Passes(compare), _) => Some(compute(|| compare(results.experiment, &recordings))?),
        (Source::Models(_) | Source::Examples(_), None) => None,
        (Source::Models(compare), Some(evaluator)) => {
            let models = evaluator.models();
            Some(compute(|| {
                let tested = &tested(results.set, models)?;
                Ok::<_, ReproducingError>(compare(&Predictions { results, models, tested })?)
            })?)
        }
        (Source::Examples(compare), Some(evaluator)) => {
            Some(compare(&evaluated(figure, evaluator, recordings).await?))
        }
    })
}

/// True and predicted values for the global feature at the speed of the paper; empty if there is no such
/// model.
fn tested(set: &TrainingSet, models: &Trained) -> Result<Vec<Tested>, ReproducingError> {
    let single = models.group(&[SPEED_KM_H], FeatureSet::Gf.name());
    let tested = single.map(|group| train::tested_by(set, models, group)).transpose()?;
    Ok(tested.unwrap_or_default())
}

/// Evaluates the recordings of the examples of a figure, with models and, for local changes, by inversion
/// too.
async fn evaluated(
    figure: Figure,
    evaluator: &Evaluator,
    recordings: Vec<RecordedExample>,
) -> Result<Vec<EvaluatedExample>, ReproducingError> {
    let track = Preset::VTrack.track();
    let mut all = Vec::with_capacity(recordings.len());
    for (example, recording) in recordings {
        let evaluation = compute(|| evaluator.evaluate(&recording))?;
        let mut evaluated = EvaluatedExample::new(example, &evaluation)?;
        if figure == Figure::Fig19 {
            let inversion = invert(&recording, &track, None, None, &|_, _| ()).await?;
            let found = inversion.sleepers.iter().map(|it| (&*it.id, &it.estimates));
            evaluated = evaluated.with_inversion(found)?;
        }
        all.push(evaluated);
    }
    Ok(all)
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
