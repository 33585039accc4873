//! Confirmation of a diagnosis in the time domain, on passes that were withheld from it.

use crate::pipeline::compute::compute;
use crate::pipeline::diagnose::{Compared, DiagnosingError, Setting, diagnose};
use tracktwin_diagnosis::{ConfirmationError, Confirming, Diagnosis, are_one_speed, short_passes};
use tracktwin_inspection::{Inspection, inspect};
use tracktwin_signal::recording::Recording;

/// Errors of confirming a diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum ConfirmingError {
    /// No speed has two passes that can be compared with a track, so no pass can be withheld.
    #[error(
        "passes: no speed has two passes that can be compared; --confirm withholds the last pass of each speed that has two or \
         more: record one more pass, or leave --confirm out"
    )]
    NoPass,
    /// The remaining passes cannot be diagnosed.
    #[error(transparent)]
    Diagnosis(#[from] DiagnosingError),
    /// The simulations failed.
    #[error("the confirmation failed: {0}")]
    Simulation(#[from] ConfirmationError),
}

impl ConfirmingError {
    /// Whether the recording is unsuitable.
    pub const fn is_wrong_input(&self) -> bool {
        matches!(self, Self::NoPass | Self::Diagnosis(DiagnosingError::Recording(_)))
    }
}

/// Diagnoses a recording without the last pass of each speed that has two or more passes. Then compares the
/// withheld passes with simulations of the accepted hypotheses. `watch` is called with the current stage
/// and the completed share (0 to 1).
///
/// # Errors
/// Returns [`ConfirmingError`] if no pass can be withheld, or if the diagnosis or a simulation fails.
pub async fn diagnose_and_confirm(
    recording: &Recording,
    setting: Setting<'_>,
    watch: &(dyn Fn(&'static str, f64) + Sync),
) -> Result<Diagnosis, ConfirmingError> {
    let inspection = compute(|| inspect(recording));
    let (kept, withheld) = withhold(recording, &not_compared(recording, &inspection))
        .ok_or(ConfirmingError::NoPass)?;
    let withheld = compute(|| inspection.without_hum(&withheld));
    let diagnosed = diagnose(&kept, setting, watch).await?;
    let mut diagnosis = diagnosed.diagnosis;
    if let Some(Compared { prepared, search, null }) = &diagnosed.compared {
        watch("confirmation", 0.0);
        let confirming = Confirming { recording: &kept, prepared, search, null };
        let progress = |share| watch("confirmation", share);
        diagnosis.confirmation = compute(|| confirming.with(&withheld, &progress))?;
    }
    Ok(diagnosis)
}

/// Whether some speed of a recording has at least two passes that can be compared with a track.
pub fn has_pass_to_withhold(recording: &Recording) -> bool {
    let inspection = compute(|| inspect(recording));
    !withheld(recording, &not_compared(recording, &inspection)).is_empty()
}

/// Numbers of the passes that are not compared with a track.
fn not_compared(recording: &Recording, inspection: &Inspection) -> Vec<usize> {
    let unfit = inspection.not_compared();
    let short = short_passes(recording, &unfit);
    [unfit, short].concat()
}

/// Numbers of the last pass of each speed that has two or more, among all passes but those with the numbers `except`.
fn withheld(recording: &Recording, except: &[usize]) -> Vec<usize> {
    let passes = &recording.passes;
    let is_of = |one: usize, other: usize| {
        !except.contains(&other) && are_one_speed(passes[one].speed_km_h, passes[other].speed_km_h)
    };
    let is_last = |&pass: &usize| {
        let repeats = (0..pass).any(|other| is_of(pass, other));
        repeats && !(pass + 1..passes.len()).any(|other| is_of(pass, other))
    };
    (0..passes.len()).filter(|pass| !except.contains(pass)).filter(is_last).collect()
}

/// Splits a recording: without the last pass of each speed that has two or more passes, and these passes
/// alone. The passes with the numbers `except` are not withheld. Returns `None` if there is no such speed.
fn withhold(recording: &Recording, except: &[usize]) -> Option<(Recording, Recording)> {
    let last = withheld(recording, except);
    let of = |is_withheld: bool| {
        let passes = recording.passes.iter().enumerate();
        let wanted = passes.filter(|(pass, _)| last.contains(pass) == is_withheld);
        Recording { passes: wanted.map(|(_, pass)| pass.clone()).collect(), ..recording.clone() }
    };
    (!last.is_empty()).then(|| (of(false), of(true)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_signal::Signal;
    use tracktwin_signal::recording::Pass;

    #[test]
    fn the_last_pass_of_each_speed_that_has_two_is_withheld() {
        let pass = |(number, speed_km_h): (usize, &f64)| Pass {
            file: number.to_string(),
            speed_km_h: *speed_km_h,
            axle: None,
            signal: Signal::new(1e3, vec![0.0; 8]).unwrap(),
            position_m: vec![0.0; 8],
            contact_loss_share: None,
        };
        let recording = |speeds: &[f64]| Recording {
            name: "ride".to_owned(),
            sample_rate_hz: 1e3,
            channel: String::new(),
            passes: speeds.iter().enumerate().map(pass).collect(),
            sleepers: Vec::new(),
            nominal: serde_json::Map::new(),
            spacing_m: 0.125,
            doubts: Vec::new(),
        };
        let of = |speeds: &[f64], except: &[usize]| withhold(&recording(speeds), except);
        let (kept, withheld) = of(&[13.0, 10.0, 13.1, 7.0, 12.9], &[]).unwrap();
        let files = |it: &Recording| it.passes.iter().map(|it| it.file.clone()).collect::<Vec<_>>();
        assert_eq!(files(&kept), ["0", "1", "2", "3"]);
        assert_eq!(files(&withheld), ["4"]);
        let (kept, withheld) = of(&[13.0, 10.0, 13.1, 7.0, 12.9], &[4]).unwrap();
        assert_eq!(files(&kept), ["0", "1", "3", "4"]);
        assert_eq!(files(&withheld), ["2"]);
        assert!(of(&[13.0, 10.0, 7.0], &[]).is_none());
        assert!(of(&[13.0, 13.1, 10.0], &[0]).is_none());
    }
}
