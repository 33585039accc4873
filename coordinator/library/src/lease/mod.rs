//! Leases: leasing, renewal and release of cases.

mod hold;
mod lease_cases;
mod queue_cursor;

pub(crate) use queue_cursor::QueueCursor;

use crate::{AttemptsMax, Library, LibraryError};
use hold::{Release, ReleaseAll, Renew};
use lease_cases::LeaseCases;
use std::collections::HashMap;
use tracktwin_parameters::Case;

/// A worker's request for cases.
#[derive(Clone, Debug)]
pub struct LeaseRequest {
    /// Campaign of the cases. If `None`, the running campaign with the highest priority is used, the oldest
    /// among equals.
    pub campaign: Option<String>,
    /// Only cases with an index below this number are leased.
    pub indices_below: u32,
    /// Name of the worker.
    pub worker: String,
    /// Maximum number of cases of a campaign that is not in `cases_max_of`.
    pub cases_max: u32,
    /// Maximum number of cases of these campaigns, by id.
    pub cases_max_of: HashMap<String, u32>,
    /// Leases of this worker that are known to be held, because the worker runs in this process. They
    /// belong to `campaign`. They do not expire, even if heartbeats are late.
    pub held: Vec<Held>,
    /// Present time of the library's clock, in ms since 1970.
    pub now_unix_ms: i64,
    /// Duration of the lease without renewal, in ms.
    pub lease_ms: i64,
    /// Limits of attempts for cases whose lease has expired.
    pub attempts_max: AttemptsMax,
    /// Number of attempts without result after which a case is leased alone. If such a case kills its
    /// workers, no other case is lost with it.
    pub alone_after: u32,
}

/// Cases leased to a worker, all of one campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Lease {
    /// Id of the campaign.
    pub campaign: String,
    /// The cases, by ascending index. There is at least one.
    pub cases: Vec<Leased>,
}

/// A case leased to a worker.
#[derive(Clone, Debug, PartialEq)]
pub struct Leased {
    /// The case.
    pub case: Case,
    /// Number of this lease of the case, from 1.
    pub epoch: u32,
}

/// A case together with one of its leases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Held {
    /// Index of the case in its campaign.
    pub index: u32,
    /// Number of the lease of this case, from 1.
    pub epoch: u32,
}

impl Library {
    /// Leases waiting cases of a running campaign to a worker, in ascending order of index. A worker in
    /// quarantine gets no cases.
    ///
    /// Expired leases are ended, and all cases are searched again, several times per lease duration and
    /// always before the function returns `None`.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn lease(&self, request: LeaseRequest) -> Result<Option<Lease>, LibraryError> {
        self.write(LeaseCases { request, cursor: self.cursor() }).await
    }

    /// Extends leases until `until_unix_ms`. Returns the leases that the worker has lost, because they
    /// expired or their campaign was cancelled. Leases that the worker ended itself, by a report or a
    /// release, are not returned.
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

    /// Releases cases that their worker did not begin. No attempt is counted.
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

    /// Releases all leases of a campaign. No attempt is counted.
    ///
    /// Only for a coordinator that is alone and whose workers end with it, so that no worker is running
    /// when it starts; see [`crate::Claim::is_exclusive`].
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_all(&self, campaign: &str) -> Result<(), LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        self.write(ReleaseAll { campaign: campaign.to_owned(), now_unix_ms }).await
    }
}
