//! Detectability `d'` of a hidden effect after the baseline was fitted again.
//!
//! It counts the change of the band levels. Wheel orders that the inspection finds in the passes may have a small one.
//!
//! This module reads the truth. It must run only after the result of the diagnosis was stored.

use crate::known::kind;
use nalgebra::DVector;
use tracktwin_diagnosis::{CalibrationError, PreparedRecording, SearchOutcome, signature};
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::{Hidden, Scene};
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::ExtensionInstance;

/// Length in m of a crack in the simulators, which a scene does not state.
const CRACK_V_TRACK_M: f64 = 0.02;
const CRACK_LINE_M: f64 = 0.05;

/// `d'` of a hidden effect. 0 if stiffnesses imitate all of its band levels, `None` if the forward model does not contain the effect.
///
/// # Errors
/// [`CalibrationError`] if no track can be built from the true values.
pub fn detectability(
    recording: &Recording,
    prepared: &PreparedRecording,
    search: &SearchOutcome,
    scene: &Scene,
    hidden: &Hidden,
) -> Result<Option<f64>, CalibrationError> {
    let Some(extension) = in_recording(recording, prepared, scene, hidden) else { return Ok(None) };
    let values = values(recording, prepared, search, scene);
    signature(prepared, &search.observation, &values, extension).map(Some)
}

/// The effect in terms of the recording: compared sleepers count from 0.
fn in_recording(
    recording: &Recording,
    prepared: &PreparedRecording,
    scene: &Scene,
    hidden: &Hidden,
) -> Option<ExtensionInstance> {
    // Faults of the measuring chain are in the model where it is searched for them.
    kind(hidden).filter(|kind| !kind.measuring_chain || !kind.screening.families.is_empty())?;
    let json = serde_json::to_value(hidden).ok()?;
    let mut extension: ExtensionInstance = serde_json::from_value(json).ok()?;
    if let Hidden::CrackedSleeper { .. } = hidden {
        let crack_m = if scene.preset == Preset::VTrack { CRACK_V_TRACK_M } else { CRACK_LINE_M };
        extension = extension.with("bending_length_m", crack_m);
    }
    let compared: Vec<Option<usize>> =
        (0..prepared.forward.section.sleepers()).map(|s| number(recording, prepared, s)).collect();
    if let Some(sleepers) = &mut extension.sleepers {
        let place = |number: &usize| compared.iter().position(|other| *other == Some(*number));
        *sleepers = sleepers.iter().filter_map(place).collect();
        if sleepers.is_empty() {
            return None;
        }
    }
    Some(extension)
}

/// Number in the scene of a compared sleeper: its name holds it.
pub(crate) fn number(
    recording: &Recording,
    prepared: &PreparedRecording,
    sleeper: usize,
) -> Option<usize> {
    recording.sleepers[prepared.first_sleeper + sleeper].id.strip_prefix("SN")?.parse().ok()
}

/// The unknowns as they truly are. Level and spectrum of the surface are those of the fitted baseline: surfaces
/// of lines do not have the spectrum of eq. B.6, and a shape is seen against the surface that there is.
fn values(
    recording: &Recording,
    prepared: &PreparedRecording,
    search: &SearchOutcome,
    scene: &Scene,
) -> DVector<f64> {
    let unknowns = &prepared.forward.unknowns;
    let mut values = unknowns.typical();
    let fitted = &search.baseline.values;
    for index in unknowns.spectrum() {
        values[index] = fitted[index];
    }
    let mut levels: Vec<f64> = unknowns.level().map(|index| fitted[index]).collect();
    levels.sort_by(f64::total_cmp);
    let level = levels[levels.len() / 2];
    for sleeper in 0..prepared.forward.section.sleepers() {
        let truth = number(recording, prepared, sleeper).and_then(|n| scene.sleepers.get(n));
        let Some(truth) = truth else { continue };
        values[unknowns.ballast().start + sleeper] = truth.ballast_stiffness_n_m.ln();
        values[unknowns.railpad().start + sleeper] = truth.railpad_stiffness_n_m.ln();
    }
    for index in unknowns.level() {
        values[index] = level;
    }
    let bending: f64 = scene.sleepers.iter().map(|sleeper| sleeper.sleeper_ei_n_m2).sum();
    let global = unknowns.global().start;
    values[global] = (bending / scene.sleepers.len() as f64).ln();
    values[global + 1] = scene.railpad_damping_n_s_m.ln();
    values[global + 2] = scene.ballast_damping_n_s_m.ln();
    values
}
