//! Creates an evaluator of recordings from models and their library.

use crate::pipeline;
use crate::pipeline::train::TrainingError;
use tracktwin_evaluation::{BySpeeds, Error, Evaluation, Stream, Twin};
use tracktwin_experiment::{Experiment, MODEL_HASH};
use tracktwin_library::{Library, LibraryError};
use tracktwin_parameters::{DesignAxis, ParameterSet, TrackDesign};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureError};
use tracktwin_surrogate::{Trained, TrainingSet};

/// Surrogates and model selector of one library. It can evaluate any number of recordings.
pub struct Evaluator {
    /// Computes the features on which the models were trained.
    pub extractor: Extractor,
    models: Trained,
    set: TrainingSet,
    by_speeds: BySpeeds,
    experiment: Experiment,
    fixed: ParameterSet,
    other_model: Option<String>,
}

/// Design of the track of an experiment that is most similar to that of a recording: varied numbers have the
/// value that the recording states, if it lies in their range.
pub fn design_for(experiment: &Experiment, recording: &Recording) -> TrackDesign {
    experiment.design_like(&recording.stated_track().track.design)
}

/// Reasons for not creating an evaluator.
#[derive(Debug, thiserror::Error)]
pub enum EvaluatorError {
    /// The library does not contain the data on which the models were trained.
    #[error(
        "the models belong to another library; give their library, or train models on this one"
    )]
    Foreign(#[source] LibraryError),
    /// The features are defined by another version of the program.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] TrainingError),
}

impl Evaluator {
    /// Creates an evaluator. Reads from the library the data on which the models were trained.
    ///
    /// # Errors
    /// Returns [`EvaluatorError`] if the models do not belong to the library, or the library cannot be
    /// read.
    pub async fn new(models: Trained, library: &Library) -> Result<Self, EvaluatorError> {
        let campaign = library.campaign(models.campaign()).await.map_err(no_campaign)?;
        let used_hz = models.frequencies_hz();
        let set = pipeline::train::set(library, &campaign, used_hz.last().copied()).await?;
        let experiment = pipeline::train::experiment(&campaign)?;
        let features = &experiment.features;
        let extractor = match used_hz.last() {
            Some(&highest_hz) if used_hz.len() < features.frequencies_hz().len() => {
                Extractor::up_to(features, highest_hz)?
            }
            _ => Extractor::new(features)?,
        };
        let fixed = pipeline::train::fixed(&campaign)?;
        let other_model = other_model(library.check_model(&campaign.id, MODEL_HASH).await)?;
        let by_speeds = BySpeeds::default();
        Ok(Self { extractor, models, set, by_speeds, experiment, fixed, other_model })
    }

    /// The trained models.
    pub const fn models(&self) -> &Trained {
        &self.models
    }

    /// The results on which the models were trained and tested.
    pub const fn set(&self) -> &TrainingSet {
        &self.set
    }

    /// Design of the track in the models' campaign. Varied numbers have the value of the campaign's
    /// description.
    pub const fn design(&self) -> &TrackDesign {
        &self.experiment.design
    }

    /// Design of the track in the models' campaign that is most similar to that of a recording.
    pub fn design_for(&self, recording: &Recording) -> TrackDesign {
        design_for(&self.experiment, recording)
    }

    /// What the library limits: its cases are those of another version of the physics, or differ in numbers of the
    /// description.
    pub fn notes(&self) -> Vec<String> {
        self.other_model.iter().cloned().chain(self.varied_design()).collect()
    }

    /// The numbers of the description that differ in the library, as a note. `None` if there are none.
    fn varied_design(&self) -> Option<String> {
        let range = |axis: &DesignAxis| {
            let DesignAxis { number, low, high, .. } = axis;
            format!("{} {low} to {high} {}", number.key(), number.unit()).trim_end().to_owned()
        };
        let ranges: Vec<_> = self.experiment.design_axes.iter().map(range).collect();
        (!ranges.is_empty()).then(|| {
            format!(
                "the models were trained on cases that differ in these numbers of the description; their intervals \
                 contain this uncertainty: {}",
                ranges.join(", ")
            )
        })
    }

    /// Experiment of the campaign's cases.
    pub const fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// Values of the parameters that the campaign does not vary.
    pub const fn fixed(&self) -> &ParameterSet {
        &self.fixed
    }

    /// Evaluates a recording with models and model selector.
    ///
    /// # Errors
    /// The errors of [`tracktwin_evaluation::evaluate`].
    pub fn evaluate(&self, recording: &Recording) -> Result<Evaluation, Error> {
        tracktwin_evaluation::evaluate(recording, &self.twin())
    }

    /// Starts an evaluation of samples while they are recorded, with models and model selector.
    ///
    /// # Errors
    /// The errors of [`Stream::new`].
    pub fn stream<'a>(&'a self, section: &'a Recording) -> Result<Stream<'a>, Error> {
        Stream::new(section, self.twin())
    }

    const fn twin(&self) -> Twin<'_> {
        Twin {
            extractor: &self.extractor,
            models: &self.models,
            library: &self.set,
            by_speeds: &self.by_speeds,
        }
    }
}

impl std::fmt::Debug for Evaluator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Evaluator")
            .field("campaign", &self.models.campaign())
            .finish_non_exhaustive()
    }
}

/// The note on results that another version of the physics computed, from the library's check of the model.
fn other_model(checked: Result<(), LibraryError>) -> Result<Option<String>, EvaluatorError> {
    match checked {
        Ok(()) => Ok(None),
        Err(LibraryError::OtherModel { campaign, stored, own }) => Ok(Some(format!(
            "the cases of campaign {campaign} were computed with model {stored}, this program has model {own}: the estimates \
             are those of the former; for the latter, compute the cases again (`tracktwin campaign retry {campaign} \
             --other-model`, then `tracktwin run` or a coordinator) and train on them"
        ))),
        Err(unread) => Err(EvaluatorError::Library(TrainingError::Library(unread))),
    }
}

/// The error for a campaign that cannot be read: the models are of another library only if the campaign is unknown.
pub(crate) fn no_campaign(error: LibraryError) -> EvaluatorError {
    match error {
        LibraryError::UnknownCampaign { .. } => EvaluatorError::Foreign(error),
        unread => EvaluatorError::Library(TrainingError::Library(unread)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_of_another_model_are_a_note_and_a_library_that_is_away_is_an_error() {
        let other = |stored: &str| LibraryError::OtherModel {
            campaign: "c".to_owned(),
            stored: stored.to_owned(),
            own: "new".to_owned(),
        };
        assert_eq!(other_model(Ok(())).unwrap(), None);
        let note = other_model(Err(other("old"))).unwrap().unwrap();
        for part in ["campaign c", "model old", "model new", "--other-model"] {
            assert!(note.contains(part), "{part} is not in {note}");
        }
        let away = LibraryError::Unavailable { reason: "no response".to_owned() };
        assert!(other_model(Err(away)).is_err());
    }

    #[test]
    fn a_library_that_is_away_is_not_another_library() {
        let away = no_campaign(LibraryError::Unavailable { reason: "no response".to_owned() });
        assert!(matches!(away, EvaluatorError::Library(_)), "{away}");
        let unknown = no_campaign(LibraryError::UnknownCampaign { id: "c".to_owned() });
        assert!(matches!(unknown, EvaluatorError::Foreign(_)), "{unknown}");
    }
}
