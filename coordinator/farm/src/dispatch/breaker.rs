//! Circuit breaker: it suspends a worker whose cases fail repeatedly, because its machine may be faulty.

use std::time::Duration;
use tokio::time::Instant;

/// Failures in a row after which a worker is suspended: one group of cases.
const FAILURES_IN_A_ROW: u32 = 8;

/// Length of the first suspension; each further one is twice as long.
const FIRST: Duration = Duration::from_secs(15);

/// The longest suspension. A repaired machine gets cases again after at most this time.
const LONGEST: Duration = Duration::from_mins(10);

/// The circuit breaker of one worker.
#[derive(Clone, Copy, Debug, Default)]
pub struct Breaker {
    failures_in_a_row: u32,
    openings: u32,
    open_until: Option<Instant>,
}

impl Breaker {
    /// Records the outcomes of the worker's cases, in order; true is a failure.
    pub fn reported(&mut self, failed: impl IntoIterator<Item = bool>) {
        for failed in failed {
            if failed {
                self.failures_in_a_row += 1;
            } else {
                *self = Self::default();
            }
        }
    }

    /// Whether the worker should be suspended: too many failures in a row, or one after a suspension.
    pub const fn is_failing(&self) -> bool {
        // After a suspension one further failure suffices.
        self.failures_in_a_row >= FAILURES_IN_A_ROW
            || (self.openings > 0 && self.failures_in_a_row > 0)
    }

    /// Suspends the worker from `now`; after the suspension the worker gets one case as a trial.
    pub fn open(&mut self, now: Instant) {
        let wait = FIRST.saturating_mul(2_u32.saturating_pow(self.openings)).min(LONGEST);
        self.openings = self.openings.saturating_add(1);
        self.failures_in_a_row = 0;
        self.open_until = Some(now + wait);
    }

    /// Remaining time of the suspension; `None` if the worker is not suspended.
    pub fn open_for(&self, now: Instant) -> Option<Duration> {
        let left = self.open_until?.saturating_duration_since(now);
        (!left.is_zero()).then_some(left)
    }

    /// Whether the worker was suspended and has not finished a case since.
    pub const fn is_on_trial(&self) -> bool {
        self.openings > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_failures_in_a_row_are_too_many_and_one_success_forgives_them() {
        let mut breaker = Breaker::default();
        breaker.reported([true; 7]);
        assert!(!breaker.is_failing());
        breaker.reported([false, true]);
        assert!(!breaker.is_failing());
        breaker.reported([true; 7]);
        assert!(breaker.is_failing());
    }

    #[test]
    fn each_time_it_is_put_aside_for_twice_as_long_until_it_works_again() {
        let now = Instant::now();
        let mut breaker = Breaker::default();
        let mut waits = Vec::new();
        for _ in 0..8 {
            breaker.reported([true; 8]);
            breaker.open(now);
            waits.push(breaker.open_for(now).unwrap().as_secs());
        }
        assert_eq!(waits, [15, 30, 60, 120, 240, 480, 600, 600]);
        assert!(breaker.open_for(now + LONGEST).is_none() && breaker.is_on_trial());
        breaker.reported([true]);
        assert!(breaker.is_failing(), "a failed trial is enough");
        breaker.reported([false]);
        assert!(!breaker.is_on_trial() && breaker.open_for(now).is_none());
    }
}
