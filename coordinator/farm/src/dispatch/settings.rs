//! Settings of a dispatch.

use super::LibraryFaults;
use std::sync::Arc;
use std::time::Duration;
use tracktwin_experiment::{Prepare, prepare_simulation};
use tracktwin_worker::Holdings;

/// Returns the time in ms since 1970.
pub type Clock = Arc<dyn Fn() -> i64 + Send + Sync>;

/// Length of the leases, and the intervals derived from it.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Length of a lease without renewal. After this time the worker counts as lost.
    pub lease: Duration,
    /// Interval at which workers renew their leases.
    pub heartbeat: Duration,
    /// Pause before the next request of a worker that got no cases.
    pub retry: Duration,
}

impl Default for Timing {
    /// Leases of 12 s with heartbeats every 3 s: three heartbeats may be lost.
    fn default() -> Self {
        Self::of_lease(Duration::from_secs(12))
    }
}

impl Timing {
    /// The intervals that belong to leases of this length.
    pub fn of_lease(lease: Duration) -> Self {
        Self { lease, heartbeat: lease / 4, retry: (lease / 24).min(Duration::from_millis(500)) }
    }
}

/// The part of a library that is leased.
#[derive(Clone, Debug)]
pub struct Scope {
    /// Id of the campaign.
    pub campaign: String,
    /// Cases with an index below this number.
    pub cases: u32,
}

/// Settings of a dispatch.
#[derive(Clone)]
pub struct Settings {
    /// Length of the leases and the derived intervals.
    pub timing: Timing,
    /// What is leased; all running campaigns if `None`.
    pub scope: Option<Scope>,
    /// Share of the cases that are simulated again by another worker, 0 to 1.
    pub audit_share: f64,
    /// Whether a worker is suspended if its cases fail and the cases of other workers do not.
    pub suspends_failing: bool,
    /// Creates the simulator for the case whose two results differ in an audit.
    pub prepare: Prepare,
    /// The clock of the leases; the library's clock if `None`.
    pub clock: Option<Clock>,
    /// Cases held by the worker of this process, if there is such a worker. The leases of these cases do
    /// not expire, even if heartbeats are late on a busy machine.
    pub own: Option<Holdings>,
    /// Last outcomes of the calls that write to the library.
    pub faults: LibraryFaults,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            timing: Timing::default(),
            scope: None,
            audit_share: 0.0,
            suspends_failing: true,
            prepare: prepare_simulation,
            clock: None,
            own: None,
            faults: LibraryFaults::default(),
        }
    }
}
