//! Settings of a dispatch.

use std::sync::Arc;
use std::time::Duration;
use tracktwin_experiment::{Prepare, prepare_simulation};
use tracktwin_worker::Holdings;

/// Tells the time in ms since 1970.
pub type Clock = Arc<dyn Fn() -> i64 + Send + Sync>;

/// How long leases last, and what follows from it.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// A lease that is not renewed for so long has lost its worker.
    pub lease: Duration,
    /// How often workers renew.
    pub heartbeat: Duration,
    /// When a worker that got no cases asks again.
    pub retry: Duration,
}

impl Default for Timing {
    /// Three heartbeats may be lost; a dead worker's cases go to others within 12 s.
    fn default() -> Self {
        Self::of_lease(Duration::from_secs(12))
    }
}

impl Timing {
    /// The timing that goes with leases of this length.
    pub fn of_lease(lease: Duration) -> Self {
        Self { lease, heartbeat: lease / 4, retry: (lease / 24).min(Duration::from_millis(500)) }
    }
}

/// The part of a library that is leased.
#[derive(Clone, Debug)]
pub struct Scope {
    /// This campaign only.
    pub campaign: String,
    /// Its cases with a smaller index.
    pub cases: u32,
}

/// Settings of a dispatch.
#[derive(Clone)]
pub struct Settings {
    /// How long leases last.
    pub timing: Timing,
    /// What is leased; all running campaigns if `None`.
    pub scope: Option<Scope>,
    /// Share of the cases that are simulated again by another worker, 0 to 1.
    pub audit_share: f64,
    /// Whether a worker is suspended if its cases fail and those of others do not.
    pub suspends_failing: bool,
    /// Prepares the simulation that decides between two workers that differ.
    pub prepare: Prepare,
    /// The clock that leases go by; the library's if none.
    pub clock: Option<Clock>,
    /// Cases held by the worker of this process, if there is one: their leases do not expire while
    /// it holds them, even on a busy machine.
    pub own: Option<Holdings>,
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
        }
    }
}
