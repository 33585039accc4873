//! Checks the reports of workers and stores them in the library.

use super::Dispatch;
use crate::dispatch::ATTEMPTS_MAX;
use crate::dispatch::audits::{AuditOutcome, LeaseKind};
use crate::dispatch::campaigns::Served;
use crate::dispatch::library_faults::{WorkerCall, unavailable};
use crate::dispatch::messages::verdict_message;
use crate::dispatch::roster::WorkerEligibility;
use std::sync::Arc;
use tonic::Status;
use tracktwin_experiment::Outcome;
use tracktwin_library::{Report, ReportVerdict};
use tracktwin_protocol::{CaseReport, farm};
use tracktwin_traces::Step;

impl Dispatch {
    /// Stores the checked reports, and compares the reports of audits. `None` is a report that was damaged
    /// in transmission; its worker must send it again. Returns one verdict per report.
    pub(super) async fn take_in(
        &self,
        worker: &str,
        eligibility: WorkerEligibility,
        served: &Arc<Served>,
        reports: Vec<Option<CaseReport>>,
        step: &Step,
    ) -> Result<Vec<farm::Verdict>, Status> {
        let mut verdicts = vec![farm::Verdict::Damaged; reports.len()];
        let (mut places, mut ordinary) = (Vec::new(), Vec::new());
        for (place, report) in reports.into_iter().enumerate() {
            let Some(report) = report else {
                tracing::warn!(
                    worker,
                    "a case was damaged in transmission; its worker must send it again"
                );
                self.counts.malformed.inc();
                continue;
            };
            match LeaseKind::of(report.epoch) {
                LeaseKind::Audit => {
                    verdicts[place] = verdict_message(self.audited(worker, served, report).await?);
                }
                LeaseKind::Case => {
                    places.push(place);
                    ordinary.push(report);
                }
            }
        }
        if !ordinary.is_empty() {
            let stored = self.store(worker, eligibility, served, ordinary, step).await?;
            self.count(&stored);
            for (place, verdict) in places.into_iter().zip(stored) {
                verdicts[place] = verdict_message(verdict);
            }
        }
        Ok(verdicts)
    }

    async fn store(
        &self,
        worker: &str,
        eligibility: WorkerEligibility,
        served: &Served,
        reports: Vec<CaseReport>,
        step: &Step,
    ) -> Result<Vec<ReportVerdict>, Status> {
        let ended = |it: &CaseReport| (matches!(it.outcome, Outcome::Failed { .. }), it.duration_s);
        let ended: Vec<_> = reports.iter().map(ended).collect();
        let step = Step::after("store", [&step.traceparent()]);
        let report = Report {
            campaign: served.record.id.clone(),
            worker: worker.to_owned(),
            code_version: eligibility.code_version,
            model_hash: eligibility.model_hash,
            experiment_hash: served.record.experiment_hash.clone(),
            speeds_km_h: served.shape.speeds_km_h.clone(),
            cases: reports,
            now_unix_ms: self.now_unix_ms(),
            attempts_max: ATTEMPTS_MAX,
            audit_share: self.settings.audit_share,
        };
        let verdicts = self.library.report(report).await.inspect_err(|error| {
            step.fail(&error.to_string());
        });
        let verdicts = self.settings.faults.note(WorkerCall::Report, verdicts)?;
        // Repeated reports count once.
        let stored =
            ended.iter().zip(&verdicts).filter(|(_, it)| matches!(it, ReportVerdict::Stored));
        let (failed, durations_s): (Vec<bool>, Vec<f64>) = stored.map(|(ended, _)| *ended).unzip();
        step.count("cases_stored", failed.len());
        drop(step);
        served.measured(durations_s);
        self.record_failures(worker, &failed);
        Ok(verdicts)
    }

    /// Records which of a worker's cases failed, and suspends a failing worker.
    fn record_failures(&self, worker: &str, failed: &[bool]) {
        if self.settings.suspends_failing && self.roster.reported(worker, failed) {
            tracing::warn!(
                worker,
                "worker suspended: its cases fail, those of other workers do not"
            );
            self.counts.suspended.inc();
        }
    }

    async fn audited(
        &self,
        worker: &str,
        served: &Arc<Served>,
        report: CaseReport,
    ) -> Result<ReportVerdict, Status> {
        let failed = matches!(report.outcome, Outcome::Failed { .. });
        let found = self.audits.report(worker, served, report).await;
        let Some(outcome) = found.map_err(|error| unavailable(&error))? else {
            self.counts.refused.inc();
            return Ok(ReportVerdict::Refused);
        };
        self.record_failures(worker, &[failed]);
        match outcome {
            AuditOutcome::Failed => {}
            AuditOutcome::Agreement => {
                self.counts.audited.inc();
            }
            AuditOutcome::Unjudged => {
                self.counts.audited.inc();
                self.counts.differed.inc();
            }
            AuditOutcome::Wrong { worker, reason } => {
                self.counts.audited.inc();
                self.counts.differed.inc();
                self.roster.set_quarantine(&worker, Some(reason));
            }
        }
        Ok(ReportVerdict::Duplicate)
    }

    fn count(&self, verdicts: &[ReportVerdict]) {
        for verdict in verdicts {
            match verdict {
                ReportVerdict::Stored => self.counts.stored.inc(),
                ReportVerdict::Duplicate => self.counts.duplicates.inc(),
                ReportVerdict::Late => self.counts.late.inc(),
                ReportVerdict::Refused => self.counts.refused.inc(),
            };
        }
    }
}
