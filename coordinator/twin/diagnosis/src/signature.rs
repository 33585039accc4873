//! Detectability of an extension with known parameters.

use crate::calibration::{CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::observation::Observation;
use crate::prepared_recording::PreparedRecording;
use nalgebra::DVector;
use tracktwin_track::extension::ExtensionInstance;

/// Detectability `d'` of an extension in a recording: norm of what remains of its whitened signature after the
/// baseline was fitted again.
///
/// The baseline is fitted to the expected log powers with and without the extension, from the same start. Half
/// the square of `d'` is the difference of the two smallest objectives. So a signature that other stiffnesses
/// imitate counts little even if they are far away.
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
    let section = &prepared.forward.section;
    let candidate = Candidate {
        kind: extension.kind()?,
        extension,
        free: Vec::new(),
        trials: vec![Vec::new()],
        length_ratio: section.track.design.length_ratio(),
        choice_nats: 0.0,
    };
    let problem = Problem { forward: &prepared.forward, observation, candidates: &[] };
    let hidden = [candidate];
    let left = |candidates: &[Candidate]| {
        let expected = Problem { candidates, ..problem }.predict(values)?;
        let observation = &observation.clone().with_log_power(expected);
        let fitted = Problem { observation, ..problem }.calibrate_widely(values.clone())?;
        Ok::<f64, CalibrationError>(fitted.objective)
    };
    Ok((2.0 * (left(&hidden)? - left(&[])?)).max(0.0).sqrt())
}
