//! Import of rows from another library.

use super::{Cell, Column, Table, decode, merge};
use crate::case::case_in;
use crate::engine::{Connection, Dialect, Statement, Text, Write, sql};
use crate::result::{Attested, Gathering};
use crate::{Library, LibraryError, result};
use std::collections::HashSet;

/// Maximum number of rows in one statement. The widest table has 38 columns, and `SQLite` accepts 32,766
/// values.
const ROWS_A_STATEMENT: usize = 250;

/// Sets the state of all cases with a result at each speed to finished.
const FINISH_ALL_CASES: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'finished', error = null, lease_expires_unix_ms = null
        where state <> 'finished'
            and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                and result.sobol_index = campaign_case.sobol_index)
            = (select json_array_length(speeds_km_h) from campaign where campaign.id = campaign_case.campaign_id)",
    postgres: "
        update campaign_case set state = 'finished', error = null, lease_expires_unix_ms = null
        where state <> 'finished'
            and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                and result.sobol_index = campaign_case.sobol_index)
            = (select jsonb_array_length(speeds_km_h::jsonb) from campaign
                where campaign.id = campaign_case.campaign_id)",
};

/// As [`FINISH_ALL_CASES`], for the cases ($2) of a campaign ($1).
const FINISH_THESE_CASES: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'finished', error = null, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index in (select value from json_each($2)) and state <> 'finished'
            and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                and result.sobol_index = campaign_case.sobol_index)
            = (select json_array_length(speeds_km_h) from campaign where campaign.id = campaign_case.campaign_id)",
    postgres: "
        update campaign_case set state = 'finished', error = null, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index = any($2) and state <> 'finished'
            and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                and result.sobol_index = campaign_case.sobol_index)
            = (select jsonb_array_length(speeds_km_h::jsonb) from campaign
                where campaign.id = campaign_case.campaign_id)",
};

/// The passes of cases, and the number of speeds of their campaign.
const PASSES: Text = Text::Each {
    sqlite: "
        select *, (select json_array_length(speeds_km_h) from campaign where id = $1) as speeds
        from result_with_parameters
        where campaign_id = $1 and sobol_index in (select value from json_each($2))
        order by sobol_index, speed_km_h",
    postgres: "
        select *, (select jsonb_array_length(speeds_km_h::jsonb) from campaign where id = $1) as speeds
        from result_with_parameters
        where campaign_id = $1 and sobol_index = any($2)
        order by sobol_index, speed_km_h",
};

impl Library {
    /// Adds rows that do not exist yet, and replaces workers, progress and audits by later states of them. Flags
    /// of existing results are added. Returns the number of added and replaced rows.
    ///
    /// Leases are not copied: a case that is leased in the other library becomes waiting in this one.
    ///
    /// # Errors
    /// Returns [`LibraryError::OtherDefinition`] if a campaign exists here with another definition;
    /// [`LibraryError::BadRow`] if cells do not fit their columns, a case does not match its hash, or
    /// results do not match their checksum; or another error if the library cannot be written.
    pub async fn write_table(
        &self,
        table: &'static Table,
        rows: Vec<Vec<Cell>>,
    ) -> Result<u64, LibraryError> {
        let mut added = 0;
        let mut rows = rows.into_iter().peekable();
        while rows.peek().is_some() {
            added += self.write_rows(table, rows.by_ref().take(ROWS_A_STATEMENT).collect()).await?;
        }
        Ok(added)
    }

    /// As [`Library::write_table`], but skips refused rows. Returns the number of added rows, and an error
    /// for each refused row.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn write_what_is_whole(
        &self,
        table: &'static Table,
        rows: Vec<Vec<Cell>>,
    ) -> Result<(u64, Vec<LibraryError>), LibraryError> {
        let (mut added, mut refused) = (0, Vec::new());
        let mut parts: Vec<_> = rows.chunks(ROWS_A_STATEMENT).rev().map(<[_]>::to_vec).collect();
        while let Some(mut part) = parts.pop() {
            match self.write_rows(table, part.clone()).await {
                Ok(count) => added += count,
                Err(error) if !error.is_about_rows() => return Err(error),
                Err(error) if part.len() == 1 => refused.push(error),
                Err(_) => {
                    let second = part.split_off(part.len() / 2);
                    parts.extend([second, part]);
                }
            }
        }
        Ok((added, refused))
    }

    /// Adds the rows of one statement.
    async fn write_rows(
        &self,
        table: &'static Table,
        rows: Vec<Vec<Cell>>,
    ) -> Result<u64, LibraryError> {
        let rows: Vec<_> = rows.into_iter().map(|row| without_lease(table, row)).collect();
        self.refuse_other_campaigns(table, &rows).await?;
        refuse_other_parameters(table, &rows)?;
        let rows = if merge::replaces(table) {
            merge::without_duplicates(table, rows)
        } else {
            self.flag_those_here(table, &rows).await?;
            self.without_those_here(table, rows).await?
        };
        if rows.is_empty() { Ok(0) } else { self.write(Rows { table, rows }).await }
    }

    /// Removes rows that this library already has, so that an interrupted copy continues quickly.
    async fn without_those_here(
        &self,
        table: &Table,
        mut rows: Vec<Vec<Cell>>,
    ) -> Result<Vec<Vec<Cell>>, LibraryError> {
        let (campaign, index) = (table.column("campaign_id"), table.column("sobol_index"));
        let (Some(campaign), Some(index)) = (campaign, index) else { return Ok(rows) };
        // Rows come by campaign; those of a second one in the batch are simply sent.
        let Some(Cell::Text(campaign)) = rows.first().map(|row| row[campaign].clone()) else {
            return Ok(rows);
        };
        let indices: Vec<i64> = rows.iter().filter_map(|row| integer(&row[index])).collect();
        let places: Vec<usize> = table.key.iter().filter_map(|name| table.column(name)).collect();
        let ask = format!(
            "select {} from {} where campaign_id = $1 and sobol_index {}",
            table.key.join(", "),
            table.name,
            self.readers().dialect().listed("$2")
        );
        let columns = places.iter().map(|&place| &table.columns[place]);
        let columns: Vec<&Column> = columns.collect();
        let mut here = HashSet::new();
        for row in self.readers().rows(sql(ask).bind(campaign).bind(indices)).await? {
            here.insert(key(&decode::cells(columns.iter().copied(), &row)?));
        }
        rows.retain(|row| {
            let cells: Vec<Cell> = places.iter().map(|&place| row[place].clone()).collect();
            !here.contains(&key(&cells))
        });
        Ok(rows)
    }

    async fn refuse_other_campaigns(
        &self,
        table: &Table,
        rows: &[Vec<Cell>],
    ) -> Result<(), LibraryError> {
        if table.name != "campaign" {
            return Ok(());
        }
        let (id, hash) = (table.column("id"), table.column("definition_hash"));
        let (Some(id), Some(hash)) = (id, hash) else { return Ok(()) };
        for row in rows {
            let (Cell::Text(id), Cell::Text(hash)) = (&row[id], &row[hash]) else { continue };
            match self.campaign(id).await {
                Ok(here) if here.definition_hash != *hash => {
                    return Err(LibraryError::OtherDefinition { id: id.clone() });
                }
                Ok(_) | Err(LibraryError::UnknownCampaign { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Marks all cases with complete results as finished, as [`Self::write_table`] does for added results.
    /// This call repairs a copy that was interrupted between the passes of a case. Returns the number of
    /// such cases.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn finish_complete_cases(&self) -> Result<u64, LibraryError> {
        self.write(FinishCompleteCases).await
    }
}

/// Returns an error for cases that do not match their hash.
fn refuse_other_parameters(table: &Table, rows: &[Vec<Cell>]) -> Result<(), LibraryError> {
    let Some(hash) = table.column("parameter_hash").filter(|_| table.name == "campaign_case")
    else {
        return Ok(());
    };
    for row in rows {
        let Some(case) = case_in(|column| table.column(column).and_then(|place| row.get(place)))
        else {
            continue;
        };
        if row.get(hash) != Some(&Cell::Text(case.parameter_hash())) {
            let what = format!("case {} does not match its parameter hash", case.index);
            return Err(LibraryError::BadRow { table: table.name, what });
        }
    }
    Ok(())
}

/// Text of a key. Each number has only one text, so that equal keys have equal texts.
fn key(cells: &[Cell]) -> String {
    format!("{cells:?}")
}

fn integer(cell: &Cell) -> Option<i64> {
    match cell {
        Cell::Integer(integer) => Some(*integer),
        _ => None,
    }
}

/// Returns the row without a lease. A case becomes finished only when its results are stored as well.
fn without_lease(table: &Table, mut row: Vec<Cell>) -> Vec<Cell> {
    let state = table.column("state");
    let expires = table.column("lease_expires_unix_ms");
    if let (Some(state), Some(expires)) = (state, expires)
        && let Some(Cell::Text(name)) = row.get(state)
        && ["leased", "finished"].contains(&name.as_str())
    {
        row[state] = Cell::Text("waiting".to_owned());
        row[expires] = Cell::Null;
    }
    row
}

struct Rows {
    table: &'static Table,
    rows: Vec<Vec<Cell>>,
}

impl Write for Rows {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        let list = self.table.column_list();
        let dialect = connection.dialect();
        let values = dialect.rows_of_values(self.rows.len(), self.table.columns.len());
        if self.table.name == "result" && dialect == Dialect::Postgres {
            let gather = self.bound(result::gathering(&list, &values))?;
            self.lock_cases(connection).await?;
            let rows = connection.rows(gather).await?;
            self.refuse_altered(connection).await?;
            self.finish_complete_cases(connection).await?;
            return rows.first().map_or(Ok(0), |row| row.get_u32("added").map(u64::from));
        }
        let (table, on_conflict) = (self.table.name, merge::on_conflict(self.table));
        let insert = format!("insert into {table} ({list}) values {values} {on_conflict}");
        let added = connection.execute(self.bound(insert)?).await?;
        if table == "result" {
            self.refuse_altered(connection).await?;
            self.finish_complete_cases(connection).await?;
        }
        Ok(added)
    }
}

impl Rows {
    /// Marks the cases of these rows as finished if all their passes are stored.
    async fn finish_complete_cases(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let mut campaigns = self.texts("campaign_id");
        campaigns.dedup();
        let indices = self.integers("sobol_index");
        for campaign in campaigns {
            let finish = sql(FINISH_THESE_CASES).bind(campaign).bind(indices.clone());
            connection.execute(finish).await?;
        }
        Ok(())
    }

    /// Reads the cases of these rows again, as stored now. Returns an error if a case with all its passes
    /// does not match its checksum.
    async fn refuse_altered(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let mut campaigns = self.texts("campaign_id");
        campaigns.dedup();
        for campaign in campaigns {
            let ask = sql(PASSES).bind(&campaign).bind(self.integers("sobol_index"));
            let rows = connection.rows(ask).await?;
            let speeds = rows.first().map_or(Ok(0), |row| row.get_count("speeds"))?;
            let mut gathering = Gathering::default();
            let mut cases = Vec::new();
            for row in &rows {
                cases.extend(gathering.take(row)?);
            }
            cases.extend(gathering.end());
            let altered = cases
                .iter()
                .find(|case| case.passes.len() == speeds && case.attested() == Attested::Altered);
            if let Some(altered) = altered {
                let index = altered.case.index;
                let what = format!(
                    "the results of case {index} of {campaign} do not match their checksum: a number \
                         was altered"
                );
                return Err(LibraryError::BadRow { table: self.table.name, what });
            }
        }
        Ok(())
    }

    /// Locks the cases of these results. Returns an error if a case is missing.
    async fn lock_cases(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let (campaigns, indices) = (self.texts("campaign_id"), self.integers("sobol_index"));
        let expected = campaigns.iter().zip(&indices).collect::<HashSet<_>>().len() as u64;
        let found = result::lock(connection, campaigns, indices).await?;
        if found == expected {
            return Ok(());
        }
        let what = format!("{} of {expected} cases are missing in campaign_case", expected - found);
        Err(LibraryError::BadRow { table: self.table.name, what })
    }

    /// The statement with the cells of all rows bound.
    fn bound(&self, statement: String) -> Result<Statement, LibraryError> {
        let columns = self.table.columns;
        let misfit = |what: String| LibraryError::BadRow { table: self.table.name, what };
        let mut statement = sql(statement);
        for row in &self.rows {
            if row.len() != columns.len() {
                return Err(misfit(format!("{} columns instead of {}", row.len(), columns.len())));
            }
            for (column, cell) in columns.iter().zip(row) {
                let value = cell.clone().bound_as(column.kind);
                let value = value.ok_or_else(|| misfit(format!("{cell:?} in {}", column.name)))?;
                statement = statement.bind(value);
            }
        }
        Ok(statement)
    }

    /// The cells of one column.
    fn column(&self, name: &str) -> impl Iterator<Item = &Cell> {
        let place = self.table.column(name);
        self.rows.iter().filter_map(move |row| row.get(place?))
    }

    fn texts(&self, name: &str) -> Vec<String> {
        let text =
            |cell: &Cell| if let Cell::Text(text) = cell { Some(text.clone()) } else { None };
        self.column(name).filter_map(text).collect()
    }

    fn integers(&self, name: &str) -> Vec<i64> {
        self.column(name).filter_map(integer).collect()
    }
}

struct FinishCompleteCases;

impl Write for FinishCompleteCases {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        connection.execute(sql(FINISH_ALL_CASES)).await
    }
}
