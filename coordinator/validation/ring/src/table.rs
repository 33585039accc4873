//! `truth.csv` and `ring.csv`, with one row per sleeper.

use crate::{SleeperTruth, Study, Truth};
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Columns of the truth before its values.
const HEAD: [&str; 7] = ["id", "x_m", "rail", "joint", "clamp", "missing_railpad", "bolt"];

/// What is written of each method's estimate.
const PARTS: [&str; 4] = ["mean", "low_90", "high_90", "valid"];

impl Truth {
    /// The text of `truth.csv`.
    pub fn to_csv(&self) -> String {
        let mut head: Vec<String> = HEAD.map(str::to_owned).into();
        head.extend(Parameter::ALL.iter().map(|parameter| format!("truth_{parameter}")));
        written(&head, self.sleepers.iter().map(truth))
    }

    /// The text of `truth.json`.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        format!("{}\n", text.expect("names and numbers are JSON"))
    }
}

impl Study {
    /// The text of `ring.csv`: truth, then mean and ends of the 90 % interval by each method.
    pub fn to_csv(&self) -> String {
        let mut head: Vec<String> = HEAD.map(str::to_owned).into();
        head.extend(Parameter::ALL.iter().map(|parameter| format!("truth_{parameter}")));
        for (method, _) in &self.methods {
            for parameter in Parameter::ALL {
                let column = |part| format!("{}_{parameter}_{part}", method.name());
                head.extend(PARTS.map(column));
            }
        }
        let row = |sleeper: &SleeperTruth| {
            let mut row = truth(sleeper);
            for (_, estimated) in &self.methods {
                for &parameter in Parameter::ALL {
                    let Some(of) = estimated.any(&sleeper.id, parameter) else {
                        row.extend(PARTS.map(|_| String::new()));
                        continue;
                    };
                    let half = NORMAL_90 * of.sd;
                    let valid = estimated.valid(&sleeper.id, parameter).is_some();
                    row.extend([of.mean, of.mean - half, of.mean + half].map(|it| it.to_string()));
                    row.push(valid.to_string());
                }
            }
            row
        };
        written(&head, self.truth.sleepers.iter().map(row))
    }
}

fn truth(sleeper: &SleeperTruth) -> Vec<String> {
    let mut row = vec![
        sleeper.id.clone(),
        sleeper.x_m.to_string(),
        sleeper.rail.to_string(),
        sleeper.joint.unwrap_or_default().to_owned(),
        sleeper.clamp.to_string(),
        sleeper.missing_railpad.to_string(),
        sleeper.bolt.to_string(),
    ];
    row.extend(Parameter::ALL.iter().map(|parameter| sleeper.values[parameter].to_string()));
    row
}

fn written(head: &[String], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(head).expect("rows go into memory");
    for row in rows {
        writer.write_record(row).expect("rows of one length go into memory");
    }
    let bytes = writer.into_inner().expect("memory can be flushed");
    String::from_utf8(bytes).expect("names and numbers are text")
}

#[cfg(test)]
mod tests {
    use crate::testing::{estimated, study};
    use crate::{Estimated, Method};

    #[test]
    fn every_sleeper_has_a_row_with_truth_and_intervals() {
        let mut study = study();
        let truth = estimated(&study, |_, _, truth| (truth, 0.1 * truth));
        study.methods = vec![(Method::Inversion, truth), (Method::Selector, Estimated::default())];
        let csv = study.to_csv();
        let lines: Vec<_> = csv.lines().collect();
        assert_eq!(lines.len(), 101);
        assert!(lines[0].contains("inversion_railpad_stiffness_N_m_low_90"), "{}", lines[0]);
        assert!(lines[91].starts_with("SN91,11.25,1,,false,true,true,10000000,"), "{}", lines[91]);
        assert!(lines[91].contains(",10000000,8355146."), "{}", lines[91]);
        assert!(lines[91].contains(",11644853."), "{}", lines[91]);
        assert!(lines[12].starts_with("SN12,1.375,1,J1,"), "{}", lines[12]);
        assert_eq!(study.truth.to_csv().lines().count(), 101);
        assert!(study.truth.to_json().contains("\"rough_band_factor\": 3.0"));
    }
}
