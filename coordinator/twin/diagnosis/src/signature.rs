//! Detectability of an extension with known parameters.

use crate::calibration::{CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::observation::Observation;
use crate::prepared_recording::PreparedRecording;
use crate::screen::templates;
use nalgebra::DVector;
use tracktwin_track::extension::ExtensionInstance;

/// Detectability `d'` of an extension in a recording: norm of its whitened signature after the baseline was
/// fitted again.
///
/// `values` are the unknowns of the track without the extension. The indices of compared sleepers in
/// `extension` begin at 0; its positions are those of the recording in m.
///
/// # Errors
/// [`CalibrationError`] if no track or extension exists for the values.
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
