//! How long a database that is away is waited for.

use std::time::{Duration, Instant};

/// Long enough for a server that is restarted, short enough for those who wait for an answer.
const RETRY_BUDGET: Duration = Duration::from_secs(10);

/// The first pause; each later one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_millis(50);

/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// Patience has run out.
pub(crate) struct Exhausted;

/// Pauses between attempts, until it is enough.
pub(crate) struct RetryBudget {
    until: Instant,
    pause: Duration,
}

impl RetryBudget {
    /// None at all unless `some`.
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
