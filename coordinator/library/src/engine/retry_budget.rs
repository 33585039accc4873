//! How long an unavailable database is retried.

use std::time::{Duration, Instant};

/// Long enough for the restart of a server, short enough for waiting callers.
const RETRY_BUDGET: Duration = Duration::from_secs(10);

/// The first pause; each later one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_millis(50);

/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// The retry budget is used up.
pub(crate) struct Exhausted;

/// Pauses between attempts, within the budget.
pub(crate) struct RetryBudget {
    until: Instant,
    pause: Duration,
}

impl RetryBudget {
    /// An empty budget unless `some`.
    pub(crate) fn new(some: bool) -> Self {
        let budget = if some { RETRY_BUDGET } else { Duration::ZERO };
        Self { until: Instant::now() + budget, pause: FIRST_PAUSE }
    }

    /// Pauses before another attempt.
    pub(crate) async fn wait(&mut self) -> Result<(), Exhausted> {
        if Instant::now() + self.pause > self.until {
            return Err(Exhausted);
        }
        tokio::time::sleep(self.pause).await;
        self.pause = (2 * self.pause).min(LONGEST_PAUSE);
        Ok(())
    }
}
