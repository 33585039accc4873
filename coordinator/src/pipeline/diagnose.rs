//! Diagnosis of a recording: inspection, baseline, null model, search, conclusion.
//!
//! Owns the order of the stages; what each does is the diagnosis crate's, where null simulations
//! are kept the library's.

use crate::pipeline::compute::compute;
use crate::pipeline::null_models::{self, NullModelError};
use nalgebra::DVector;
use tracktwin_diagnosis::{
    CalibrationError, Candidate, Diagnosis, Evidence, NullModel, PreparationError,
    PreparedRecording, SearchOutcome, Stage, check_track, first_calibration, passes_alone, search,
};
use tracktwin_inspection::{Inspection, inspect};
use tracktwin_library::Library;
use tracktwin_parameters::Track;
use tracktwin_signal::recording::Recording;

/// Settings of a diagnosis.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    /// The track that recordings are compared with.
    pub track: &'a Track,
    /// Keeps the null simulations, if there is one.
    pub library: Option<&'a Library>,
    /// Kinds of physics that may not be accepted.
    pub without: &'a [String],
    /// Gives an order of the sleepers for each speed, `[speed][sleeper]`, from the numbers of speeds and
    /// sleepers: a control in which nothing has a place, and the passes don't speak for themselves.
    pub shuffle: Option<&'a Orders<'a>>,
}

/// From numbers of speeds and sleepers to an order of the sleepers for each speed.
pub type Orders<'a> = dyn Fn(usize, usize) -> Vec<Vec<usize>> + Send + Sync + 'a;

/// A diagnosis and what it was concluded from.
#[derive(Debug)]
pub struct Diagnosed {
    /// The diagnosis document.
    pub diagnosis: Diagnosis,
    /// The comparison; none where the passes spoke for themselves alone.
    pub compared: Option<Compared>,
}

/// A recording's comparison with the model.
#[derive(Debug)]
pub struct Compared {
    /// The prepared recording.
    pub prepared: PreparedRecording,
    /// Result of the search.
    pub search: SearchOutcome,
    /// The random variation it was compared with.
    pub null: NullModel,
}

/// Why there is no diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosingError {
    /// The recording cannot be diagnosed.
    #[error(transparent)]
    Recording(#[from] PreparationError),
    /// The model of the track cannot be fitted without anything left out.
    #[error("cannot fit the baseline: {0}")]
    Baseline(#[source] CalibrationError),
    /// The null simulations failed.
    #[error(transparent)]
    NullModel(#[from] NullModelError),
    /// The search broke down.
    #[error("the search for left-out physics failed: {0}")]
    Search(#[source] CalibrationError),
    /// What the search found comes to no conclusion.
    #[error("the search gives no conclusion: {0}")]
    Conclusion(#[source] CalibrationError),
}

/// Diagnoses a recording. `watch` gets the current stage and the share done.
///
/// # Errors
/// [`DiagnosingError::Recording`] states what the recording lacks; everything else is a failure.
pub async fn diagnose(
    recording: &Recording,
    setting: Setting<'_>,
    watch: &(dyn Fn(&'static str, f64) + Sync),
) -> Result<Diagnosed, DiagnosingError> {
    let Setting { track, library, without, shuffle } = setting;
    let allowed = |physics: &str| !without.iter().any(|other| other == physics);
    check_track(recording, &track.design)?;
    watch("first look", 0.0);
    let mut inspection = compute(|| inspect(recording));
    let mut prepared = match compute(|| PreparedRecording::new(recording, track)) {
        Ok(prepared) => prepared,
        Err(reason) => {
            inspection.forget(allowed);
            let diagnosis = passes_alone(recording, &inspection, &reason).ok_or(reason)?;
            return Ok(Diagnosed { diagnosis, compared: None });
        }
    };
    if let Some(defect) = inspection.refusal() {
        return Err(PreparationError::Unusable(defect.clone()).into());
    }
    inspection.forget(allowed);
    if let Some(orders) = shuffle {
        inspection.ignore();
        let (speeds, sleepers) = (prepared.pass_numbers.len(), prepared.forward.section.sleepers);
        prepared.shuffle(&orders(speeds, sleepers));
    }
    let suggested = prepared.suggested(&inspection);
    prepared.without = without.to_vec();
    watch("baseline", 0.0);
    let start = compute(|| baseline(&mut prepared)).map_err(DiagnosingError::Baseline)?;
    watch("null model", 0.0);
    let surfaces = f64::from(null_models::SURFACES);
    let share = |done| watch("null model", done as f64 / surfaces);
    let null = null_models::of(&prepared, &start, library, share).await?;
    let mut all = tracktwin_diagnosis::candidates(&prepared.forward.section);
    all.extend(suggested);
    all.retain(|candidate: &Candidate| allowed(candidate.kind.physics));
    let progress = |stage, share| watch(name(stage), share);
    let found = compute(|| search(&prepared, &null, start, &all, &progress));
    let search = found.map_err(DiagnosingError::Search)?;
    let diagnosis = compute(|| conclude(recording, &prepared, &inspection, &search))?;
    Ok(Diagnosed { diagnosis, compared: Some(Compared { prepared, search, null }) })
}

/// The track re-tuned with nothing left out, and what may differ beyond the section.
fn baseline(prepared: &mut PreparedRecording) -> Result<DVector<f64>, CalibrationError> {
    let start = first_calibration(prepared)?;
    prepared.forward.allow_beyond(&start)?;
    Ok(start)
}

fn conclude(
    recording: &Recording,
    prepared: &PreparedRecording,
    inspection: &Inspection,
    search: &SearchOutcome,
) -> Result<Diagnosis, DiagnosingError> {
    let evidence = Evidence { recording, prepared, inspection, search };
    evidence.conclude().map_err(DiagnosingError::Conclusion)
}

const fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Baseline => "baseline",
        Stage::Screening => "screening",
        Stage::Refinement => "refinement",
        Stage::HeldOut => "held out",
    }
}
