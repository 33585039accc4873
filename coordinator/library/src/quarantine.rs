//! Quarantine of workers. A worker in quarantine gets no cases.

use crate::engine::{Connection, Text, Write, sql};
use crate::{Library, LibraryError, WorkerState, result};

/// Number of a campaign's cases with flagged results. It reads all results of the campaign.
const FLAGGED: Text = Text::Each {
    sqlite: "
        select count(distinct sobol_index) as cases from result
        where campaign_id = $1 and flagged is not null",
    postgres: "
        select count(*) as cases from case_result where campaign_id = $1 and flagged is not null",
};

impl Library {
    /// Puts a worker into quarantine. The worker gets no more cases, and its results are flagged with
    /// `reason`. Returns the number of flagged results; [`crate::Retry::Flagged`] simulates their cases
    /// again.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownWorker`], or an error if the library cannot be written.
    pub async fn flag_worker(&self, worker: &str, reason: &str) -> Result<u64, LibraryError> {
        self.write(Flag { worker: worker.to_owned(), reason: reason.to_owned() }).await
    }

    /// Number of a campaign's cases with flagged results. [`Library::training_set`] refuses such a campaign.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn flagged(&self, campaign: &str) -> Result<u32, LibraryError> {
        let row = self.readers().row(sql(FLAGGED).bind(campaign)).await?;
        row.map_or(Ok(0), |row| row.get_u32("cases"))
    }

    /// Releases a worker from quarantine. Its flagged results stay flagged.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownWorker`], or an error if the library cannot be written.
    pub async fn pardon_worker(&self, worker: &str) -> Result<(), LibraryError> {
        self.write(Pardon { worker: worker.to_owned() }).await
    }
}

/// Sets a worker's state and the reason for it.
const SET: &str = "update worker set state = $2, reason = $3, failures_in_a_row = 0 where id = $1";

/// Puts a worker into quarantine, or releases it if `reason` is `None`.
async fn set_quarantine(
    connection: &mut Connection,
    worker: &str,
    reason: Option<String>,
) -> Result<(), LibraryError> {
    let state = if reason.is_some() { WorkerState::Quarantined } else { WorkerState::Active };
    let set = sql(SET).bind(worker).bind(state.name()).bind(reason);
    if connection.execute(set).await? == 0 {
        return Err(LibraryError::UnknownWorker { id: worker.to_owned() });
    }
    Ok(())
}

/// A write that releases a worker from quarantine.
struct Pardon {
    worker: String,
}

impl Write for Pardon {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        set_quarantine(connection, &self.worker, None).await
    }
}

/// A write that puts a worker into quarantine and flags its results.
pub(crate) struct Flag {
    pub(crate) worker: String,
    pub(crate) reason: String,
}

impl Write for Flag {
    type Answer = u64;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        set_quarantine(connection, &self.worker, Some(self.reason.clone())).await?;
        result::flag(connection, &self.worker, &self.reason).await
    }
}
