//! Files `evaluation.json` and `evaluation.csv` of an inversion.

use crate::record::Inversion;
use tracktwin_files::{FileName, FilesError, Output};
use tracktwin_parameters::Parameter;

impl Inversion {
    /// The text of `evaluation.json`.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        let mut text = text.expect("a record of numbers and names is JSON");
        text.push('\n');
        text
    }

    /// The text of `evaluation.csv`: one row per sleeper, with units in the column names.
    pub fn to_csv(&self) -> String {
        let parameters = self.parameters();
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut head = vec!["id".to_owned(), "x_m".to_owned()];
        head.extend(parameters.iter().flat_map(|of| [format!("{of}_mean"), format!("{of}_sd")]));
        head.extend(["misfit", "outside_library", "flags"].map(str::to_owned));
        writer.write_record(head).expect("rows of one length go into memory");
        for sleeper in &self.sleepers {
            let mut row = vec![sleeper.id.clone(), sleeper.x_m.to_string()];
            for estimate in sleeper.estimates.values() {
                row.extend([estimate.mean.to_string(), estimate.sd.to_string()]);
            }
            row.extend([sleeper.misfit.to_string(), (!sleeper.is_valid()).to_string()]);
            row.push(sleeper.flags.iter().map(|flag| flag.name()).collect::<Vec<_>>().join(";"));
            writer.write_record(row).expect("rows of one length go into memory");
        }
        let bytes = writer.into_inner().expect("memory can be flushed");
        String::from_utf8(bytes).expect("names and numbers are text")
    }

    /// Adds `{name}.csv` and `{name}.json` to the files of a folder; `name` is usually `evaluation`.
    ///
    /// # Errors
    /// [`FilesError`] with the file that cannot be written.
    pub fn add_to(&self, output: &mut Output, name: &str) -> Result<(), FilesError> {
        output.add(&FileName::new(&format!("{name}.csv"))?, self.to_csv().as_bytes())?;
        output.add(&FileName::new(&format!("{name}.json"))?, self.to_json().as_bytes())
    }

    /// The parameters that were estimated, in catalogue order.
    pub fn parameters(&self) -> Vec<Parameter> {
        let first = self.sleepers.first().map(|sleeper| &sleeper.estimates);
        first.map(|of| of.keys().copied().collect()).unwrap_or_default()
    }
}
