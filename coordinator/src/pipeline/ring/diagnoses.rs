//! Diagnoses of the laps.

use super::error::json;
use super::folder::DIAGNOSES;
use super::part::Part;
use super::{RingStudy, RingStudyError, Watch};
use crate::pipeline::diagnose::Setting;
use crate::pipeline::diagnose_sections::{At, DIAGNOSIS, SectionOutput, add_to, diagnose_sections};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_files::{Kind, Output, read_text};
use tracktwin_parameters::Preset;
use tracktwin_signal::recording::Recording;

impl RingStudy<'_> {
    /// Returns the diagnosis of a lap, computed if its file is missing.
    pub(super) async fn diagnosis(
        &self,
        recording: &Recording,
        lap: usize,
        done: u64,
        watch: &Watch<'_>,
    ) -> Result<Diagnosis, RingStudyError> {
        let lap = Part::Lap(lap);
        let folder = self.folder.join(DIAGNOSES).join(lap.name());
        let path = folder.join(DIAGNOSIS);
        if path.exists() {
            return serde_json::from_str(&read_text(&path)?).map_err(json(&path));
        }
        let track = Preset::VTrack.track();
        let setting = Setting { track: &track, library: self.library, without: &[], shuffle: None };
        let shown = |At { place, stage, share, .. }: At<'_>| {
            let share = 100.0 * share;
            watch(done, &format!("{lap}, {place}: diagnosis, {stage} {share:.0} %"));
        };
        let output = SectionOutput { folder: &folder, force: self.force, page: self.page };
        let diagnosed =
            diagnose_sections(&lap.of(recording), setting, false, &output, &shown).await;
        let diagnosis = diagnosed
            .map_err(|source| RingStudyError::Diagnosis { part: lap.to_string(), source })?;
        let mut output = Output::begin(&folder, Kind::Results, self.force)?;
        add_to(&mut output, &diagnosis, &(self.page)(&diagnosis))?;
        output.commit()?;
        Ok(diagnosis)
    }
}
