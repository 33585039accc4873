//! Leases cases to workers.

use super::{Dispatch, unix_ms};
use crate::dispatch::campaigns::{DispatchError, Served};
use crate::dispatch::library_faults::{WorkerCall, unavailable};
use crate::dispatch::{ATTEMPTS_MAX, LeaseSizer, SUSPECT_AFTER};
use std::time::Duration;
use tokio::time::Instant;
use tonic::Status;
use tracktwin_library::{self as library, LeaseRequest};
use tracktwin_protocol::{CaseLease, Lease, LeasedCase};

/// Minimum pause before the next query, after the library had no waiting case.
const NOTHING: Duration = Duration::from_millis(100);

/// Maximum pause between the lease requests of an idle worker. It bounds the delay of a new campaign.
const WAIT_MAX: Duration = Duration::from_mins(1);

/// Target for the lease requests per second of all idle workers together.
const IDLE_CALLS_S: f64 = 400.0;

impl Dispatch {
    /// Leases cases to a worker that may get cases.
    pub(super) async fn hand_out(&self, worker: &str, cases_max: u32) -> Result<Lease, Status> {
        let audit = self.audits.lease(worker, cases_max, &self.campaigns).await;
        if let Some(lease) = audit.map_err(|error| unavailable(&error))? {
            return Ok(Lease::Cases(lease));
        }
        if self.had_nothing() {
            return Ok(self.none_now());
        }
        let scope = self.settings.scope.as_ref();
        let cores = self.roster.present().1;
        let request = LeaseRequest {
            campaign: scope.map(|scope| scope.campaign.clone()),
            indices_below: scope.map_or(u32::MAX, |scope| scope.cases),
            worker: worker.to_owned(),
            cases_max: cases_max.min(LeaseSizer::default().cases_per_lease(cores)),
            cases_max_of: self.campaigns.cases_per_lease(cores, cases_max),
            held: self.held_here(),
            now_unix_ms: self.now_unix_ms(),
            lease_ms: unix_ms(self.settings.timing.lease),
            attempts_max: ATTEMPTS_MAX,
            alone_after: SUSPECT_AFTER,
        };
        let leased = self.library.lease(request).await;
        let leased = self.settings.faults.note(WorkerCall::Lease, leased)?;
        let Some(leased) = leased else {
            let mut until = self.nothing_until.lock();
            *until = Some(Instant::now() + NOTHING.min(self.settings.timing.retry));
            return Ok(self.none_now());
        };
        match self.campaigns.of(&leased.campaign).await {
            Ok(served) => {
                self.counts.leased.inc_by(leased.cases.len() as u64);
                let cases = leased.cases.into_iter();
                let cases = cases.map(|it| LeasedCase { case: it.case, epoch: it.epoch });
                Ok(Lease::Cases(served.lease(cases.collect())))
            }
            Err(error) => {
                self.take_back(worker, &leased, &error).await;
                Err(Status::unavailable(error.to_string()))
            }
        }
    }

    /// Releases leased cases that cannot be handed out. A campaign that this version cannot serve is paused, so
    /// that other campaigns are served. After an error of the library the next request may succeed.
    async fn take_back(&self, worker: &str, leased: &library::Lease, error: &DispatchError) {
        let campaign = &leased.campaign;
        let held = leased.cases.iter();
        let held = held.map(|it| library::Held { index: it.case.index, epoch: it.epoch });
        let released = self.library.release(campaign, worker, held.collect()).await;
        if !error.is_lasting() {
            tracing::error!("cannot lease cases of campaign {campaign}: {error} ({released:?})");
            return;
        }
        let paused = self.library.pause(campaign).await;
        tracing::error!(
            "campaign {campaign} is paused, because this version cannot serve it ({error}); use the version \
             that added it, or repair the library and resume the campaign ({released:?}, {paused:?})"
        );
    }

    /// Cases of the campaign that the worker of this process holds.
    fn held_here(&self) -> Vec<library::Held> {
        let (Some(own), Some(scope)) = (&self.settings.own, &self.settings.scope) else {
            return Vec::new();
        };
        let held = own.of(&scope.campaign).into_iter();
        held.map(|(index, epoch)| library::Held { index, epoch }).collect()
    }

    fn had_nothing(&self) -> bool {
        let until = self.nothing_until.lock();
        until.is_some_and(|until| until > Instant::now())
    }

    /// Response without cases. The pause it contains is longer if more workers are present.
    fn none_now(&self) -> Lease {
        let (workers, cores) = self.roster.present();
        let crowd = f64::from(cores).max(workers as f64) / IDLE_CALLS_S;
        let wait = crowd.min(WAIT_MAX.as_secs_f64());
        let retry_after_s = self.settings.timing.retry.as_secs_f64().max(wait);
        Lease::NoneNow { retry_after_s, reason: None }
    }
}

impl Served {
    /// The lease message with these cases.
    pub(crate) fn lease(&self, cases: Vec<LeasedCase>) -> CaseLease {
        CaseLease {
            campaign: self.record.id.clone(),
            experiment_json: self.record.experiment_json.clone(),
            experiment_hash: self.record.experiment_hash.clone(),
            cases,
            traceparent: String::new(),
        }
    }
}
