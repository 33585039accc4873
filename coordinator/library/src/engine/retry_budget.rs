//! Time limit for retrying calls to an unavailable database.

use std::time::{Duration, Instant};

/// Long enough for the restart of a server, and short enough for a waiting caller.
const RETRY_BUDGET: Duration = Duration::from_secs(10);

/// The first pause; each later one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_millis(50);

/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// The error of a used-up retry budget.
pub(crate) struct Exhausted;

/// Pauses between attempts, within a limited total time.
pub(crate) struct RetryBudget {
    until: Instant,
    pause: Duration,
}

impl RetryBudget {
    /// Creates a retry budget; it is zero if `some` is false.
    pub(crate) fn new(some: bool) -> Self {
        let budget = if some { RETRY_BUDGET } else { Duration::ZERO };
        Self { until: Instant::now() + budget, pause: FIRST_PAUSE }
    }

    /// Waits before the next attempt. Returns an error if the budget is used up.
    pub(crate) async fn wait(&mut self) -> Result<(), Exhausted> {
        if Instant::now() + self.pause > self.until {
            return Err(Exhausted);
        }
        tokio::time::sleep(self.pause).await;
        self.pause = (2 * self.pause).min(LONGEST_PAUSE);
        Ok(())
    }
}
