//! Failures of the library in calls of workers: log lines of limited number, and the last outcome of each call.

use parking_lot::Mutex;
use std::collections::{BTreeMap, HashMap};
use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tonic::Status;
use tracktwin_library::LibraryError;

/// Interval of log lines with the same reason. Every worker repeats a failed call.
const TELL_EVERY: Duration = Duration::from_secs(30);

/// Calls of workers that write to the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WorkerCall {
    /// Registration of a worker.
    Register,
    /// Request for cases.
    Lease,
    /// Note that a worker is alive, in any call.
    Heartbeat,
    /// Renewal of leases.
    Renew,
    /// Report of results.
    Report,
}

/// Outcome of a call since it was last looked at; `None` if the library responded without an error.
pub type LastOutcome = (WorkerCall, Option<LibraryError>);

/// The last outcomes of the workers' calls, for the supervisor of a farm in one process. Clones share them.
#[derive(Clone, Default)]
pub struct LibraryFaults(Arc<Mutex<HashMap<WorkerCall, Option<LibraryError>>>>);

impl LibraryFaults {
    /// Returns the outcomes since the last call of this function.
    pub fn take(&self) -> Vec<LastOutcome> {
        self.0.lock().drain().collect()
    }

    /// Records the outcome of a call, and converts its error to a status.
    pub(crate) fn note<T>(
        &self,
        call: WorkerCall,
        outcome: Result<T, LibraryError>,
    ) -> Result<T, Status> {
        let (outcome, error) = match outcome {
            Ok(answer) => (Ok(answer), None),
            Err(error) => (Err(unavailable(&error)), Some(error)),
        };
        self.0.lock().insert(call, error);
        outcome
    }
}

/// Status for a failed library call. The worker repeats the call; the coordinator logs the error, once every
/// [`TELL_EVERY`] for each reason.
pub(crate) fn unavailable(error: &LibraryError) -> Status {
    let reason = error.to_string();
    if is_news(&reason, Instant::now()) {
        tracing::error!(error = error as &dyn Error, "library request failed");
    }
    Status::unavailable(reason)
}

/// Whether no line with this reason was logged within [`TELL_EVERY`].
pub(crate) fn is_news(reason: &str, now: Instant) -> bool {
    static TOLD: Mutex<BTreeMap<String, Instant>> = Mutex::new(BTreeMap::new());
    let mut told = TOLD.lock();
    told.retain(|_, at| now.saturating_duration_since(*at) < TELL_EVERY);
    if told.contains_key(reason) {
        return false;
    }
    told.insert(reason.to_owned(), now);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_logged_once_in_half_a_minute() {
        let now = Instant::now();
        assert!(is_news("the disk is full, for a test", now));
        assert!(!is_news("the disk is full, for a test", now + TELL_EVERY / 2));
        assert!(is_news("another reason, for a test", now + TELL_EVERY / 2));
        assert!(is_news("the disk is full, for a test", now + TELL_EVERY));
    }

    #[test]
    fn the_last_outcome_of_each_call_is_told_once() {
        let faults = LibraryFaults::default();
        let failed = faults.note::<()>(WorkerCall::Report, Err(LibraryError::DiskFull));
        assert_eq!(failed.unwrap_err().code(), tonic::Code::Unavailable);
        assert!(faults.note(WorkerCall::Lease, Err::<(), _>(LibraryError::Busy)).is_err());
        faults.note(WorkerCall::Lease, Ok(())).unwrap();
        let told = faults.take();
        let of = |call| &told.iter().find(|(known, _)| *known == call).unwrap().1;
        assert!(matches!(of(WorkerCall::Report), Some(LibraryError::DiskFull)));
        assert!(of(WorkerCall::Lease).is_none());
        assert!(faults.take().is_empty());
    }
}
