//! The table `worker`: the farm's workers, shared by all coordinators.

use crate::engine::{Connection, Row, Write, sql};
use crate::state::named;
use crate::{Library, LibraryError};

/// Whether cases are leased to a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WorkerState {
    /// Cases are leased to the worker.
    Active,
    /// No cases are leased to the worker, because a result of it was wrong.
    Quarantined,
}

/// Registration of a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Registration {
    /// Name of the worker. A worker that registers again under the same name keeps its counts.
    pub worker: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Hash of the worker's physics.
    pub model_hash: String,
    /// Number of groups of cases that it simulates in parallel.
    pub cores: u32,
    /// Present time of the library's clock, in ms since 1970.
    pub now_unix_ms: i64,
}

/// A worker as stored in the library.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerRecord {
    /// Name of the worker.
    pub id: String,
    /// Version of the worker's program.
    pub code_version: String,
    /// Hash of the worker's physics.
    pub model_hash: String,
    /// Number of groups of cases that it simulates in parallel.
    pub cores: u32,
    /// Whether cases are leased to the worker.
    pub state: WorkerState,
    /// Reason of the quarantine.
    pub reason: Option<String>,
    /// Time of the first registration, in ms since 1970.
    pub registered_unix_ms: i64,
    /// Time of the last message, in ms since 1970.
    pub last_seen_unix_ms: i64,
    /// Number of cases whose first result came from this worker.
    pub cases_finished: u32,
    /// Number of failed attempts that it reported.
    pub cases_failed: u32,
    /// Number of failed attempts since its last finished case.
    pub failures_in_a_row: u32,
    /// Computing time of its finished cases, in s.
    pub busy_s: f64,
}

impl WorkerRecord {
    /// Reason of the quarantine; `None` if the worker is not in quarantine.
    pub fn quarantine(self) -> Option<String> {
        let reason = self.reason.unwrap_or_else(|| "no reason given".to_owned());
        (self.state == WorkerState::Quarantined).then_some(reason)
    }

    /// Mean computing time of its finished cases, in s; `None` if there are none.
    pub fn mean_case_s(&self) -> Option<f64> {
        (self.cases_finished > 0).then(|| self.busy_s / f64::from(self.cases_finished))
    }
}

impl Library {
    /// Registers a worker and returns its state. A known worker keeps its counts and its state.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn register_worker(
        &self,
        registration: Registration,
    ) -> Result<WorkerState, LibraryError> {
        self.write(registration).await
    }

    /// Records a message of a worker and returns its record; `None` if the worker has not registered.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn heartbeat(
        &self,
        worker: &str,
        now_unix_ms: i64,
    ) -> Result<Option<WorkerRecord>, LibraryError> {
        self.write(Heartbeat { worker: worker.to_owned(), now_unix_ms }).await
    }

    /// Returns the record of a worker; `None` if it never registered.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn worker(&self, id: &str) -> Result<Option<WorkerRecord>, LibraryError> {
        let ask = sql("select * from worker where id = $1").bind(id);
        self.readers().row(ask).await?.as_ref().map(record).transpose()
    }

    /// Returns the workers with a message since this time, by name.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn workers(&self, since_unix_ms: i64) -> Result<Vec<WorkerRecord>, LibraryError> {
        let ask = sql("select * from worker where last_seen_unix_ms >= $1 order by id");
        self.readers().rows(ask.bind(since_unix_ms)).await?.iter().map(record).collect()
    }
}

fn record(row: &Row) -> Result<WorkerRecord, LibraryError> {
    Ok(WorkerRecord {
        id: row.get("id")?,
        code_version: row.get("code_version")?,
        model_hash: row.get("model_hash")?,
        cores: row.get_u32("cores")?,
        state: state(row)?,
        reason: row.get("reason")?,
        registered_unix_ms: row.get("registered_unix_ms")?,
        last_seen_unix_ms: row.get("last_seen_unix_ms")?,
        cases_finished: row.get_u32("cases_finished")?,
        cases_failed: row.get_u32("cases_failed")?,
        failures_in_a_row: row.get_u32("failures_in_a_row")?,
        busy_s: row.get("busy_s")?,
    })
}

impl WorkerState {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Quarantined => "quarantined",
        }
    }
}

fn state(row: &Row) -> Result<WorkerState, LibraryError> {
    let name: String = row.get("state")?;
    named("a worker", &name, [WorkerState::Active, WorkerState::Quarantined], WorkerState::name)
}

/// Registers a worker. A known worker keeps its counts and its state.
const REGISTER: &str = "
    insert into worker (id, code_version, model_hash, cores, registered_unix_ms, last_seen_unix_ms)
    values ($1, $2, $3, $4, $5, $5)
    on conflict (id) do update set code_version = excluded.code_version, model_hash = excluded.model_hash,
        cores = excluded.cores, last_seen_unix_ms = excluded.last_seen_unix_ms
    returning state";

impl Write for Registration {
    type Answer = WorkerState;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<WorkerState, LibraryError> {
        let insert = sql(REGISTER)
            .bind(&self.worker)
            .bind(&self.code_version)
            .bind(&self.model_hash)
            .bind(self.cores)
            .bind(self.now_unix_ms);
        let row = connection.row(insert).await?;
        row.as_ref().map_or(Ok(WorkerState::Active), state)
    }
}

struct Heartbeat {
    worker: String,
    now_unix_ms: i64,
}

impl Write for Heartbeat {
    type Answer = Option<WorkerRecord>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Self::Answer, LibraryError> {
        let seen = sql("update worker set last_seen_unix_ms = $2 where id = $1 returning *")
            .bind(&self.worker)
            .bind(self.now_unix_ms);
        connection.row(seen).await?.as_ref().map(record).transpose()
    }
}
