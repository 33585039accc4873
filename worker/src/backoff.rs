//! Waiting times between retries.

use std::hash::{BuildHasher, DefaultHasher, Hash, Hasher, RandomState};
use std::time::Duration;
use tracktwin_parameters::unit;

/// The first wait.
const FIRST: Duration = Duration::from_millis(100);

/// The longest wait. After a restart of the coordinator all workers are connected again within this
/// time.
const LONGEST: Duration = Duration::from_secs(4);

/// Waiting times that double up to a limit and differ from worker to worker.
///
/// They depend only on the name of the worker, so that a simulated network is reproducible.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Backoff {
    seed: u64,
    tries: u32,
}

impl Backoff {
    /// The waits of a worker.
    pub(crate) fn of(worker: &str) -> Self {
        Self { seed: hash(worker), tries: 0 }
    }

    /// The next wait: between half and all of a bound that doubles with every try.
    pub(crate) fn next(&mut self) -> Duration {
        let bound = FIRST.saturating_mul(2_u32.saturating_pow(self.tries)).min(LONGEST);
        let jitter = unit(hash((self.seed, self.tries)));
        self.tries = self.tries.saturating_add(1);
        bound.mul_f64(0.5 + 0.5 * jitter)
    }
}

/// A hash that is equal for equal input in every process.
fn hash(input: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    input.hash(&mut hasher);
    hasher.finish()
}

/// A number in [0, 1) from the system's randomness. It makes names, never results.
pub(crate) fn random_unit() -> f64 {
    unit(RandomState::new().hash_one(()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_the_bound_and_not_beyond() {
        let mut backoff = Backoff::of("w");
        assert!((FIRST / 2..=FIRST).contains(&backoff.next()));
        let waits: Vec<_> = std::iter::repeat_with(|| backoff.next()).take(40).collect();
        assert!(waits.iter().all(|wait| *wait <= LONGEST));
        assert!(waits[30..].iter().all(|wait| *wait >= LONGEST / 2));
    }

    #[test]
    fn no_two_workers_wait_alike() {
        assert_ne!(Backoff::of("a").next(), Backoff::of("b").next());
    }
}
