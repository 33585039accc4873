//! From models and their library to what evaluates recordings.

use crate::pipeline;
use crate::pipeline::train::TrainingError;
use tracktwin_evaluation::{Domains, Error, Evaluation, Stream, Twin};
use tracktwin_experiment::Experiment;
use tracktwin_library::{Library, LibraryError};
use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureError};
use tracktwin_surrogate::{Trained, TrainingSet};

/// Surrogates and model selector of one library, ready for any number of recordings.
pub struct Evaluator {
    /// Works out the features that the models were trained on.
    pub extractor: Extractor,
    models: Trained,
    set: TrainingSet,
    domains: Domains,
    experiment: Experiment,
    fixed: ParameterSet,
}

/// Why models can't evaluate.
#[derive(Debug, thiserror::Error)]
pub enum EvaluatorError {
    /// The library does not hold what they were trained on.
    #[error(
        "the models belong to another library; give their library, or train models on this one"
    )]
    Foreign(#[source] LibraryError),
    /// Features of another version.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] TrainingError),
}

impl Evaluator {
    /// Reads the library that the models were trained on.
    ///
    /// # Errors
    /// [`EvaluatorError`].
    pub async fn new(models: Trained, library: &Library) -> Result<Self, EvaluatorError> {
        let campaign =
            library.campaign(models.campaign()).await.map_err(EvaluatorError::Foreign)?;
        let set = pipeline::train::set(library, &campaign).await?;
        let experiment = pipeline::train::experiment(&campaign)?;
        let extractor = Extractor::new(&experiment.features)?;
        let fixed = pipeline::train::fixed(&campaign)?;
        Ok(Self { extractor, models, set, domains: Domains::default(), experiment, fixed })
    }

    /// The models.
    pub const fn models(&self) -> &Trained {
        &self.models
    }

    /// The results they were trained and tested on.
    pub const fn set(&self) -> &TrainingSet {
        &self.set
    }

    /// The track of the models' campaign.
    pub const fn design(&self) -> &TrackDesign {
        &self.experiment.design
    }

    /// Experiment of the library's cases.
    pub const fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// The values of the parameters that the campaign does not vary.
    pub const fn fixed(&self) -> &ParameterSet {
        &self.fixed
    }

    /// Evaluation of a recording by models and selector.
    ///
    /// # Errors
    /// Those of [`tracktwin_evaluation::evaluate`].
    pub fn evaluate(&self, recording: &Recording) -> Result<Evaluation, Error> {
        tracktwin_evaluation::evaluate(recording, &self.twin())
    }

    /// Evaluation of samples while they are recorded, by models and selector.
    ///
    /// # Errors
    /// Those of [`Stream::new`].
    pub fn stream<'a>(&'a self, section: &'a Recording) -> Result<Stream<'a>, Error> {
        Stream::new(section, self.twin())
    }

    const fn twin(&self) -> Twin<'_> {
        Twin {
            extractor: &self.extractor,
            models: &self.models,
            library: &self.set,
            domains: &self.domains,
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
