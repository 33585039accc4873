//! Reports: the first result of each case is stored; later ones change nothing.
//!
//! Owns what a report is; what it changes is `record`'s.

mod record;

use crate::{AttemptsMax, Library, LibraryError};
use tracktwin_protocol::CaseReport;

/// Report of a worker.
#[derive(Clone, Debug)]
pub struct Report {
    /// The campaign.
    pub campaign: String,
    /// Who reports.
    pub worker: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Hash of the worker's physics.
    pub model_hash: String,
    /// Hash of the experiment.
    pub experiment_hash: String,
    /// The speeds of the experiment in km/h, as many as every case has passes.
    pub speeds_km_h: Vec<f64>,
    /// The cases, each with the checksum that came with it.
    pub cases: Vec<CaseReport>,
    /// The library's clock.
    pub now_unix_ms: i64,
    /// When cases that could not be simulated are given up.
    pub attempts_max: AttemptsMax,
    /// Share of the stored cases that another worker is to simulate again, 0 to 1.
    pub audit_share: f64,
}

/// What became of the report of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportVerdict {
    /// Stored.
    Stored,
    /// A result was there already; nothing changed.
    Duplicate,
    /// The failure of a lease that has ended; nothing changed.
    Late,
    /// No such case, never leased so to this worker, or other parameters than the case has; nothing
    /// changed.
    Refused,
}

impl Library {
    /// Stores what a worker reports, one verdict a case. Repeating it changes nothing.
    ///
    /// A result is stored if there is none yet, even when its lease has expired: it is the same
    /// result. A failure counts only under the lease it happened in.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written; then nothing is stored.
    pub async fn report(&self, report: Report) -> Result<Vec<ReportVerdict>, LibraryError> {
        self.write(report).await
    }
}
