//! The library's clock.

use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// After so long a server is asked for its time again, for no two clocks run equally fast.
const READ_EVERY: Duration = Duration::from_mins(1);

/// The clock of leases: this machine's with `SQLite`, the server's with PostgreSQL, so that
/// coordinators agree on the end of a lease, independent of their own clocks.
pub(crate) enum Clock {
    Machine,
    Server(Mutex<Reading>),
}

/// Last reading of the server's clock, and its local time.
pub(crate) struct Reading {
    unix_ms: i64,
    at: Instant,
}

impl Clock {
    /// A server's clock with its present reading.
    pub(super) fn server(unix_ms: i64) -> Self {
        Self::Server(Mutex::new(Reading { unix_ms, at: Instant::now() }))
    }

    /// The time now, in ms since 1970.
    pub(crate) fn unix_ms(&self) -> i64 {
        match self {
            Self::Machine => {
                let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                ms(since)
            }
            Self::Server(reading) => {
                let reading = reading.lock().expect("nobody panics while holding it");
                reading.unix_ms.saturating_add(ms(reading.at.elapsed()))
            }
        }
    }

    /// Whether the server is to be asked again.
    pub(super) fn is_old(&self) -> bool {
        match self {
            Self::Machine => false,
            Self::Server(reading) => {
                let reading = reading.lock().expect("nobody panics while holding it");
                reading.at.elapsed() >= READ_EVERY
            }
        }
    }

    /// Takes a reading of the server's clock.
    pub(super) fn set(&self, unix_ms: i64) {
        if let Self::Server(reading) = self {
            let reading = &mut *reading.lock().expect("nobody panics while holding it");
            *reading = Reading { unix_ms, at: Instant::now() };
        }
    }
}

fn ms(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
