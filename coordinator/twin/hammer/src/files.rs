//! Files `estimates.csv` and `estimates.json`.

use crate::record::HammerRecord;
use tracktwin_files::{FileName, FilesError, Output};
use tracktwin_parameters::Parameter;

/// Parameters in `estimates.csv`; `estimates.json` also contains the damping.
const COLUMNS: [Parameter; 3] =
    [Parameter::RailpadStiffness, Parameter::BallastStiffness, Parameter::SleeperBendingStiffness];

impl HammerRecord {
    /// The text of `estimates.json`.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        let mut text = text.expect("a record of numbers and names is JSON");
        text.push('\n');
        text
    }

    /// The text of `estimates.csv`: one row per sleeper, with units in the column names.
    pub fn to_csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut head = vec!["id".to_owned(), "x_m".to_owned()];
        for of in COLUMNS {
            head.extend(
                ["", "_lower", "_upper", "_resolved", "_own"].map(|end| format!("{of}{end}")),
            );
        }
        head.extend(["misfit", "flags"].map(str::to_owned));
        writer.write_record(head).expect("rows of one length go into memory");
        for sleeper in &self.sleepers {
            let mut row = vec![sleeper.id.clone(), sleeper.x_m.to_string()];
            for of in COLUMNS {
                let it = sleeper.estimates[&of];
                row.extend([it.estimate, it.lower, it.upper].map(|value| value.to_string()));
                row.extend([it.resolved, it.own].map(|told| told.to_string()));
            }
            row.push(sleeper.misfit.map_or_else(String::new, |misfit| misfit.to_string()));
            row.push(sleeper.flags.iter().map(|flag| flag.name()).collect::<Vec<_>>().join(";"));
            writer.write_record(row).expect("rows of one length go into memory");
        }
        let bytes = writer.into_inner().expect("memory can be flushed");
        String::from_utf8(bytes).expect("names and numbers are text")
    }

    /// Adds `estimates.csv` and `estimates.json` to the files of a folder.
    ///
    /// # Errors
    /// [`FilesError`] with the file that cannot be written.
    pub fn add_to(&self, output: &mut Output) -> Result<(), FilesError> {
        output.add(&FileName::new("estimates.csv")?, self.to_csv().as_bytes())?;
        output.add(&FileName::new("estimates.json")?, self.to_json().as_bytes())
    }
}
