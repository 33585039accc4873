//! The table `worker`: who works for the farm, as all coordinators see it.

use crate::engine::{Connection, Row, Write, sql};
use crate::state::named;
use crate::{Library, LibraryError};

/// Whether a worker is given cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WorkerState {
    /// It is.
    Active,
    /// It is not: something speaks against its results.
    Quarantined,
}

/// Registration of a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Registration {
    /// Its name; one that comes again under the same name keeps its counts.
    pub worker: String,
    /// Version of its program.
    pub code_version: String,
    /// Hash of its physics.
    pub model_hash: String,
    /// Groups of cases it simulates at a time.
    pub cores: u32,
    /// The library's clock.
    pub now_unix_ms: i64,
}

/// A worker as the library knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerRecord {
    /// Its name.
    pub id: String,
    /// Version of its program.
    pub code_version: String,
    /// Hash of its physics.
    pub model_hash: String,
    /// Groups of cases it simulates at a time.
    pub cores: u32,
    /// Whether it is given cases.
    pub state: WorkerState,
    /// Why not.
    pub reason: Option<String>,
    /// When it came first.
    pub registered_unix_ms: i64,
    /// Time of its last message.
    pub last_seen_unix_ms: i64,
    /// Cases whose results it brought first.
    pub cases_finished: u32,
    /// Attempts it reported as failed.
    pub cases_failed: u32,
    /// Of these, the last ones without a finished case between.
    pub failures_in_a_row: u32,
    /// Computing time of its finished cases, in s.
    pub busy_s: f64,
}

impl WorkerRecord {
    /// Why it is in quarantine, if it is.
    pub fn quarantine(self) -> Option<String> {
        let reason = self.reason.unwrap_or_else(|| "no reason given".to_owned());
        (self.state == WorkerState::Quarantined).then_some(reason)
    }

    /// Mean computing time of a case, in s.
    pub fn mean_case_s(&self) -> Option<f64> {
        (self.cases_finished > 0).then(|| self.busy_s / f64::from(self.cases_finished))
    }
}

impl Library {
    /// Notes that a worker has come; answers whether it is to be given cases.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn register_worker(
        &self,
        registration: Registration,
    ) -> Result<WorkerState, LibraryError> {
        self.write(registration).await
    }

    /// Records a message of a worker; returns its record if it has registered.
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

    /// Record of a worker, if it has ever registered.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn worker(&self, id: &str) -> Result<Option<WorkerRecord>, LibraryError> {
        let ask = sql("select * from worker where id = $1").bind(id);
        self.readers().row(ask).await?.as_ref().map(record).transpose()
    }

    /// Workers with a message since then, by name.
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

/// Notes that a worker has come; one that comes again keeps its counts and its state.
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
