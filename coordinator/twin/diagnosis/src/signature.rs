//! How well an effect whose truth is known could be seen at all.

use crate::calibration::{CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::observation::Observation;
use crate::prepared_recording::PreparedRecording;
use crate::screen::templates;
use nalgebra::DVector;
use tracktwin_track::extension::ExtensionInstance;

/// Length `d'` of an extension's trace in a recording over the scatter of nulls, after the baseline
/// has taken what it can.
///
/// `values` are the unknowns of the track without it, `extension` is in terms of the recording:
/// compared sleepers count from 0, places are the recording's.
///
/// # Errors
/// [`CalibrationError`] when values or extension make no track.
pub fn signature(
    prepared: &PreparedRecording,
    observation: &Observation,
    values: &DVector<f64>,
    extension: ExtensionInstance,
) -> Result<f64, CalibrationError> {
    let problem = Problem { forward: &prepared.forward, observation, candidates: &[] };
    let section = &prepared.forward.section;
    // Screening leaves out what makes no track: here the reason is wanted.
    section.in_model(&extension).build(&section.track.design, section.spans())?;
    let (kind, trials) = (extension.kind()?, vec![Vec::new()]);
    let candidate = Candidate {
        kind,
        extension,
        free: Vec::new(),
        trials,
        length_ratio: section.track.design.length_ratio(),
    };
    let traces = templates(&problem, &problem.at(values)?, &[candidate], &|| ())?;
    let trace = traces.first().ok_or(CalibrationError::NotFinite)?;
    Ok(trace.detectability.max(0.0).sqrt())
}
