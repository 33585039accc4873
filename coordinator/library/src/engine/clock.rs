//! The library's clock.

use parking_lot::Mutex;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Interval of reading the server's time again, because two clocks never run at the same rate.
const READ_EVERY: Duration = Duration::from_mins(1);

/// The clock of leases. With `SQLite` it is the clock of this machine, with PostgreSQL that of the server.
/// Coordinators therefore agree on the end of a lease, independent of their own clocks.
pub(crate) enum Clock {
    Machine,
    Server(Mutex<Reading>),
}

/// Last reading of the server's clock, and the local time of this reading.
pub(crate) struct Reading {
    unix_ms: i64,
    at: Instant,
}

impl Clock {
    /// Creates the clock of a server from its present time.
    pub(super) fn server(unix_ms: i64) -> Self {
        Self::Server(Mutex::new(Reading { unix_ms, at: Instant::now() }))
    }

    /// The present time, in ms since 1970.
    pub(crate) fn unix_ms(&self) -> i64 {
        match self {
            Self::Machine => {
                let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                ms(since)
            }
            Self::Server(reading) => {
                let reading = reading.lock();
                reading.unix_ms.saturating_add(ms(reading.at.elapsed()))
            }
        }
    }

    /// Whether the server's time must be read again.
    pub(super) fn is_old(&self) -> bool {
        match self {
            Self::Machine => false,
            Self::Server(reading) => {
                let reading = reading.lock();
                reading.at.elapsed() >= READ_EVERY
            }
        }
    }

    /// Stores a new reading of the server's clock.
    pub(super) fn set(&self, unix_ms: i64) {
        if let Self::Server(reading) = self {
            let reading = &mut *reading.lock();
            *reading = Reading { unix_ms, at: Instant::now() };
        }
    }
}

fn ms(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
