//! The table `campaign_case`: the cases and where they stand.

use crate::campaign::{seed_from_sql, sql_seed};
use crate::writer::Write;
use crate::{Library, LibraryError, State};
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, SqliteConnection};
use tracktwin_parameters::{Case, Parameter, ParameterSet};

/// Cases in one statement: ten values each, well below the 32,766 that `SQLite` takes.
const CASES_A_STATEMENT: usize = 1000;

/// A case and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseRecord {
    /// The case.
    pub case: Case,
    /// Where it stands.
    pub state: State,
    /// Leases that ended in a failure or in silence.
    pub attempts: u32,
    /// Who holds it, or held it last.
    pub worker: Option<String>,
    /// How the last such lease ended.
    pub error: Option<String>,
}

/// How many cases of a campaign stand where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Nobody works on them.
    pub waiting: u32,
    /// Workers hold them.
    pub leased: u32,
    /// Their results are stored.
    pub finished: u32,
    /// They were given up.
    pub failed: u32,
}

impl Status {
    /// All cases.
    pub const fn total(&self) -> u32 {
        self.waiting + self.leased + self.finished + self.failed
    }

    /// Cases that need no more work.
    pub const fn done(&self) -> u32 {
        self.finished + self.failed
    }
}

impl Library {
    /// Adds cases to a campaign; those that are there stay as they are.
    ///
    /// # Errors
    /// [`LibraryError::SeedTooLarge`], or when the library cannot be written.
    pub async fn insert_cases(&self, campaign: &str, cases: &[Case]) -> Result<(), LibraryError> {
        for chunk in cases.chunks(CASES_A_STATEMENT) {
            self.write(Insert { campaign: campaign.to_owned(), cases: chunk.to_vec() }).await?;
        }
        Ok(())
    }

    /// The counts of a campaign's first `cases` cases.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn status_of(&self, campaign: &str, cases: u32) -> Result<Status, LibraryError> {
        let rows: Vec<(String, u32)> = sqlx::query_as(
            "select state, count(*) from campaign_case
            where campaign_id = ? and sobol_index < ? group by state",
        )
        .bind(campaign)
        .bind(cases)
        .fetch_all(self.readers())
        .await?;
        let mut status = Status::default();
        for (state, count) in rows {
            match State::from_name(&state) {
                State::Waiting => status.waiting = count,
                State::Leased => status.leased = count,
                State::Finished => status.finished = count,
                State::Failed => status.failed = count,
            }
        }
        Ok(status)
    }

    /// The counts of a campaign.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn status(&self, campaign: &str) -> Result<Status, LibraryError> {
        self.status_of(campaign, u32::MAX).await
    }

    /// One case, if the campaign has it.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn case(
        &self,
        campaign: &str,
        index: u32,
    ) -> Result<Option<CaseRecord>, LibraryError> {
        let row =
            sqlx::query("select * from campaign_case where campaign_id = ? and sobol_index = ?")
                .bind(campaign)
                .bind(index)
                .fetch_optional(self.readers())
                .await?;
        row.as_ref().map(record).transpose()
    }

    /// The first `limit` cases that were given up.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn failures(
        &self,
        campaign: &str,
        limit: u32,
    ) -> Result<Vec<CaseRecord>, LibraryError> {
        let rows = sqlx::query(
            "select * from campaign_case where campaign_id = ? and state = 'failed'
            order by sobol_index limit ?",
        )
        .bind(campaign)
        .bind(limit)
        .fetch_all(self.readers())
        .await?;
        rows.iter().map(record).collect()
    }
}

/// The case in a row that has the columns of `campaign_case`.
pub(crate) fn case_of(row: &SqliteRow) -> Result<Case, LibraryError> {
    let mut parameters = ParameterSet::nominal();
    for &parameter in Parameter::ALL {
        parameters[parameter] = row.try_get(parameter.name())?;
    }
    Ok(Case {
        index: row.try_get("sobol_index")?,
        parameters,
        surface_seed: seed_from_sql(row.try_get("surface_seed")?)?,
    })
}

fn record(row: &SqliteRow) -> Result<CaseRecord, LibraryError> {
    Ok(CaseRecord {
        case: case_of(row)?,
        state: State::from_name(row.try_get("state")?),
        attempts: row.try_get("attempts")?,
        worker: row.try_get("worker")?,
        error: row.try_get("error")?,
    })
}

struct Insert {
    campaign: String,
    cases: Vec<Case>,
}

impl Write for Insert {
    type Answer = ();

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<(), LibraryError> {
        let seeds = self.cases.iter().map(|case| sql_seed(case.surface_seed));
        let seeds = seeds.collect::<Result<Vec<i64>, _>>()?;
        let mut query = QueryBuilder::new("insert into campaign_case (campaign_id, sobol_index, ");
        for parameter in Parameter::ALL {
            query.push(parameter.name()).push(", ");
        }
        query.push("surface_seed, parameter_hash) ");
        query.push_values(self.cases.iter().zip(seeds), |mut row, (case, seed)| {
            row.push_bind(&self.campaign).push_bind(case.index);
            for &value in case.parameters.values() {
                row.push_bind(value);
            }
            row.push_bind(seed).push_bind(case.parameter_hash());
        });
        query.push(" on conflict (campaign_id, sobol_index) do nothing");
        query.build().execute(connection).await?;
        Ok(())
    }
}
