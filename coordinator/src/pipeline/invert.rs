//! Inversion of a recording: sections, null model, fits.

use crate::pipeline::compute::compute;
use crate::pipeline::fitted_sections;
use crate::pipeline::null_models::{self, NullModelError};
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use tracktwin_diagnosis::{
    CalibrationError, Candidate, Common, Diagnosis, PreparationError, PreparedRecording,
    check_length, first_calibration,
};
use tracktwin_evaluation::Flag;
use tracktwin_inspection::{Finding, Inspection, inspect};
use tracktwin_inversion::{Inversion, accepted, sections};
use tracktwin_library::{Library, LibraryError};
use tracktwin_parameters::Track;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::Kind;

/// Errors of the inversion.
#[derive(Debug, thiserror::Error)]
pub enum InvertingError {
    /// The recording cannot be compared with the track model.
    #[error(transparent)]
    Recording(#[from] PreparationError),
    /// No parameters of the track model fit the recording.
    #[error("cannot fit a track to the recording: {0}")]
    Fit(#[from] CalibrationError),
    /// The null simulations failed.
    #[error(transparent)]
    NullModel(#[from] NullModelError),
    /// The library cannot be read or written.
    #[error(transparent)]
    Library(#[from] LibraryError),
}

/// Evaluates a recording by inversion. The physics that `diagnosis`, a diagnosis of the recording, accepted
/// is part of the model. `library` stores null simulations and fitted sections. `watch` is called with the
/// current stage and its completed share (0 to 1).
///
/// # Errors
/// Returns [`InvertingError::Recording`] if the recording is unsuitable. All other errors are failures.
pub async fn invert(
    recording: &Recording,
    track: &Track,
    diagnosis: Option<&Diagnosis>,
    library: Option<&Library>,
    watch: &(dyn Fn(&'static str, f64) + Sync),
) -> Result<Inversion, InvertingError> {
    check_length(recording)?;
    watch("spectra", 0.0);
    let inspection = compute(|| inspect(recording));
    let left_out = inspection.notes_on_not_compared(recording);
    let all_passes = recording.passes.len();
    let recording = &*inspection.without_hum(recording);
    let recording = &inspection.comparable(recording);
    let prepared = compute(|| sections(recording, track))?;
    let short = prepared.first().and_then(|it| it.uncovered.note(recording));
    let with_physics = |prepared: PreparedRecording| {
        let known = diagnosis.map(|diagnosis| accepted(diagnosis, recording, &prepared));
        (prepared, known.unwrap_or_default())
    };
    let prepared = prepared.into_iter().map(with_physics).collect();
    let mut started = compute(|| start(prepared, watch))?;
    let Started { prepared, values, .. } = &started[started.len() / 2];
    watch("null model", 0.0);
    let surfaces = f64::from(null_models::SURFACES);
    let share = |done| watch("null model", done as f64 / surfaces);
    let null = null_models::of(prepared, values, library, share).await?;
    let offset = null.offset();
    for Started { prepared, .. } in &mut started {
        prepared.forward.expect_offset(&offset);
    }
    watch("fit", 0.0);
    let count = started.len() as f64;
    let progress = |done| watch("fit", done as f64 / count);
    let fitted = fitted_sections::of(started, &null, library, &progress).await?;
    let mut inversion = Inversion::of(recording, &fitted);
    if let Some(diagnosis) = diagnosis {
        inversion.take_replaced(diagnosis);
    }
    inversion.notes.extend(left_out.into_iter().chain(short));
    if diagnosis.is_none() {
        inversion.notes.extend(shown(&inspection));
    }
    if let Some(lost) = &inspection.loss_of_contact {
        let there = inversion.sleepers.iter_mut().filter(|it| lost.sleepers.contains(&it.id));
        there.for_each(|sleeper| sleeper.flags.push(Flag::LossOfContact));
        let line = lost.sentence(all_passes);
        inversion.notes.push(format!("loss_of_contact: {line}"));
    }
    Ok(inversion)
}

/// What the passes alone show, and how to take it into account. The remedy for a fault of the measuring chain is
/// another recording.
pub(crate) fn shown(inspection: &Inspection) -> Vec<String> {
    let mut notes: Vec<String> = inspection.findings.iter().map(Finding::sentence).collect();
    let is_physics = |finding: &Finding| {
        Kind::from_name(finding.physics).is_some_and(|kind| !kind.measuring_chain)
    };
    if inspection.findings.iter().any(is_physics) {
        notes.push(
            "The model of this evaluation does not contain what the passes alone show: values near it may be \
             wrong. Run `tracktwin improve` to find what was left out and to evaluate with it."
                .to_owned(),
        );
    }
    notes
}

/// A section after its first fit.
pub(super) struct Started {
    pub(super) prepared: PreparedRecording,
    /// Known physics that acts on the section.
    pub(super) known: Vec<Candidate>,
    /// Values of the first fit.
    pub(super) values: DVector<f64>,
}

/// First fit of every section, and the variation of parameters beyond each section.
fn start(
    prepared: Vec<(PreparedRecording, Vec<Candidate>)>,
    watch: &(dyn Fn(&'static str, f64) + Sync),
) -> Result<Vec<Started>, CalibrationError> {
    let (done, all) = (AtomicUsize::new(0), prepared.len() as f64);
    let one = |(mut prepared, known): (PreparedRecording, Vec<Candidate>)| -> Result<_, CalibrationError> {
        let values = first_calibration(&prepared, &known)?;
        prepared.forward.allow_beyond(&values)?;
        watch("first fit", (done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / all);
        Ok(Started { prepared, known, values })
    };
    let started = prepared.into_par_iter().map(one).collect::<Result<_, CalibrationError>>()?;
    Ok(alike(started))
}

/// Sets the common parameters of all sections to their median, because sleepers and railpads are of one
/// type along the track. No section then starts near another local minimum.
fn alike(mut started: Vec<Started>) -> Vec<Started> {
    for common in Common::ALL {
        let found = |it: &Started| it.values[it.prepared.forward.unknowns.common(common)];
        let mut all: Vec<f64> = started.iter().map(found).collect();
        all.sort_by(f64::total_cmp);
        let median = all[all.len() / 2];
        for Started { prepared, values, .. } in &mut started {
            values[prepared.forward.unknowns.common(common)] = median;
        }
    }
    started
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn too_short_a_recording_is_refused_before_anything_is_computed() {
        let mut recording =
            Recording::open(concat!(env!("CARGO_MANIFEST_DIR"), "/sample")).unwrap();
        recording.sleepers.truncate(5);
        let track = recording.stated_track().track;
        let watch = |stage: &'static str, _| panic!("{stage} before the refusal");
        let Err(error) = invert(&recording, &track, None, None, &watch).await else {
            panic!("five sleepers are not enough")
        };
        assert!(error.to_string().contains("needs 6 or more"), "{error}");
    }
}
