//! The physics that a diagnosis accepted, as a part of an evaluation.

use super::extend::diagnosis;
use super::{OrInput, Stop};
use anyhow::anyhow;
use std::path::Path;
use tracktwin_diagnosis::Diagnosis;
use tracktwin_inversion::modelled;
use tracktwin_signal::recording::Recording;

/// Reads a diagnosis, which must be of sleepers of this recording.
pub(super) fn diagnosis_of(recording: &Recording, path: &Path) -> Result<Diagnosis, Stop> {
    let found = diagnosis(path).or_input()?;
    let ids: Vec<&String> = recording.sleepers.iter().map(|sleeper| &sleeper.id).collect();
    if found.track.is_empty() || found.track.iter().any(|sleeper| !ids.contains(&&sleeper.id)) {
        return Err(Stop::Input(anyhow!(
            "{}: track: the diagnosed sleepers are not those of the recording; give a diagnosis of this recording",
            path.display()
        )));
    }
    Ok(found)
}

/// Text on the physics of a diagnosis that is part of the model.
pub(super) fn with_physics(diagnosis: &Diagnosis) -> String {
    let accepted = diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    let (mut known, mut others) = (Vec::new(), Vec::new());
    for hypothesis in accepted {
        let (list, text) = match modelled(hypothesis) {
            Some(kind) => (&mut known, format!("{} ({})", kind.summary, kind.physics)),
            None => (&mut others, hypothesis.physics.clone()),
        };
        if !list.contains(&text) {
            list.push(text);
        }
    }
    let text = if known.is_empty() {
        "Nothing that the diagnosis accepted can be added to the track model.".to_owned()
    } else {
        format!(
            "The track model contains what the diagnosis of {} accepted: {}. Its values are those of the diagnosis; \
             standard deviations do not include their uncertainty.",
            diagnosis.recording,
            known.join("; ")
        )
    };
    if others.is_empty() { text } else { format!("{text} Left out: {}.", others.join(", ")) }
}
