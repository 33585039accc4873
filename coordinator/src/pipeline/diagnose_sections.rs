//! Diagnosis of a recording of any length: a long track in overlapping sections, one after the other.

use crate::pipeline::confirm::{ConfirmingError, diagnose_and_confirm};
use crate::pipeline::diagnose::{Setting, diagnose};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tracktwin_diagnosis::{
    DiagnosedSection, Diagnosis, diagnosed_sections, joined, section_folder,
};
use tracktwin_experiment::{CODE_VERSION, MODEL_HASH};
use tracktwin_files::{FileName, FilesError, Kind, Output, check, is_own, read_text};
use tracktwin_inspection::chain;
use tracktwin_signal::recording::{Recording, Sleeper};

/// Length of the passes beyond the first and the last sleeper of a section, in spans.
const BESIDE_SPANS: f64 = 3.5;

/// Name of the file with a diagnosis.
pub const DIAGNOSIS: &str = "diagnosis.json";
/// Name of its page.
pub const PAGE: &str = "report.html";
/// Name of the file with the identity of a section's diagnosis.
const INPUTS: &str = "inputs.json";

/// Output of the sections of a long track, each to a folder of its own. A section whose folder holds the
/// diagnosis of the same inputs is not diagnosed again.
pub struct SectionOutput<'a> {
    /// Folder of the whole diagnosis; the sections' folders lie in it.
    pub folder: &'a Path,
    /// Whether files that the program did not write may be replaced.
    pub force: bool,
    /// Makes the page of a section.
    pub page: &'a (dyn Fn(&Diagnosis) -> String + Sync),
}

/// State of a diagnosis in sections.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Number of the section, from 1.
    pub section: usize,
    /// Number of sections.
    pub sections: usize,
    /// Ids of the first and the last sleeper of the section.
    pub place: &'a str,
    /// Stage; empty before the first one of a section.
    pub stage: &'static str,
    /// Completed share of the stage, 0 to 1.
    pub share: f64,
}

/// Receives the progress of a diagnosis.
pub type Watch<'a> = dyn Fn(At<'_>) + Sync + 'a;

/// Errors of a diagnosis in sections.
#[derive(Debug, thiserror::Error)]
pub enum SectionsError {
    /// A section cannot be diagnosed; if it is unsuitable, so are all others.
    #[error(transparent)]
    Diagnosis(#[from] ConfirmingError),
    /// A section's files cannot be read or written.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A section's file is not a diagnosis.
    #[error("{path}: {source}; remove the file, and the section is diagnosed again")]
    NoDiagnosis {
        /// Path of the file.
        path: String,
        /// Cause.
        source: serde_json::Error,
    },
}

/// Identity of a section's diagnosis.
#[derive(PartialEq, Serialize, Deserialize)]
struct Inputs {
    code_version: String,
    model_hash: String,
    /// Hash of passes, sleepers and track.
    recording: String,
    without: Vec<String>,
    confirm: bool,
}

/// Diagnoses a recording. With `confirm`, passes are withheld and compared
/// ([`diagnose_and_confirm`]). The sections of a long track are stored in `output`.
///
/// # Errors
/// [`SectionsError`] if no section can be diagnosed, or if a diagnosis or a file fails.
pub async fn diagnose_sections(
    recording: &Recording,
    setting: Setting<'_>,
    confirm: bool,
    output: &SectionOutput<'_>,
    watch: &Watch<'_>,
) -> Result<Diagnosis, SectionsError> {
    let ranges = diagnosed_sections(recording.sleepers.len());
    let sections = ranges.len();
    let (mut diagnosed, mut unsuitable) = (Vec::new(), Vec::new());
    for (section, sleepers) in (1..).zip(ranges) {
        let place = place(&recording.sleepers[sleepers.clone()]);
        let shown = |stage, share| watch(At { section, sections, place: &place, stage, share });
        shown("", 0.0);
        if sections == 1 {
            return diagnosis(recording, setting, confirm, &shown).await;
        }
        let part = recording.part(sleepers.clone(), BESIDE_SPANS);
        match output.section(&part, (section, &place), (setting, confirm), &shown).await {
            Ok(diagnosis) => {
                diagnosed.push(DiagnosedSection { number: section, sleepers, diagnosis });
            }
            Err(SectionsError::Diagnosis(error)) if error.is_wrong_input() => {
                unsuitable.push((place, error));
            }
            Err(failed) => return Err(failed),
        }
    }
    let ids: Vec<String> = recording.sleepers.iter().map(|sleeper| sleeper.id.clone()).collect();
    let x_m: Vec<f64> = recording.sleepers.iter().map(|sleeper| sleeper.x_m).collect();
    let lost = chain::loss_of_contact(recording);
    let Some(mut diagnosis) = joined(&ids, &x_m, &diagnosed, lost) else {
        return Err(unsuitable.swap_remove(0).1.into());
    };
    diagnosis.recording.clone_from(&recording.name);
    let skipped = unsuitable.iter();
    let skipped = skipped.map(|(place, error)| format!("{place} was not diagnosed: {error}."));
    diagnosis.notes.extend(skipped);
    Ok(diagnosis)
}

/// Diagnosis of a recording as a whole.
async fn diagnosis(
    recording: &Recording,
    setting: Setting<'_>,
    confirm: bool,
    watch: &(dyn Fn(&'static str, f64) + Sync),
) -> Result<Diagnosis, SectionsError> {
    if confirm {
        return Ok(diagnose_and_confirm(recording, setting, watch).await?);
    }
    let diagnosed = diagnose(recording, setting, watch).await;
    Ok(diagnosed.map_err(ConfirmingError::from)?.diagnosis)
}

impl SectionsError {
    /// Whether the recording is unsuitable, or a file does not belong to the program.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::Diagnosis(error) => error.is_wrong_input(),
            Self::Files(error) => error.is_wrong_input(),
            Self::NoDiagnosis { .. } => true,
        }
    }
}

impl SectionOutput<'_> {
    /// Diagnosis of a section, from its folder or computed and stored there.
    async fn section(
        &self,
        section: &Recording,
        (number, place): (usize, &str),
        (setting, confirm): (Setting<'_>, bool),
        watch: &(dyn Fn(&'static str, f64) + Sync),
    ) -> Result<Diagnosis, SectionsError> {
        let folder = self.folder.join(section_folder(number));
        let inputs = Inputs::of(section, setting, confirm);
        if let Some(known) = stored(&folder, &inputs)? {
            return Ok(known);
        }
        // Before the computation, which takes minutes.
        check(&folder, Kind::Results, self.force, &[DIAGNOSIS, PAGE, INPUTS])?;
        let mut diagnosis = diagnosis(section, setting, confirm, watch).await?;
        diagnosis.recording = format!("{}, {place}", section.name);
        let inputs = serde_json::to_string_pretty(&inputs).expect("inputs are plain JSON");
        let mut output = Output::begin(&folder, Kind::Results, self.force)?;
        output.add(&FileName::new(INPUTS)?, inputs.as_bytes())?;
        add_to(&mut output, &diagnosis, &(self.page)(&diagnosis))?;
        output.commit()?;
        Ok(diagnosis)
    }
}

/// Adds a diagnosis and its page to the files of a folder. Returns the text of the diagnosis.
///
/// # Errors
/// [`FilesError`] if a file cannot be written.
pub fn add_to(
    output: &mut Output,
    diagnosis: &Diagnosis,
    page: &str,
) -> Result<String, FilesError> {
    let text = serde_json::to_string_pretty(diagnosis).expect("a diagnosis is plain JSON");
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    output.add(&FileName::new(DIAGNOSIS)?, text.as_bytes())?;
    Ok(text)
}

/// The diagnosis in a folder, if it has these inputs.
fn stored(folder: &Path, inputs: &Inputs) -> Result<Option<Diagnosis>, SectionsError> {
    if ![INPUTS, DIAGNOSIS].iter().all(|name| is_own(folder, Kind::Results, name)) {
        return Ok(None);
    }
    let known = serde_json::from_str::<Inputs>(&read_text(&folder.join(INPUTS))?);
    if !known.is_ok_and(|known| known == *inputs) {
        return Ok(None);
    }
    let path = folder.join(DIAGNOSIS);
    let diagnosis = serde_json::from_str(&read_text(&path)?);
    diagnosis
        .map(Some)
        .map_err(|source| SectionsError::NoDiagnosis { path: path.display().to_string(), source })
}

impl Inputs {
    fn of(section: &Recording, setting: Setting<'_>, confirm: bool) -> Self {
        let mut hash = blake3::Hasher::new();
        hash.update(format!("{:?} {:?}", setting.track, section.sleepers).as_bytes());
        hash.update(format!("{} {:?}", section.sample_rate_hz, section.nominal).as_bytes());
        for pass in &section.passes {
            hash.update(&pass.speed_km_h.to_le_bytes());
            for number in pass.signal.samples().iter().chain(&pass.position_m) {
                hash.update(&number.to_le_bytes());
            }
        }
        Self {
            code_version: CODE_VERSION.to_owned(),
            model_hash: MODEL_HASH.to_owned(),
            recording: hash.finalize().to_hex().to_string(),
            without: setting.without.to_vec(),
            confirm,
        }
    }
}

/// Name of a stretch of sleepers: the first and the last of them.
fn place(sleepers: &[Sleeper]) -> String {
    let [first, last] = [sleepers.first(), sleepers.last()]
        .map(|it| it.map(|sleeper| sleeper.id.as_str()).unwrap_or_default());
    format!("{first} to {last}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tracktwin_parameters::{Preset, Track};
    use tracktwin_signal::Signal;
    use tracktwin_signal::recording::Pass;

    fn recording(sample: f64) -> Recording {
        let sleeper =
            |number: u32| Sleeper { id: format!("km 3/{number}"), x_m: 0.6 * f64::from(number) };
        Recording {
            name: "line".to_owned(),
            sample_rate_hz: 1e3,
            channel: String::new(),
            passes: vec![Pass {
                file: String::new(),
                speed_km_h: 80.0,
                axle: None,
                signal: Signal::new(1e3, vec![0.0, sample]).unwrap(),
                position_m: vec![0.0, 1.0],
                contact_loss_share: None,
            }],
            sleepers: (1..4).map(sleeper).collect(),
            nominal: serde_json::Map::new(),
            spacing_m: 0.6,
            doubts: Vec::new(),
        }
    }

    fn inputs(sample: f64, track: &Track, without: &[String]) -> Inputs {
        let setting = Setting { track, library: None, without, shuffle: None };
        Inputs::of(&recording(sample), setting, false)
    }

    #[test]
    fn a_stored_section_is_used_again_for_the_same_inputs_only() {
        let folder = tempfile::tempdir().unwrap();
        let [v_track, line] = [Preset::VTrack, Preset::Concrete60E1].map(Preset::track);
        let same = inputs(1.0, &v_track, &[]);
        assert!(stored(folder.path(), &same).unwrap().is_none());
        let scores = json!({"in_sample": {"score": 0.0}, "held_out": null});
        let diagnosis = json!({
            "format": tracktwin_diagnosis::FORMAT, "recording": "line", "verdict": "consistent",
            "sentence": "", "mismatches": [], "hypotheses": [], "bias_removed": {}, "track": [],
            "fit": {"score": "", "before": scores, "after": scores, "held_out_gain_nats": {}},
            "levels": {"frequency_Hz": [], "speeds_km_h": [], "measured_dB": [], "before_dB": [],
                "after_dB": [], "scatter_dB": []},
            "notes": []
        });
        let write = |diagnosis: &str| {
            let mut output = Output::begin(folder.path(), Kind::Results, false).unwrap();
            let same = serde_json::to_string(&inputs(1.0, &v_track, &[])).unwrap();
            output.add(&FileName::new(INPUTS).unwrap(), same.as_bytes()).unwrap();
            output.add(&FileName::new(DIAGNOSIS).unwrap(), diagnosis.as_bytes()).unwrap();
            output.commit().unwrap();
        };
        write(&diagnosis.to_string());
        assert_eq!(stored(folder.path(), &same).unwrap().unwrap().recording, "line");
        let without = ["squat".to_owned()];
        for other in
            [inputs(2.0, &v_track, &[]), inputs(1.0, &line, &[]), inputs(1.0, &v_track, &without)]
        {
            assert!(stored(folder.path(), &other).unwrap().is_none());
        }
        write("{");
        let broken = stored(folder.path(), &same).unwrap_err();
        assert!(broken.to_string().contains("remove the file"), "{broken}");
        assert!(broken.is_wrong_input());
        // A file that was changed by others is not the program's.
        std::fs::write(folder.path().join(DIAGNOSIS), format!("{diagnosis} ")).unwrap();
        assert!(stored(folder.path(), &same).unwrap().is_none());
    }

    #[test]
    fn a_stretch_is_named_by_its_first_and_its_last_sleeper() {
        assert_eq!(place(&recording(0.0).sleepers), "km 3/1 to km 3/3");
        assert_eq!(place(&[]), " to ");
    }
}
