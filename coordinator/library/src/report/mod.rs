//! Reports of workers. The first result of each case is stored; later results change nothing.
//!
//! This module defines a report; the module `record` makes its changes.

mod record;

use crate::{AttemptsMax, Library, LibraryError};
use tracktwin_protocol::CaseReport;

/// Report of a worker on a group of cases.
#[derive(Clone, Debug)]
pub struct Report {
    /// Id of the campaign.
    pub campaign: String,
    /// Name of the worker.
    pub worker: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Hash of the worker's physics.
    pub model_hash: String,
    /// Hash of the experiment that the worker simulated.
    pub experiment_hash: String,
    /// Speeds of the experiment in km/h; every case has one pass per speed.
    pub speeds_km_h: Vec<f64>,
    /// Outcome of each case, with the worker's checksum.
    pub cases: Vec<CaseReport>,
    /// Present time of the library's clock, in ms since 1970.
    pub now_unix_ms: i64,
    /// Limits of attempts for cases that could not be simulated.
    pub attempts_max: AttemptsMax,
    /// Share of the stored cases that another worker simulates again, 0 to 1.
    pub audit_share: f64,
}

/// How the library treated the report of one case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportVerdict {
    /// The result or failure was stored.
    Stored,
    /// A result was already stored; nothing changed.
    Duplicate,
    /// The report was a failure of a lease that has ended; nothing changed.
    Late,
    /// The report was refused: the case does not exist, was never leased to this worker under this epoch, or
    /// has other parameters. Nothing changed, except that a case of the worker's present lease with other
    /// parameters is given up.
    Refused,
}

impl Library {
    /// Stores the report of a worker. Returns one verdict per case. A repeated call changes nothing.
    ///
    /// A result is stored if the case has none, even after the lease has expired, because every worker
    /// computes the same result. A failure counts only under the lease in which it happened.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library cannot be written; then nothing is stored.
    pub async fn report(&self, report: Report) -> Result<Vec<ReportVerdict>, LibraryError> {
        self.write(report).await
    }
}
