//! Sums over reports: counts in the table `worker`, and the table `progress`.

use crate::engine::{Connection, Text, sql};
use crate::{LibraryError, Report, ReportVerdict};
use tracktwin_experiment::Outcome;

/// Length of the intervals of the table `progress`, in s.
pub(crate) const INTERVAL_S: i64 = 10;

/// Adds to the counts of worker $1. Returns the reason of its quarantine, if it is in quarantine.
const ADD_TO_WORKER: &str = "
    update worker set cases_finished = cases_finished + $2, cases_failed = cases_failed + $3, busy_s = busy_s + $4,
        failures_in_a_row = case when $2 > 0 then $5 else failures_in_a_row + $5 end,
        last_seen_unix_ms = case when last_seen_unix_ms < $6 then $6 else last_seen_unix_ms end
    where id = $1
    returning case when state = 'quarantined' then reason end as quarantine";

/// Adds to the progress of campaign $1 in interval $2. On a server, each connection adds to a separate row,
/// so that none waits for another.
const ADD_TO_PROGRESS: Text = Text::Each {
    sqlite: "
        insert into progress (campaign_id, from_unix_s, writer, finished, failed, busy_s)
        values ($1, $2, 0, $3, $4, $5)
        on conflict (campaign_id, from_unix_s, writer) do update set
            finished = progress.finished + excluded.finished,
            failed = progress.failed + excluded.failed,
            busy_s = progress.busy_s + excluded.busy_s",
    postgres: "
        insert into progress (campaign_id, from_unix_s, writer, finished, failed, busy_s)
        values ($1, $2, pg_backend_pid(), $3, $4, $5)
        on conflict (campaign_id, from_unix_s, writer) do update set
            finished = progress.finished + excluded.finished,
            failed = progress.failed + excluded.failed,
            busy_s = progress.busy_s + excluded.busy_s",
};

/// Contribution of one report.
pub(crate) struct Tally<'a> {
    report: &'a Report,
    finished: u32,
    failed: u32,
    busy_s: f64,
    /// Number of failures after the last finished case of the report.
    failed_since: u32,
}

impl<'a> Tally<'a> {
    /// Counts the results and failures that were stored.
    pub(crate) fn of(report: &'a Report, verdicts: &[ReportVerdict]) -> Self {
        let mut tally = Self { report, finished: 0, failed: 0, busy_s: 0.0, failed_since: 0 };
        for (case, verdict) in report.cases.iter().zip(verdicts) {
            match (&case.outcome, verdict) {
                (Outcome::Finished(_), ReportVerdict::Stored) => {
                    tally.finished += 1;
                    tally.busy_s += case.duration_s;
                    tally.failed_since = 0;
                }
                (Outcome::Failed { .. }, ReportVerdict::Stored) => {
                    tally.failed += 1;
                    tally.failed_since += 1;
                }
                _ => {}
            }
        }
        tally
    }

    /// Stores the counts. Returns the reason of the worker's quarantine, if it is in quarantine.
    pub(crate) async fn store(
        &self,
        connection: &mut Connection,
    ) -> Result<Option<String>, LibraryError> {
        if self.finished + self.failed == 0 {
            return Ok(None);
        }
        let worker = sql(ADD_TO_WORKER)
            .bind(&self.report.worker)
            .bind(self.finished)
            .bind(self.failed)
            .bind(self.busy_s)
            .bind(self.failed_since)
            .bind(self.report.now_unix_ms);
        let worker = connection.row(worker).await?;
        let progress = sql(ADD_TO_PROGRESS)
            .bind(&self.report.campaign)
            .bind(interval(self.report.now_unix_ms))
            .bind(self.finished)
            .bind(self.failed)
            .bind(self.busy_s);
        connection.execute(progress).await?;
        worker.map_or(Ok(None), |row| row.get("quarantine"))
    }
}

/// Start of the interval that contains this instant, in s since 1970.
pub(crate) const fn interval(unix_ms: i64) -> i64 {
    unix_ms.div_euclid(1000 * INTERVAL_S) * INTERVAL_S
}
