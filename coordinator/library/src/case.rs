//! The table `campaign_case`: cases and their states.

use crate::campaign::{seed_from_sql, sql_seed};
use crate::engine::{Connection, Row, Statement, Write, sql};
use crate::{Cell, Library, LibraryError, State};
use tracktwin_parameters::{Case, Parameter, ParameterSet};

/// Maximum number of cases in one statement. Each has eleven values, and `SQLite` accepts 32,766 values.
const CASES_A_STATEMENT: usize = 1000;

/// A case and its state.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseRecord {
    /// The case: index, seed and parameters.
    pub case: Case,
    /// Present state of the case.
    pub state: State,
    /// Number of leases that ended with a failure or without a report.
    pub attempts: u32,
    /// Worker of the present or the last lease.
    pub worker: Option<String>,
    /// Error of the last lease that ended without result.
    pub error: Option<String>,
}

/// Counts of a campaign's cases by state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Cases that wait for a worker.
    pub waiting: u32,
    /// Cases leased to a worker.
    pub leased: u32,
    /// Cases with stored results.
    pub finished: u32,
    /// Cases that were given up.
    pub failed: u32,
}

impl Status {
    /// Number of all cases.
    pub const fn total(&self) -> u32 {
        self.waiting + self.leased + self.finished + self.failed
    }

    /// Number of cases that need no more work: finished and failed ones.
    pub const fn done(&self) -> u32 {
        self.finished + self.failed
    }
}

impl Library {
    /// Adds cases to a campaign. Existing cases are kept unchanged. `drawn` returns what was drawn for a
    /// case besides its parameters, as a JSON object of numbers by name.
    ///
    /// # Errors
    /// Returns [`LibraryError::SeedTooLarge`], or an error if the library cannot be written.
    pub async fn insert_cases(
        &self,
        campaign: &str,
        cases: &[Case],
        drawn: impl Fn(&Case) -> Option<String>,
    ) -> Result<(), LibraryError> {
        for chunk in cases.chunks(CASES_A_STATEMENT) {
            let cases = chunk.iter().map(|case| (case.clone(), drawn(case))).collect();
            self.write(Insert { campaign: campaign.to_owned(), cases }).await?;
        }
        Ok(())
    }

    /// Number of consecutive cases from index 0. It is the number of all cases, unless a damaged library
    /// has lost some.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn cases_in_order(&self, campaign: &str) -> Result<u32, LibraryError> {
        let total = self.status(campaign).await?.total();
        let last = "select max(sobol_index) as last from campaign_case where campaign_id = $1";
        let last = self.readers().row(sql(last).bind(campaign)).await?;
        let last: Option<i64> = last.map_or(Ok(None), |row| row.get("last"))?;
        if last.is_none_or(|last| last + 1 == i64::from(total)) {
            return Ok(total);
        }
        let before_gap = "select count(*) as cases from (
                select sobol_index, row_number() over (order by sobol_index) - 1 as place
                from campaign_case where campaign_id = $1) as placed
            where sobol_index = place";
        let row = self.readers().row(sql(before_gap).bind(campaign)).await?;
        row.map_or(Ok(0), |row| row.get_u32("cases"))
    }

    /// Counts of the campaign's cases with an index below `cases`.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn status_of(&self, campaign: &str, cases: u32) -> Result<Status, LibraryError> {
        let all = self.status(campaign).await?;
        // Indices have no gaps.
        if all.total() <= cases {
            return Ok(all);
        }
        let count = "select state, count(*) as cases from campaign_case
            where campaign_id = $1 and sobol_index < $2 group by state";
        self.counts(sql(count).bind(campaign).bind(cases)).await
    }

    /// Counts of all cases of a campaign. The cost does not depend on the number of cases.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn status(&self, campaign: &str) -> Result<Status, LibraryError> {
        let sum = "select state, cast(sum(cases) as bigint) as cases from case_count
            where campaign_id = $1 group by state";
        self.counts(sql(sum).bind(campaign)).await
    }

    pub(crate) async fn counts(&self, ask: Statement) -> Result<Status, LibraryError> {
        let mut status = Status::default();
        for row in self.readers().rows(ask).await? {
            let count = row.get_u32("cases")?;
            match State::from_name(&row.get::<String>("state")?)? {
                State::Waiting => status.waiting = count,
                State::Leased => status.leased = count,
                State::Finished => status.finished = count,
                State::Failed => status.failed = count,
            }
        }
        Ok(status)
    }

    /// Returns one case; `None` if the campaign has no case with this index.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn case(
        &self,
        campaign: &str,
        index: u32,
    ) -> Result<Option<CaseRecord>, LibraryError> {
        let ask = "select * from campaign_case where campaign_id = $1 and sobol_index = $2";
        let row = self.readers().row(sql(ask).bind(campaign).bind(index)).await?;
        row.as_ref().map(record).transpose()
    }

    /// Returns the first `limit` cases that were given up, by index.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn failures(
        &self,
        campaign: &str,
        limit: u32,
    ) -> Result<Vec<CaseRecord>, LibraryError> {
        let ask = "select * from campaign_case where campaign_id = $1 and state = 'failed'
            order by sobol_index limit $2";
        let rows = self.readers().rows(sql(ask).bind(campaign).bind(limit)).await?;
        rows.iter().map(record).collect()
    }
}

/// Reads a case from a row with the columns of `campaign_case`.
pub(crate) fn case_of(row: &Row) -> Result<Case, LibraryError> {
    let mut parameters = ParameterSet::nominal();
    for &parameter in Parameter::ALL {
        parameters[parameter] = row.get(parameter.name())?;
    }
    Ok(Case {
        index: row.get_u32("sobol_index")?,
        parameters,
        surface_seed: seed_from_sql(row.get("surface_seed")?)?,
    })
}

/// Reads a case from the cells of a row; `cell` returns the cell of a column. `None` if a cell is missing
/// or has another type.
pub(crate) fn case_in<'a>(cell: impl Fn(&str) -> Option<&'a Cell>) -> Option<Case> {
    let mut parameters = ParameterSet::nominal();
    for &parameter in Parameter::ALL {
        let Some(Cell::Real(value)) = cell(parameter.name()) else { return None };
        parameters[parameter] = *value;
    }
    let integer = |column| match cell(column) {
        Some(Cell::Integer(integer)) => Some(*integer),
        _ => None,
    };
    let index = u32::try_from(integer("sobol_index")?).ok()?;
    let surface_seed = seed_from_sql(integer("surface_seed")?).ok()?;
    Some(Case { index, parameters, surface_seed })
}

fn record(row: &Row) -> Result<CaseRecord, LibraryError> {
    Ok(CaseRecord {
        case: case_of(row)?,
        state: State::from_name(&row.get::<String>("state")?)?,
        attempts: row.get_u32("attempts")?,
        worker: row.get("worker")?,
        error: row.get("error")?,
    })
}

struct Insert {
    campaign: String,
    cases: Vec<(Case, Option<String>)>,
}

impl Write for Insert {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let parameters: String =
            Parameter::ALL.iter().flat_map(|parameter| [parameter.name(), ", "]).collect();
        let insert = format!(
            "insert into campaign_case (campaign_id, sobol_index, {parameters}surface_seed,
                parameter_hash, drawn)
            values {} on conflict (campaign_id, sobol_index) do nothing",
            connection.dialect().rows_of_values(self.cases.len(), Parameter::ALL.len() + 5)
        );
        let mut insert = sql(insert);
        for (case, drawn) in &self.cases {
            insert = insert.bind(&self.campaign).bind(case.index);
            insert = case.parameters.values().iter().fold(insert, |it, &value| it.bind(value));
            insert = insert.bind(sql_seed(case.surface_seed)?).bind(case.parameter_hash());
            insert = insert.bind(drawn.clone());
        }
        connection.execute(insert).await.map(drop)
    }
}
