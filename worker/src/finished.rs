//! Results of a group of cases for a report.

use tracktwin_experiment::Outcome;
use tracktwin_protocol::{CaseLease, CaseReport, MESSAGE_BYTES_MAX};

/// Largest number of cases, and of values, in one report: a large message of an ordinary experiment, and
/// a quarter of the largest allowed message.
const CASES_A_REPORT: usize = 128;
const NUMBERS_A_REPORT: usize = MESSAGE_BYTES_MAX / size_of::<f64>() / 4;

/// Results of one group of cases.
pub(crate) struct Finished {
    pub(crate) campaign: String,
    pub(crate) experiment_hash: String,
    pub(crate) reports: Vec<CaseReport>,
    /// W3C Trace Contexts of the simulations.
    pub(crate) traceparents: Vec<String>,
}

impl Finished {
    pub(crate) fn new(lease: &CaseLease, reports: Vec<CaseReport>, traceparent: String) -> Self {
        let CaseLease { campaign, experiment_hash, .. } = lease;
        let (campaign, experiment_hash) = (campaign.clone(), experiment_hash.clone());
        Self { campaign, experiment_hash, reports, traceparents: vec![traceparent] }
    }

    /// Adds another group to the report. Returns the group if it belongs to another report or does not
    /// fit.
    pub(crate) fn join(&mut self, other: Self) -> Option<Self> {
        let fits = self.reports.len() + other.reports.len() <= CASES_A_REPORT
            && self.numbers() + other.numbers() <= NUMBERS_A_REPORT;
        if fits && self.campaign == other.campaign && self.experiment_hash == other.experiment_hash
        {
            self.reports.extend(other.reports);
            self.traceparents.extend(other.traceparents);
            return None;
        }
        Some(other)
    }

    /// Number of values in the spectra.
    fn numbers(&self) -> usize {
        let of_outcome = |outcome: &Outcome| match outcome {
            Outcome::Finished(passes) => {
                passes.iter().map(|pass| pass.features.log_power.len()).sum()
            }
            Outcome::Failed { .. } => 0,
        };
        self.reports.iter().map(|report| of_outcome(&report.outcome)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_experiment::PassFeatures;
    use tracktwin_signal::Features;

    fn finished(campaign: &str, cases: usize) -> Finished {
        let report = CaseReport {
            index: 0,
            epoch: 1,
            parameter_hash: String::new(),
            duration_s: 0.0,
            outcome: Outcome::Finished(Vec::new()),
            checksum: String::new(),
        };
        Finished {
            campaign: campaign.to_owned(),
            experiment_hash: String::new(),
            reports: vec![report; cases],
            traceparents: Vec::new(),
        }
    }

    #[test]
    fn groups_of_one_campaign_share_a_report_of_bounded_size() {
        let mut together = finished("a", 8);
        assert!(together.join(finished("a", 8)).is_none());
        assert!(together.join(finished("b", 8)).is_some());
        assert!(together.join(finished("a", CASES_A_REPORT)).is_some());
        assert_eq!(together.reports.len(), 16);
    }

    #[test]
    fn groups_of_long_spectra_share_none() {
        let long = || {
            let log_power = vec![0.0; NUMBERS_A_REPORT / 8];
            let features = Features { log_power, band_levels_db: Vec::new() };
            let mut finished = finished("a", 7);
            for report in &mut finished.reports {
                let pass = PassFeatures {
                    speed_km_h: 7.0,
                    features: features.clone(),
                    contact_loss_share: None,
                };
                report.outcome = Outcome::Finished(vec![pass]);
            }
            finished
        };
        assert!(long().join(long()).is_some());
    }
}
