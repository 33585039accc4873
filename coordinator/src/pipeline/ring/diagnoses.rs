//! Diagnoses of the laps, one per section of sleepers.

use super::error::json;
use super::folder::DIAGNOSES;
use super::part::{Part, cut, place, sections};
use super::{RingStudy, RingStudyError, Watch};
use crate::pipeline::diagnose::{DiagnosingError, Setting, diagnose};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_files::{FileName, Kind, Output, read_text};
use tracktwin_parameters::Preset;
use tracktwin_signal::recording::Recording;

/// Name of the file with a diagnosis.
const DIAGNOSIS: &str = "diagnosis.json";

impl RingStudy<'_> {
    /// Returns the diagnoses of a lap, one per section.
    pub(super) async fn diagnoses(
        &self,
        recording: &Recording,
        lap: usize,
        done: &mut u64,
        watch: &Watch<'_>,
    ) -> Result<Vec<Diagnosis>, RingStudyError> {
        let lap = Part::Lap(lap);
        let mut all = Vec::new();
        for range in sections(recording.sleepers.len()) {
            let place = place(&recording.sleepers[range.clone()]);
            let folder = self.folder.join(DIAGNOSES).join(lap.name()).join(&place);
            let path = folder.join(DIAGNOSIS);
            if !path.exists() {
                let shown = |stage: &'static str, share: f64| {
                    let share = 100.0 * share;
                    watch(*done, &format!("{lap}, {place}: diagnosis, {stage} {share:.0} %"));
                };
                let diagnosis = self.diagnosis(&cut(recording, lap, range), &shown).await;
                let diagnosis = diagnosis.map_err(|source| RingStudyError::Diagnosis {
                    part: format!("{lap}, {place}"),
                    source,
                })?;
                let text = serde_json::to_string_pretty(&diagnosis);
                let text = text.expect("a diagnosis is plain JSON");
                let mut output = Output::begin(&folder, Kind::Results, self.force)?;
                output.add(&FileName::new(DIAGNOSIS)?, text.as_bytes())?;
                output.commit()?;
            }
            all.push(serde_json::from_str(&read_text(&path)?).map_err(json(&path))?);
            *done += 1;
        }
        Ok(all)
    }

    async fn diagnosis(
        &self,
        section: &Recording,
        watch: &(dyn Fn(&'static str, f64) + Sync),
    ) -> Result<Diagnosis, DiagnosingError> {
        let track = Preset::VTrack.track();
        let setting = Setting { track: &track, library: self.library, without: &[], shuffle: None };
        Ok(diagnose(section, setting, watch).await?.diagnosis)
    }
}
