//! Cursor of the lease queries: lowest index of the waiting cases.

use parking_lot::Mutex;
use std::collections::HashMap;

/// Number of full scans per lease duration.
const LOOKS_PER_LEASE: i64 = 24;

/// Lowest index of each campaign at which a case may be waiting.
///
/// PostgreSQL keeps removed entries of an index until a vacuum, so a query for the first waiting case would
/// scan all cases finished since then. A lease query therefore starts at the cursor. Cases before the
/// cursor can become waiting again; a regular full scan finds them. The scan is needed because several
/// coordinators may serve a library, and none is informed of the cases released by the others.
#[derive(Debug, Default)]
pub(crate) struct QueueCursor(Mutex<CursorState>);

#[derive(Debug, Default)]
struct CursorState {
    looked_unix_ms: Option<i64>,
    first_waiting: HashMap<String, u32>,
}

impl QueueCursor {
    /// Whether a full scan is due; the caller must then run it.
    pub(super) fn is_due(&self, now_unix_ms: i64, lease_ms: i64) -> bool {
        let mut state = self.0.lock();
        let since_ms = state.looked_unix_ms.map(|looked| now_unix_ms.saturating_sub(looked));
        // A clock that was set back makes a full scan due.
        let is_due = since_ms.is_none_or(|since| since < 0 || since >= lease_ms / LOOKS_PER_LEASE);
        if is_due {
            *state =
                CursorState { looked_unix_ms: Some(now_unix_ms), first_waiting: HashMap::new() };
        }
        is_due
    }

    /// Invariant: no known case with a lower index is waiting.
    pub(super) fn first_waiting(&self, campaign: &str) -> u32 {
        let state = self.0.lock();
        state.first_waiting.get(campaign).copied().unwrap_or(0)
    }

    /// Moves the cursor after a scan from `from` found no waiting case before `to`. The cursor is kept if
    /// another scan has moved it in the meantime.
    pub(super) fn advance(&self, campaign: &str, from: u32, to: u32) {
        let mut state = self.0.lock();
        let first = state.first_waiting.entry(campaign.to_owned()).or_insert(0);
        if *first == from {
            *first = to;
        }
    }

    /// Makes a full scan due for the next lease.
    pub(super) fn forget(&self) {
        *self.0.lock() = CursorState::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_looked_at_from_time_to_time_and_when_the_clock_was_put_back() {
        let cursor = QueueCursor::default();
        assert!(cursor.is_due(1000, 240));
        assert!(!cursor.is_due(1009, 240));
        cursor.advance("a", 0, 7);
        assert_eq!((cursor.first_waiting("a"), cursor.first_waiting("b")), (7, 0));
        assert!(cursor.is_due(1010, 240));
        assert_eq!(cursor.first_waiting("a"), 0);
        assert!(cursor.is_due(900, 240));
        cursor.forget();
        assert!(cursor.is_due(901, 240));
    }

    #[test]
    fn whoever_began_elsewhere_moves_nothing() {
        let cursor = QueueCursor::default();
        cursor.advance("a", 0, 50);
        cursor.advance("a", 0, 100);
        assert_eq!(cursor.first_waiting("a"), 50);
        cursor.advance("a", 50, 60);
        assert_eq!(cursor.first_waiting("a"), 60);
    }
}
