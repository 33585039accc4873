//! Which commands can use a recording, and what limits them.

use super::super::track::stated;
use tracktwin_diagnosis::{PreparationError, check_track, passes_alone};
use tracktwin_evaluation::check_recording;
use tracktwin_inspection::{Inspection, chain, inspect, separate_wavelengths};
use tracktwin_inversion::sections;
use tracktwin_number::rounded;
use tracktwin_signal::SAMPLES_A_PERIOD;
use tracktwin_signal::recording::Recording;

/// Sample rate required for features up to 4 kHz.
const FEATURES_HZ: f64 = SAMPLES_A_PERIOD * 4000.0;

/// One sentence for each command, and one for each limit.
///
/// Commands are tested without `--track`: with the track that the recording states.
pub(super) fn uses(recording: &Recording, inspection: &Inspection) -> Vec<String> {
    let compared = check_compared(recording, inspection);
    let evaluated = usable(recording);
    let inverted = evaluated.as_ref().map_err(String::clone).and_then(|kept| {
        let result = if kept.passes.len() == recording.passes.len() {
            compared.clone()
        } else {
            check_compared(kept, &inspect(kept))
        };
        result.map_err(|error| error.to_string())
    });
    let by_models = evaluated.as_ref().map_err(String::clone).and_then(by_models);
    let mut uses = vec![
        said("evaluate", inverted.map(|()| String::new())),
        said("evaluate --models", by_models),
        said("diagnose", diagnosed(recording, inspection, compared)),
    ];
    uses.extend(limits(recording, inspection));
    uses
}

/// Sentence on a command: possible with this addition, or not possible for this reason.
fn said(command: &str, possible: Result<String, String>) -> String {
    match possible {
        Ok(addition) => format!("`{command}`: possible{addition}"),
        Err(reason) => format!("`{command}`: not possible: {reason}"),
    }
}

/// The part of a recording that `evaluate` uses, or why there is none.
fn usable(recording: &Recording) -> Result<Recording, String> {
    if recording.sleepers.is_empty() {
        return Err(PreparationError::NoSleepers.to_string());
    }
    let (kept, pass_defects) = chain::usable(recording);
    match pass_defects.first() {
        Some(first) if kept.passes.is_empty() => Err(format!("no pass is usable: {first}")),
        _ => Ok(kept),
    }
}

/// Whether a recording can be compared with the model of the track that it states.
fn check_compared(recording: &Recording, inspection: &Inspection) -> Result<(), PreparationError> {
    let (track, _) = stated(recording);
    check_track(recording, &track.design)?;
    let compared = inspection.comparable(&inspection.without_hum(recording));
    sections(&compared, &track).map(|_| ())
}

/// The models that an evaluation needs, or why it is not possible.
fn by_models(kept: &Recording) -> Result<String, String> {
    let (track, _) = stated(kept);
    let speeds = kept.speeds_km_h();
    check_recording(kept, &track.design, &speeds).map_err(|error| error.to_string())?;
    let listed: Vec<String> = speeds.iter().map(|speed| rounded(*speed, 3)).collect();
    Ok(format!(", with models of this track for {} km/h", listed.join(", ")))
}

/// What a diagnosis can test, or why it is not possible.
fn diagnosed(
    recording: &Recording,
    inspection: &Inspection,
    compared: Result<(), PreparationError>,
) -> Result<String, String> {
    let Err(reason) = compared else {
        return match inspection.refusal() {
            Some(defect) => Err(PreparationError::Unusable(defect.clone()).to_string()),
            None => Ok(String::new()),
        };
    };
    // A diagnosis without a track accepts only wheel orders and faults of the measuring chain.
    if !reason.is_of_the_track() && passes_alone(recording, inspection, &reason).is_some() {
        return Ok(format!(", for wheel and measuring chain only: {reason}"));
    }
    Err(reason.to_string())
}

/// What limits every use of a recording.
fn limits(recording: &Recording, inspection: &Inspection) -> Vec<String> {
    let mut limits = Vec::new();
    let rate = recording.sample_rate_hz;
    if rate < FEATURES_HZ {
        let highest_hz = (rate / SAMPLES_A_PERIOD).floor();
        limits.push(format!(
            "the sample rate of {} Hz limits models to features up to {highest_hz:.0} Hz \
             (`tracktwin train --highest {highest_hz:.0}`); features up to 4000 Hz need {FEATURES_HZ:.0} Hz",
            rounded(rate, 8),
        ));
    }
    if !separate_wavelengths(&recording.speeds_km_h()) {
        let fastest = recording.speeds_km_h().into_iter().fold(0.0, f64::max);
        limits.push(format!(
            "one speed only: effects of constant frequency (structure) and of constant wavelength \
             (surface) cannot be separated, so corrugation is not tested, and wheel orders only in a long pass; \
             add a pass {:.0} km/h slower",
            0.25 * fastest
        ));
    }
    if inspection.offsets.is_empty() {
        limits.push(
            "no speed has two passes: repeatable signal and noise cannot be separated; add a second pass at \
             each speed"
                .to_owned(),
        );
    }
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sentences on commands about the bundled recording after a change.
    fn sentences(change: impl FnOnce(&mut Recording)) -> [String; 3] {
        let mut recording =
            Recording::open(concat!(env!("CARGO_MANIFEST_DIR"), "/sample")).unwrap();
        change(&mut recording);
        let mut all = uses(&recording, &inspect(&recording)).into_iter();
        [(); 3].map(|()| all.next().unwrap())
    }

    #[test]
    fn a_complete_recording_can_be_used_by_every_command() {
        let models = "`evaluate --models`: possible, with models of this track for 7, 10, 13 km/h";
        let expected = ["`evaluate`: possible", models, "`diagnose`: possible"];
        assert_eq!(sentences(|_| ()), expected);
    }

    #[test]
    fn what_a_command_lacks_is_stated_with_its_remedy() {
        let all = sentences(|recording| recording.sleepers.clear());
        for sentence in &all {
            assert!(sentence.contains("not possible: sleepers: their positions"), "{sentence}");
            assert!(sentence.contains("--sleeper"), "{sentence}");
        }
        let all = sentences(|recording| recording.sleepers.truncate(5));
        for sentence in [&all[0], &all[2]] {
            assert!(sentence.contains("not possible: passes: only"), "{sentence}");
        }
        assert!(all[1].contains("possible, with models"), "{}", all[1]);
        let unknown = ("gain_known".to_owned(), serde_json::Value::Bool(false));
        let all = sentences(|recording| recording.nominal.extend([unknown]));
        for sentence in &all {
            assert!(
                sentence.contains("not possible: recording.json: nominal.gain_known"),
                "{sentence}"
            );
        }
    }
}
