//! Storing a report in one transaction.

use super::{Report, ReportVerdict};
use crate::attempt::{self, Ended};
use crate::engine::{Connection, Row, Text, Write, sql};
use crate::result::{self, insert_results};
use crate::state::Ending;
use crate::tally::Tally;
use crate::{Held, LibraryError, State, audit};
use std::collections::{HashMap, HashSet};
use tracktwin_experiment::{Outcome, PassFeatures};
use tracktwin_protocol::CaseReport;

/// States of cases ($2) of a campaign. The rows are locked until this transaction ends.
const STANDINGS: Text = Text::Each {
    sqlite: "
        select sobol_index, state, epoch, attempts, worker, parameter_hash from campaign_case
        where campaign_id = $1 and sobol_index in (select value from json_each($2)) order by sobol_index",
    postgres: "
        select sobol_index, state, epoch, attempts, worker, parameter_hash from campaign_case
        where campaign_id = $1 and sobol_index = any($2) order by sobol_index for update",
};

/// Leases of cases ($3) that worker $2 had and that ended without result.
const EARLIER_LEASES: Text = Text::Each {
    sqlite:
        "
        select sobol_index, epoch from attempt
        where campaign_id = $1 and worker = $2 and sobol_index in (select value from json_each($3))",
    postgres: "
        select sobol_index, epoch from attempt
        where campaign_id = $1 and worker = $2 and sobol_index = any($3)",
};

/// Sets the state of cases ($3) to finished, by worker $2.
const FINISH: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'finished', worker = $2, error = null, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index in (select value from json_each($3))",
    postgres: "
        update campaign_case set state = 'finished', worker = $2, error = null, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index = any($3)",
};

/// Error of a case whose parameters are not those that its worker was leased.
const OTHER_PARAMETERS: &str = "the worker simulated parameters that do not match the case's hash: they were \
    altered in the library (`tracktwin campaign retry --altered` restores them), or the worker is faulty";

impl Write for Report {
    type Answer = Vec<ReportVerdict>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Vec<ReportVerdict>, LibraryError> {
        let mut case_states = self.case_states(connection).await?;
        let earlier = self.earlier_leases(connection, &case_states).await?;
        let mut finished = Vec::new();
        let mut verdicts = Vec::with_capacity(self.cases.len());
        for case in &self.cases {
            let case_state = case_states.get_mut(&case.index);
            let verdict = case_state
                .as_deref()
                .map_or(ReportVerdict::Refused, |it| self.verdict(case, it, &earlier));
            verdicts.push(verdict);
            let Some(case_state) = case_state else { continue };
            if verdict == ReportVerdict::Refused && self.is_of_other_parameters(case, case_state) {
                self.give_up(connection, case, case_state).await?;
                case_state.state = State::Failed;
            }
            if verdict != ReportVerdict::Stored {
                continue;
            }
            match &case.outcome {
                Outcome::Finished(passes) => {
                    if self.overtakes(case, case_state) {
                        attempt::overtake(connection, self, case.index).await?;
                    }
                    finished.push((case, &**passes));
                    case_state.state = State::Finished;
                }
                Outcome::Failed { reason } => {
                    case_state.state = self.fail(connection, case, case_state, reason).await?;
                }
            }
        }
        // Counted first, for that keeps others from putting the worker into quarantine meanwhile.
        let flagged = Tally::of(self, &verdicts).store(connection).await?;
        self.finish(connection, &finished, flagged).await?;
        Ok(verdicts)
    }
}

/// State of a case before the report.
struct CaseState {
    state: State,
    epoch: u32,
    attempts: u32,
    worker: Option<String>,
    parameter_hash: String,
}

impl Report {
    /// Reads and locks the states of the reported cases.
    async fn case_states(
        &self,
        connection: &mut Connection,
    ) -> Result<HashMap<u32, CaseState>, LibraryError> {
        let ask = sql(STANDINGS).bind(&self.campaign).bind(self.indices(|_| true));
        let case_state = |row: &Row| {
            let case_state = CaseState {
                state: State::from_name(&row.get::<String>("state")?)?,
                epoch: row.get_u32("epoch")?,
                attempts: row.get_u32("attempts")?,
                worker: row.get("worker")?,
                parameter_hash: row.get("parameter_hash")?,
            };
            Ok((row.get_u32("sobol_index")?, case_state))
        };
        connection.rows(ask).await?.iter().map(case_state).collect()
    }

    /// Leases of the reported cases that this worker had and that have ended.
    async fn earlier_leases(
        &self,
        connection: &mut Connection,
        case_states: &HashMap<u32, CaseState>,
    ) -> Result<HashSet<Held>, LibraryError> {
        let present = |case: &CaseReport| {
            case_states.get(&case.index).is_none_or(|case_state| self.is_present(case, case_state))
        };
        let late = self.indices(|case| !present(case));
        if late.is_empty() {
            return Ok(HashSet::new());
        }
        let ask = sql(EARLIER_LEASES).bind(&self.campaign).bind(&self.worker).bind(late);
        let held = |row: &Row| {
            Ok(Held { index: row.get_u32("sobol_index")?, epoch: row.get_u32("epoch")? })
        };
        connection.rows(ask).await?.iter().map(held).collect()
    }

    fn indices(&self, which: impl Fn(&CaseReport) -> bool) -> Vec<i64> {
        self.cases.iter().filter(|case| which(case)).map(|case| case.index.into()).collect()
    }

    /// Whether the report belongs to the case's latest lease.
    fn is_present(&self, case: &CaseReport, case_state: &CaseState) -> bool {
        case.epoch == case_state.epoch && case_state.worker.as_ref() == Some(&self.worker)
    }

    /// Whether the result belongs to an earlier lease while a later lease of the case is still open.
    fn overtakes(&self, case: &CaseReport, case_state: &CaseState) -> bool {
        case_state.state == State::Leased && !self.is_present(case, case_state)
    }

    fn verdict(
        &self,
        case: &CaseReport,
        case_state: &CaseState,
        earlier: &HashSet<Held>,
    ) -> ReportVerdict {
        let present = self.is_present(case, case_state);
        let held = present || earlier.contains(&Held { index: case.index, epoch: case.epoch });
        if !held || case.epoch == 0 || case.parameter_hash != case_state.parameter_hash {
            return ReportVerdict::Refused;
        }
        match (&case.outcome, case_state.state) {
            (_, State::Finished) => ReportVerdict::Duplicate,
            (Outcome::Finished(_), _) => ReportVerdict::Stored,
            (Outcome::Failed { .. }, State::Leased) if present => ReportVerdict::Stored,
            (Outcome::Failed { .. }, _) => ReportVerdict::Late,
        }
    }

    /// Whether the report belongs to the case's present lease and is refused because of its parameters. It
    /// would be refused again after every further lease.
    fn is_of_other_parameters(&self, case: &CaseReport, case_state: &CaseState) -> bool {
        case_state.state == State::Leased
            && self.is_present(case, case_state)
            && case.parameter_hash != case_state.parameter_hash
    }

    /// Gives up a case whose parameters do not match its hash.
    async fn give_up(
        &self,
        connection: &mut Connection,
        case: &CaseReport,
        case_state: &CaseState,
    ) -> Result<(), LibraryError> {
        let ended = Ended {
            campaign: &self.campaign,
            indices: vec![case.index.into()],
            attempts: case_state.attempts + 1,
            state: State::Failed,
            ending: "failed",
            error: OTHER_PARAMETERS,
            now_unix_ms: self.now_unix_ms,
        };
        attempt::end(connection, ended).await
    }

    async fn fail(
        &self,
        connection: &mut Connection,
        case: &CaseReport,
        case_state: &CaseState,
        reason: &str,
    ) -> Result<State, LibraryError> {
        let failures =
            attempt::failures(connection, self, case.index, case_state.attempts).await? + 1;
        let state = self.attempts_max.after(Ending::Failed, failures);
        let ended = Ended {
            campaign: &self.campaign,
            indices: vec![case.index.into()],
            attempts: case_state.attempts + 1,
            state,
            ending: "failed",
            error: reason,
            now_unix_ms: self.now_unix_ms,
        };
        attempt::end(connection, ended).await?;
        Ok(state)
    }

    async fn finish(
        &self,
        connection: &mut Connection,
        finished: &[(&CaseReport, &[PassFeatures])],
        flagged: Option<String>,
    ) -> Result<(), LibraryError> {
        if finished.is_empty() {
            return Ok(());
        }
        let indices = finished.iter().map(|(case, _)| i64::from(case.index)).collect::<Vec<_>>();
        // An interrupted copy leaves single passes of a case.
        result::discard(connection, &self.campaign, &indices).await?;
        insert_results(connection, self, finished, flagged).await?;
        connection
            .execute(sql(FINISH).bind(&self.campaign).bind(&self.worker).bind(indices))
            .await?;
        audit::sample(connection, self, finished.iter().map(|(case, _)| *case)).await
    }
}
