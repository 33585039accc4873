//! Leases: handing cases out, keeping them, taking them back.

mod hold;
mod lease_cases;
mod queue_cursor;

pub(crate) use queue_cursor::QueueCursor;

use crate::{AttemptsMax, Library, LibraryError};
use hold::{Release, ReleaseAll, Renew};
use lease_cases::LeaseCases;
use tracktwin_parameters::Case;

/// A worker's wish for cases.
#[derive(Clone, Debug)]
pub struct LeaseRequest {
    /// Only cases of this campaign; else of the running one with the largest priority, the oldest
    /// among equals.
    pub campaign: Option<String>,
    /// Only cases with a smaller index.
    pub indices_below: u32,
    /// Who asks.
    pub worker: String,
    /// Most cases wanted.
    pub cases_max: u32,
    /// Leases of this worker and this campaign that are known to be held, because the worker runs in
    /// this very process: they last on, however late their heartbeats are.
    pub held: Vec<Held>,
    /// The library's clock.
    pub now_unix_ms: i64,
    /// How long the lease lasts without renewal.
    pub lease_ms: i64,
    /// When cases whose lease has expired are given up.
    pub attempts_max: AttemptsMax,
    /// Attempts without result after which a case is leased alone: if it kills its workers, no
    /// other case is lost with it.
    pub alone_after: u32,
}

/// Cases handed to a worker, all of one campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Lease {
    /// The campaign.
    pub campaign: String,
    /// The cases, by ascending index; at least one.
    pub cases: Vec<Leased>,
}

/// A case handed to a worker.
#[derive(Clone, Debug, PartialEq)]
pub struct Leased {
    /// The case.
    pub case: Case,
    /// Which lease of this case it is, from 1.
    pub epoch: u32,
}

/// A case under a certain lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Held {
    /// Place in the campaign.
    pub index: u32,
    /// Which lease of the case.
    pub epoch: u32,
}

impl Library {
    /// Leases waiting cases of a running campaign to a worker, in ascending order of index. A worker in
    /// quarantine gets no cases.
    ///
    /// Several times per lease duration, and always before it returns no lease, the function ends expired
    /// leases and searches for cases that wait again.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn lease(&self, request: LeaseRequest) -> Result<Option<Lease>, LibraryError> {
        self.write(LeaseCases { request, cursor: self.cursor() }).await
    }

    /// Lets leases last until `until_unix_ms`; answers those that were taken from the worker: they
    /// expired, or their campaign was cancelled. A lease that the worker ended itself, by a report or by
    /// giving the case back, is not among them.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn renew(
        &self,
        campaign: &str,
        worker: &str,
        held: Vec<Held>,
        until_unix_ms: i64,
    ) -> Result<Vec<Held>, LibraryError> {
        let (campaign, worker) = (campaign.to_owned(), worker.to_owned());
        self.write(Renew { campaign, worker, held, until_unix_ms }).await
    }

    /// Takes back cases that their worker did not begin; no attempt is counted.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release(
        &self,
        campaign: &str,
        worker: &str,
        held: Vec<Held>,
    ) -> Result<(), LibraryError> {
        let (campaign, worker) = (campaign.to_owned(), worker.to_owned());
        let now_unix_ms = self.now_unix_ms();
        self.write(Release { campaign, worker, held, now_unix_ms }).await
    }

    /// Takes back every lease of a campaign; no attempt is counted.
    ///
    /// For a coordinator whose workers die with it, so that none can be alive when it starts, and
    /// that is alone: see [`crate::Claim::is_exclusive`].
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_all(&self, campaign: &str) -> Result<(), LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        self.write(ReleaseAll { campaign: campaign.to_owned(), now_unix_ms }).await
    }
}
