//! Diagnosis of a recording: inspection, baseline, null model, search, conclusion.
//!
//! This module defines the order of the stages. The diagnosis crate implements them, and the library stores
//! null simulations.

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
    /// Track with which the recording is compared.
    pub track: &'a Track,
    /// Library for storing null simulations, if available.
    pub library: Option<&'a Library>,
    /// Kinds of physics that are left out of the catalogue.
    pub without: &'a [String],
    /// For a control: returns an order of the sleepers for each speed, as `[speed][sleeper]`. The arguments
    /// are the numbers of speeds and sleepers. Shuffled sleepers remove the location of every effect; the
    /// findings of the inspection are then ignored.
    pub shuffle: Option<&'a Orders<'a>>,
}

/// Function from the numbers of speeds and sleepers to an order of the sleepers for each speed.
pub type Orders<'a> = dyn Fn(usize, usize) -> Vec<Vec<usize>> + Send + Sync + 'a;

/// A diagnosis with its basis.
#[derive(Debug)]
pub struct Diagnosed {
    /// The diagnosis document.
    pub diagnosis: Diagnosis,
    /// Comparison with the track model; `None` if the diagnosis is based on the passes alone.
    pub compared: Option<Compared>,
}

/// Comparison of a recording with the track model.
#[derive(Debug)]
pub struct Compared {
    /// The prepared recording.
    pub prepared: PreparedRecording,
    /// Result of the search.
    pub search: SearchOutcome,
    /// Null model: random variation of the features.
    pub null: NullModel,
}

/// Errors of a diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosingError {
    /// The recording cannot be diagnosed.
    #[error(transparent)]
    Recording(#[from] PreparationError),
    /// The baseline cannot be fitted.
    #[error("cannot fit the baseline: {0}")]
    Baseline(#[source] CalibrationError),
    /// The null simulations failed.
    #[error(transparent)]
    NullModel(#[from] NullModelError),
    /// The search for left-out physics failed.
    #[error("the search for left-out physics failed: {0}")]
    Search(#[source] CalibrationError),
    /// No conclusion can be drawn from the result of the search.
    #[error("the search gives no conclusion: {0}")]
    Conclusion(#[source] CalibrationError),
}

/// Diagnoses a recording. `watch` is called with the current stage and its completed share (0 to 1).
///
/// # Errors
/// Returns [`DiagnosingError::Recording`] if the recording is unsuitable. All other errors are failures.
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
    let cleared = compute(|| inspection.without_hum(recording));
    let mut prepared =
        match compute(|| PreparedRecording::new(&cleared, track, &inspection.not_compared())) {
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
        let (speeds, sleepers) = (prepared.pass_numbers.len(), prepared.forward.section.sleepers());
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
    prepared.forward.expect_offset(&null.offset());
    let start = compute(|| prepared.learn_railpad_damping(&null, start))
        .map_err(DiagnosingError::Baseline)?;
    let mut all = tracktwin_diagnosis::candidates(&prepared.forward.section);
    all.extend(suggested);
    all.retain(|candidate: &Candidate| allowed(candidate.kind.physics));
    let progress = |stage, share| watch(name(stage), share);
    let found = compute(|| search(&prepared, &null, start, &all, &progress));
    let search = found.map_err(DiagnosingError::Search)?;
    let diagnosis = compute(|| conclude(recording, &prepared, &inspection, &search))?;
    Ok(Diagnosed { diagnosis, compared: Some(Compared { prepared, search, null }) })
}

/// Fits the baseline, and prepares the variation of parameters beyond the section.
fn baseline(prepared: &mut PreparedRecording) -> Result<DVector<f64>, CalibrationError> {
    let start = first_calibration(prepared, &[])?;
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
