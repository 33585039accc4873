//! Taking reports: each case's first result is stored, and whatever comes later changes nothing.

use crate::lease::{Attempted, end_attempt};
use crate::result::insert_result;
use crate::writer::Write;
use crate::{Ending, Library, LibraryError, Policy, State};
use sqlx::SqliteConnection;
use tracktwin_signal::Features;

/// What a worker hands in.
#[derive(Clone, Debug)]
pub struct Report {
    /// The campaign.
    pub campaign: String,
    /// Who reports.
    pub worker: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Hash of the worker's physics.
    pub model_hash: String,
    /// Hash of the experiment.
    pub experiment_hash: String,
    /// The speeds of the experiment in km/h, as many as every case has passes.
    pub speeds_km_h: Vec<f64>,
    /// The cases.
    pub cases: Vec<CaseReport>,
    /// The coordinator's clock.
    pub now_unix_ms: i64,
    /// What becomes of cases that could not be simulated.
    pub after_failure: Policy,
}

/// What became of one case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseReport {
    /// Place in the campaign.
    pub index: u32,
    /// The lease under which it was simulated.
    pub epoch: u32,
    /// Hash of the parameters and seed that were simulated.
    pub parameter_hash: String,
    /// Computing time at all speeds together, in s.
    pub duration_s: f64,
    /// Features, one a speed; or why there are none.
    pub outcome: Result<Vec<Features>, String>,
}

/// What was done with the report of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Stored.
    Stored,
    /// A result was there already; nothing changed.
    Duplicate,
    /// The failure of a lease that has ended; nothing changed.
    Late,
    /// No such case, never leased so, or other parameters than the case has; nothing changed.
    Refused,
}

impl Library {
    /// Stores what a worker reports, one verdict a case. Repeating it changes nothing.
    ///
    /// A result is stored if there is none yet, even when its lease has expired: it is the same
    /// result. A failure counts only under the lease it happened in.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written; then nothing is stored.
    pub async fn report(&self, report: Report) -> Result<Vec<Verdict>, LibraryError> {
        self.write(report).await
    }
}

impl Write for Report {
    type Answer = Vec<Verdict>;

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<Vec<Verdict>, LibraryError> {
        let mut verdicts = Vec::with_capacity(self.cases.len());
        for case in &self.cases {
            verdicts.push(self.apply_case(case, connection).await?);
        }
        Ok(verdicts)
    }
}

/// What decides the fate of a report.
#[derive(sqlx::FromRow)]
struct Standing {
    state: String,
    epoch: u32,
    attempts: u32,
    worker: Option<String>,
    parameter_hash: String,
}

impl Report {
    async fn apply_case(
        &self,
        case: &CaseReport,
        connection: &mut SqliteConnection,
    ) -> Result<Verdict, LibraryError> {
        let standing: Option<Standing> = sqlx::query_as(
            "select state, epoch, attempts, worker, parameter_hash from campaign_case
            where campaign_id = ? and sobol_index = ?",
        )
        .bind(&self.campaign)
        .bind(case.index)
        .fetch_optional(&mut *connection)
        .await?;
        let verdict = standing.as_ref().map_or(Verdict::Refused, |it| self.verdict(case, it));
        if let (Verdict::Stored, Some(standing)) = (verdict, standing) {
            match &case.outcome {
                Ok(features) => self.finish(case, features, connection).await?,
                Err(reason) => {
                    let attempts = standing.attempts + 1;
                    let state = (self.after_failure)(Ending::Failed, attempts);
                    let after = Attempted { attempts, state, error: reason };
                    end_attempt(connection, &self.campaign, case.index, after).await?;
                }
            }
        }
        Ok(verdict)
    }

    fn verdict(&self, case: &CaseReport, standing: &Standing) -> Verdict {
        let state = State::from_name(&standing.state);
        let known = (1..=standing.epoch).contains(&case.epoch);
        if !known || case.parameter_hash != standing.parameter_hash {
            return Verdict::Refused;
        }
        let current = state == State::Leased
            && case.epoch == standing.epoch
            && standing.worker.as_ref() == Some(&self.worker);
        match (&case.outcome, state) {
            (_, State::Finished) => Verdict::Duplicate,
            (Ok(_), _) => Verdict::Stored,
            (Err(_), _) if current => Verdict::Stored,
            (Err(_), _) => Verdict::Late,
        }
    }

    async fn finish(
        &self,
        case: &CaseReport,
        features: &[Features],
        connection: &mut SqliteConnection,
    ) -> Result<(), LibraryError> {
        assert_eq!(features.len(), self.speeds_km_h.len(), "checked where the message came in");
        for (&speed_km_h, features) in self.speeds_km_h.iter().zip(features) {
            insert_result(self, case, speed_km_h, features, connection).await?;
        }
        sqlx::query(
            "update campaign_case set state = 'finished', worker = ?, error = null,
                lease_expires_unix_ms = null
            where campaign_id = ? and sobol_index = ?",
        )
        .bind(&self.worker)
        .bind(&self.campaign)
        .bind(case.index)
        .execute(connection)
        .await?;
        Ok(())
    }
}
