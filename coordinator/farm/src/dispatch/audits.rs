//! Audits: a second worker simulates a share of the finished cases again, and the results are compared.
//!
//! The worker cannot distinguish an audit from an ordinary case. If two results differ, the coordinator
//! simulates the case itself and determines which worker is wrong. A simulation that failed proves nothing:
//! another worker repeats it, and after too many failures the coordinator.

use super::FAILURES_MAX;
use super::campaigns::{Campaigns, Served};
use super::settings::Settings;
use parking_lot::Mutex;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::Instant;
use tracktwin_experiment::{Case, Outcome, Prepare};
use tracktwin_library::{Audit, AuditFinding, Library, LibraryError};
use tracktwin_protocol::{CaseLease, CaseReport, LeasedCase};
use tracktwin_signal::Features;

/// The epoch of audited cases. The epochs of ordinary leases start at 1.
const EPOCH: u32 = 0;

/// Kind of a lease, determined by its epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LeaseKind {
    /// A case that was waiting.
    Case,
    /// A finished case that is simulated again for an audit.
    Audit,
}

impl LeaseKind {
    pub(crate) const fn of(epoch: u32) -> Self {
        if epoch == EPOCH { Self::Audit } else { Self::Case }
    }
}

/// Maximum difference of a one-third-octave level or of a bin's power between two correct workers, in dB.
///
/// Correct machines differ only by rounding, if their vector units add in a different order. This
/// difference is far below 0.01 dB. The random surface causes an uncertainty of about 0.3 dB in a level.
const TOLERANCE_DB: f64 = 0.05;

/// Difference in dB of powers whose natural logarithms differ by 1.
const DB_PER_LN: f64 = 10.0 * std::f64::consts::LOG10_E;

/// Number of cases of an audit lease: one group.
const CASES: u32 = tracktwin_worker::agent::GROUP as u32;

/// Minimum pause before the next search of a worker, after a search found no case that it could audit; of all
/// workers, if there was no open audit at all.
const PAUSE: Duration = Duration::from_secs(2);

/// Leases audits and compares their results.
pub(crate) struct Audits {
    library: Library,
    share: f64,
    prepare: Prepare,
    lease_ms: i64,
    /// Number of failed simulations of open audits, by campaign and index.
    failures: Mutex<HashMap<(String, u32), u32>>,
    pauses: Mutex<Pauses>,
}

/// Times before which no audits are searched for.
#[derive(Default)]
struct Pauses {
    of_all: Option<Instant>,
    of_worker: HashMap<String, Instant>,
}

impl Pauses {
    /// Whether a search for a worker is due. If it is, the next one is due after [`PAUSE`].
    fn is_due(&mut self, worker: &str, now: Instant) -> bool {
        let is_over = |until: Option<&Instant>| until.is_none_or(|until| *until <= now);
        if !is_over(self.of_all.as_ref()) || !is_over(self.of_worker.get(worker)) {
            return false;
        }
        self.of_worker.retain(|_, until| *until > now);
        self.of_worker.insert(worker.to_owned(), now + PAUSE);
        true
    }
}

impl Audits {
    pub(crate) fn new(library: Library, settings: &Settings) -> Self {
        let Settings { audit_share, prepare, timing, .. } = settings;
        Self {
            library,
            share: *audit_share,
            prepare: *prepare,
            lease_ms: i64::try_from(timing.lease.as_millis()).unwrap_or(i64::MAX),
            failures: Mutex::default(),
            pauses: Mutex::default(),
        }
    }

    /// Leases at most `cases_max` cases to a worker for an audit; `None` if there are no such cases.
    pub(crate) async fn lease(
        &self,
        worker: &str,
        cases_max: u32,
        campaigns: &Campaigns,
    ) -> Result<Option<CaseLease>, LibraryError> {
        if self.share <= 0.0 || !self.pauses.lock().is_due(worker, Instant::now()) {
            return Ok(None);
        }
        let cases_max = cases_max.min(CASES);
        for campaign in self.library.campaigns().await? {
            // One that this version can't do must not hold up the others.
            let Ok(served) = campaigns.of(&campaign.id).await else { continue };
            let sample =
                self.library.audit_sample(&campaign.id, worker, cases_max, self.lease_ms).await?;
            if sample.is_empty() {
                continue;
            }
            let cases = sample.into_iter().map(|it| LeasedCase { case: it.case, epoch: EPOCH });
            self.pauses.lock().of_worker.remove(worker);
            return Ok(Some(served.lease(cases.collect())));
        }
        if !self.library.has_open_audits().await? {
            self.pauses.lock().of_all = Some(Instant::now() + PAUSE);
        }
        Ok(None)
    }

    /// Renews the leases of audits.
    pub(crate) async fn renew(
        &self,
        worker: &str,
        campaign: &str,
        indices: Vec<u32>,
    ) -> Result<(), LibraryError> {
        self.library.renew_audits(campaign, worker, indices, self.lease_ms).await
    }

    /// Counts a failed simulation of an audit; returns whether workers must not try it again.
    fn has_failed_too_often(&self, audit: &Audit) -> bool {
        let mut failures = self.failures.lock();
        let count = failures.entry((audit.campaign.clone(), audit.case.index)).or_insert(0);
        *count += 1;
        *count >= FAILURES_MAX
    }

    /// Compares the result of an auditing worker with the stored result, and returns the outcome; `None` if
    /// this worker has no such audit. If the worker failed, the audit is released.
    ///
    /// The comparison is completed even if the caller is dropped.
    pub(crate) async fn report(
        self: &Arc<Self>,
        worker: &str,
        served: &Arc<Served>,
        report: CaseReport,
    ) -> Result<Option<AuditOutcome>, LibraryError> {
        let (campaign, index) = (&served.record.id, report.index);
        let Some(audit) = self.library.leased_audit(campaign, index, worker).await? else {
            return Ok(None);
        };
        if let Outcome::Failed { reason } = &report.outcome
            && !self.has_failed_too_often(&audit)
        {
            tracing::warn!(worker, "audit of case {index} of {campaign} failed: {reason}");
            self.library.release_audits(campaign, worker, vec![index]).await?;
            return Ok(Some(AuditOutcome::Failed));
        }
        let (this, worker, served) = (self.clone(), worker.to_owned(), served.clone());
        let compare = async move { this.compare(&worker, served, &audit, &report.outcome).await };
        tokio::spawn(compare).await.expect("comparing does not panic")
    }

    async fn compare(
        &self,
        worker: &str,
        served: Arc<Served>,
        audit: &Audit,
        outcome: &Outcome,
    ) -> Result<Option<AuditOutcome>, LibraryError> {
        let (campaign, index) = (&audit.campaign, audit.case.index);
        let Some(entry) = self.library.entry(campaign, index).await? else { return Ok(None) };
        let differs = |found: &Outcome| difference(&entry.features, found) > TOLERANCE_DB;
        let judged =
            if differs(outcome) { self.judge(served, audit.case.clone()).await } else { None };
        // Where the worker failed, the coordinator is the second to simulate the case.
        let (second, found) = match (outcome, &judged) {
            (Outcome::Failed { .. }, Some(judged)) => ("the coordinator", judged),
            _ => (worker, outcome),
        };
        let difference_db = difference(&entry.features, found);
        let agrees = !differs(found);
        let stored_is_wrong = judged.as_ref().map(differs);
        let wrong = stored_is_wrong.filter(|_| !agrees);
        let wrong = wrong.map(|stored| if stored { audit.worker.as_str() } else { worker });
        let reason = format!(
            "case {index} of {campaign} by {} and {second} differs by {difference_db:.2} dB",
            audit.worker
        );
        let finding = AuditFinding { agrees, difference_db };
        let blame = wrong.map(|wrong| (wrong, reason.as_str()));
        let kept = self.library.audited(campaign, index, worker, finding, blame).await?;
        self.failures.lock().remove(&(campaign.clone(), index));
        if agrees || kept.is_none() {
            return Ok(Some(AuditOutcome::Agreement));
        }
        let Some(wrong) = wrong else {
            tracing::error!(
                "{reason}; this machine could not simulate the case, so no worker is quarantined"
            );
            return Ok(Some(AuditOutcome::Unjudged));
        };
        tracing::error!(worker = wrong, "quarantined: {reason}");
        Ok(Some(AuditOutcome::Wrong { worker: wrong.to_owned(), reason }))
    }

    /// Simulates the case in this process; `None` if this fails.
    async fn judge(&self, served: Arc<Served>, case: Case) -> Option<Outcome> {
        let prepare = self.prepare;
        let simulate = move || {
            let simulation = prepare(&served.experiment).ok()?;
            simulation.simulate(&[case]).pop().filter(|it| matches!(it, Outcome::Finished(_)))
        };
        tokio::task::spawn_blocking(simulate).await.ok().flatten()
    }
}

/// Outcome of an audit.
pub(crate) enum AuditOutcome {
    /// The auditor could not simulate the case, and another worker will.
    Failed,
    /// Both results agree, or the audit was completed before.
    Agreement,
    /// The results differ, and the coordinator could not determine which worker is wrong.
    Unjudged,
    /// A worker was wrong and is now in quarantine.
    Wrong {
        /// Name of the worker.
        worker: String,
        /// Reason of the quarantine.
        reason: String,
    },
}

/// Largest difference of a one-third-octave level or of a bin's power, on which models are trained, between the
/// stored and the new result, in dB.
fn difference(stored: &[Features], found: &Outcome) -> f64 {
    let Outcome::Finished(passes) = found else { return f64::INFINITY };
    if passes.len() != stored.len() {
        return f64::INFINITY;
    }
    let largest = |stored: &[f64], found: &[f64]| {
        stored.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let pairs = stored.iter().zip(passes.iter().map(|pass| &pass.features));
    let of_pass = pairs.map(|(stored, found)| {
        let levels_db = largest(&stored.band_levels_db, &found.band_levels_db);
        levels_db.max(DB_PER_LN * largest(&stored.log_power, &found.log_power))
    });
    of_pass.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_experiment::PassFeatures;

    #[test]
    fn a_worker_that_finds_nothing_pauses_and_the_others_search_on() {
        let (mut pauses, now) = (Pauses::default(), Instant::now());
        assert!(pauses.is_due("first", now));
        assert!(!pauses.is_due("first", now) && pauses.is_due("second", now));
        assert!(pauses.is_due("first", now + PAUSE));
        assert_eq!(pauses.of_worker.len(), 1, "what is over is forgotten");
        pauses.of_all = Some(now + 2 * PAUSE);
        assert!(!pauses.is_due("third", now + PAUSE) && pauses.is_due("third", now + 2 * PAUSE));
    }

    #[test]
    fn outcomes_differ_by_their_worst_level() {
        let features =
            |levels: [f64; 2]| Features { log_power: vec![0.0], band_levels_db: levels.to_vec() };
        let pass = |levels| PassFeatures {
            speed_km_h: 7.0,
            features: features(levels),
            contact_loss_share: None,
        };
        let stored = [features([1.0, 2.0]), features([3.0, 4.0])];
        let found = Outcome::Finished(vec![pass([1.0, 2.5]), pass([2.8, 4.0])]);
        assert!((difference(&stored, &found) - 0.5).abs() < 1e-12);
        let short = Outcome::Finished(vec![pass([1.0, 2.0])]);
        assert_eq!(difference(&stored, &short), f64::INFINITY);
        let failed = Outcome::Failed { reason: "?".to_owned() };
        assert_eq!(difference(&stored, &failed), f64::INFINITY);
    }

    #[test]
    fn the_powers_that_models_are_trained_on_are_compared_too() {
        let features = |ln: f64| Features { log_power: vec![2.0, ln], band_levels_db: vec![1.0] };
        let pass = PassFeatures {
            speed_km_h: 7.0,
            features: features(3.0 + 0.1 * std::f64::consts::LN_10),
            contact_loss_share: None,
        };
        let found = Outcome::Finished(vec![pass]);
        assert!((difference(&[features(3.0)], &found) - 1.0).abs() < 1e-12);
    }
}
