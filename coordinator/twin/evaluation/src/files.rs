//! `evaluation.json` and `evaluation.csv`.

use crate::{Evaluation, SleeperEvaluation};
use tracktwin_files::{FileName, FilesError, Output};
use tracktwin_parameters::Parameter;

impl Evaluation {
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
        let mut rows = vec![head(&parameters)];
        rows.extend(self.sleepers.iter().map(|sleeper| row(sleeper, &parameters)));
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in rows {
            writer.write_record(row).expect("rows of one length go into memory");
        }
        let bytes = writer.into_inner().expect("memory can be flushed");
        String::from_utf8(bytes).expect("names and numbers are text")
    }

    /// Adds `evaluation.csv` and `evaluation.json` to the files of a folder.
    ///
    /// # Errors
    /// [`FilesError`] with the file that cannot be written.
    pub fn add_to(&self, output: &mut Output) -> Result<(), FilesError> {
        output.add(&FileName::new("evaluation.csv")?, self.to_csv().as_bytes())?;
        output.add(&FileName::new("evaluation.json")?, self.to_json().as_bytes())
    }

    /// The parameters that were estimated, in catalogue order.
    pub fn parameters(&self) -> Vec<Parameter> {
        let estimates = self.sleepers.first().map(|sleeper| &sleeper.estimates);
        estimates.map(|of| of.keys().copied().collect()).unwrap_or_default()
    }
}

fn head(parameters: &[Parameter]) -> Vec<String> {
    let mut head = vec!["id".to_owned(), "x_m".to_owned()];
    for way in ["", "selector_"] {
        for parameter in parameters {
            head.extend(["mean", "sd"].map(|what| format!("{way}{parameter}_{what}")));
        }
    }
    head.extend(["selector_mape_best", "outside_library", "flags"].map(str::to_owned));
    head
}

fn row(sleeper: &SleeperEvaluation, parameters: &[Parameter]) -> Vec<String> {
    let mut row = vec![sleeper.id.clone(), sleeper.x_m.to_string()];
    for estimates in [&sleeper.estimates, &sleeper.selector.estimates] {
        for parameter in parameters {
            let estimate = estimates.get(parameter);
            row.push(estimate.map(|of| of.mean.to_string()).unwrap_or_default());
            row.push(estimate.map(|of| of.sd.to_string()).unwrap_or_default());
        }
    }
    row.push(sleeper.selector.mape.first().map(ToString::to_string).unwrap_or_default());
    row.push((!sleeper.is_valid()).to_string());
    row.push(sleeper.flags.iter().map(|flag| flag.name()).collect::<Vec<_>>().join(";"));
    row
}
