//! How long to wait before the next try.

use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// The first wait.
const FIRST: Duration = Duration::from_millis(100);

/// The longest: a coordinator that is back has its workers back within this.
const LONGEST: Duration = Duration::from_secs(4);

/// Waits that double, up to a bound, and differ from worker to worker.
#[derive(Debug, Default)]
pub(crate) struct Backoff {
    tries: u32,
}

impl Backoff {
    /// The next wait: between half and all of a bound that doubles with every try.
    pub(crate) fn next(&mut self) -> Duration {
        let bound = FIRST.saturating_mul(2_u32.saturating_pow(self.tries)).min(LONGEST);
        self.tries = self.tries.saturating_add(1);
        bound.mul_f64(0.5 + 0.5 * random_unit())
    }
}

/// A number in [0, 1) from the system's randomness. It spreads waits and names, never results.
pub(crate) fn random_unit() -> f64 {
    let random = RandomState::new().hash_one(());
    (random >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_the_bound_and_not_beyond() {
        let mut backoff = Backoff::default();
        assert!((FIRST / 2..=FIRST).contains(&backoff.next()));
        let waits: Vec<_> = std::iter::repeat_with(|| backoff.next()).take(40).collect();
        assert!(waits.iter().all(|wait| *wait <= LONGEST));
        assert!(waits[30..].iter().all(|wait| *wait >= LONGEST / 2));
    }

    #[test]
    fn no_two_workers_wait_alike() {
        assert_ne!(Backoff::default().next(), Backoff::default().next());
    }
}
