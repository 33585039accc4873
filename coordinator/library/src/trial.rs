//! Blind trials: the tables `trial`, `trial_case`, `trial_answer` and `trial_lease`.
//!
//! Several machines can share a trial. A machine derives the open cases from the stored answers. The table
//! `trial_lease` has the leases, and each answer is stored once.

use crate::campaign::sql_seed;
use crate::engine::{Connection, Row, Statement, Text, Write, sql};
use crate::library::Dated;
use crate::state::named;
use crate::{DiagnosisRecord, Library, LibraryError};

/// Number of hexadecimal digits of the hash in a trial's id.
const HASH_DIGITS: usize = 12;

/// Number of cases sealed in one statement; each has three values.
const SEALS_A_STATEMENT: usize = 1000;

/// Stores a trial; an existing one is kept unchanged.
const INSERT: &str = "
    insert into trial (id, seed, code_version, model_hash, created_at) values ($1, $2, $3, $4, $5)
    on conflict (id) do nothing";

/// Leases to worker $3 until $5 the first of a trial's ($1) cases ($2) that no other worker holds at time
/// $4.
const TAKE: Text = Text::Each {
    sqlite: "
        with next as (
            select trial_id as next_trial, case_number as next_number from trial_case
            where trial_id = $1 and case_number in (select value from json_each($2)) and not exists (
                select 1 from trial_lease
                where trial_lease.trial_id = trial_case.trial_id
                    and trial_lease.case_number = trial_case.case_number
                    and lease_expires_unix_ms > $4 and worker <> $3)
            order by case_number limit 1)
        insert into trial_lease (trial_id, case_number, worker, lease_expires_unix_ms)
        select next_trial, next_number, $3, $5 from next where true
        on conflict (trial_id, case_number) do update set
            worker = excluded.worker, lease_expires_unix_ms = excluded.lease_expires_unix_ms
            where trial_lease.lease_expires_unix_ms <= $4 or trial_lease.worker = $3
        returning case_number",
    postgres: "
        with next as (
            select trial_id as next_trial, case_number as next_number from trial_case
            where trial_id = $1 and case_number = any($2) and not exists (
                select 1 from trial_lease
                where trial_lease.trial_id = trial_case.trial_id
                    and trial_lease.case_number = trial_case.case_number
                    and lease_expires_unix_ms > $4 and worker <> $3)
            order by case_number limit 1 for update skip locked)
        insert into trial_lease (trial_id, case_number, worker, lease_expires_unix_ms)
        select next_trial, next_number, $3, $5 from next where true
        on conflict (trial_id, case_number) do update set
            worker = excluded.worker, lease_expires_unix_ms = excluded.lease_expires_unix_ms
            where trial_lease.lease_expires_unix_ms <= $4 or trial_lease.worker = $3
        returning case_number",
};

/// Extends a lease until $4 if the worker still has it.
const RENEW: &str = "
    update trial_lease set lease_expires_unix_ms = $4
    where trial_id = $1 and case_number = $2 and worker = $3";

/// Deletes the lease of a case.
const RELEASE: &str =
    "delete from trial_lease where trial_id = $1 and case_number = $2 and worker = $3";

/// Stores an answer. An existing answer to the same question is kept.
const INSERT_ANSWER: &str = "
    insert into trial_answer (trial_id, case_number, question, diagnosis_id, score, worker, answered_at)
    values ($1, $2, $3, $4, $5, $6, $7)
    on conflict (trial_id, case_number, question) do nothing";

/// A blind trial as stored in the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrialRecord {
    /// Seed that determines the hidden extensions of each case; below 2^63.
    pub seed: u64,
    /// Version of the program.
    pub code_version: String,
    /// Hash of the simulated physics.
    pub model_hash: String,
    /// SHA-256 of each case's truth, from case 0.
    pub seals: Vec<String>,
}

/// Questions that a trial asks about a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Question {
    /// Diagnosis with the whole catalogue.
    Catalogue,
    /// Diagnosis without the hidden kind in the catalogue (knock-out).
    KnockedOut,
    /// Diagnosis of the recording with shuffled sleepers.
    Shuffled,
    /// Evaluation with the method of the paper.
    Paper,
}

/// The scored answer to one question.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrialAnswer {
    /// Number of the case.
    pub number: u32,
    /// The question.
    pub question: Question,
    /// Score of the answer, as JSON.
    pub score_json: String,
}

impl TrialRecord {
    /// Id of the trial: the seed, and a hash of seed and program. Machines with different programs
    /// therefore do not share a trial. The number in the hashed text is the version of the format of cases.
    pub fn id(&self) -> String {
        let hash = crate::provenance::id(
            "tracktwin trial 2",
            &[&self.seed.to_string(), &self.code_version, &self.model_hash],
        );
        format!("{}-{}", self.seed, &hash[..HASH_DIGITS])
    }
}

impl Library {
    /// Stores a trial's seals. Seals that are already stored must be equal. A longer trial with the same
    /// seed adds its cases to a shorter one.
    ///
    /// # Errors
    /// Returns [`LibraryError::OtherTruth`] if a case was sealed with another truth.
    pub async fn seal_trial(&self, trial: TrialRecord) -> Result<(), LibraryError> {
        self.write_dated(trial).await
    }

    /// Returns all answers of a trial, by case number.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn trial_answers(&self, trial: &str) -> Result<Vec<TrialAnswer>, LibraryError> {
        let ask = "select case_number, question, score from trial_answer where trial_id = $1
            order by case_number, question";
        let rows = self.readers().rows(sql(ask).bind(trial)).await?;
        rows.iter().map(answer).collect()
    }

    /// Leases the first of these cases that no other worker holds. If the worker itself holds a case that
    /// it could not release, it gets this case again.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn lease_trial_case(
        &self,
        trial: &str,
        worker: &str,
        of: Vec<u32>,
        lease_ms: i64,
    ) -> Result<Option<u32>, LibraryError> {
        let of = of.into_iter().map(i64::from).collect();
        let now_unix_ms = self.now_unix_ms();
        let until_unix_ms = now_unix_ms.saturating_add(lease_ms);
        let (trial, worker) = (trial.to_owned(), worker.to_owned());
        self.write(ClaimQuestion { trial, worker, of, now_unix_ms, until_unix_ms }).await
    }

    /// Extends a lease by this duration from now, if the worker still has it.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn renew_trial_case(
        &self,
        trial: &str,
        worker: &str,
        number: u32,
        lease_ms: i64,
    ) -> Result<(), LibraryError> {
        let until_unix_ms = Some(self.now_unix_ms().saturating_add(lease_ms));
        let (trial, worker) = (trial.to_owned(), worker.to_owned());
        self.write(RenewOrRelease { trial, worker, number, until_unix_ms }).await
    }

    /// Releases a case.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_trial_case(
        &self,
        trial: &str,
        worker: &str,
        number: u32,
    ) -> Result<(), LibraryError> {
        let (trial, worker) = (trial.to_owned(), worker.to_owned());
        self.write(RenewOrRelease { trial, worker, number, until_unix_ms: None }).await
    }

    /// Stores an answer, and the diagnosis to which its score belongs. An existing answer to the same
    /// question is kept.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn record_trial_answer(
        &self,
        trial: &str,
        worker: &str,
        answer: TrialAnswer,
        diagnosis: Option<DiagnosisRecord>,
    ) -> Result<(), LibraryError> {
        let (trial, worker) = (trial.to_owned(), worker.to_owned());
        self.write_dated(RecordAnswer { trial, worker, answer, diagnosis }).await
    }
}

impl Question {
    const ALL: [Self; 4] = [Self::Catalogue, Self::KnockedOut, Self::Shuffled, Self::Paper];

    const fn name(self) -> &'static str {
        match self {
            Self::Catalogue => "catalogue",
            Self::KnockedOut => "knocked_out",
            Self::Shuffled => "shuffled",
            Self::Paper => "paper",
        }
    }
}

fn answer(row: &Row) -> Result<TrialAnswer, LibraryError> {
    let name: String = row.get("question")?;
    Ok(TrialAnswer {
        number: row.get_u32("case_number")?,
        question: named("a trial's question", &name, Question::ALL, Question::name)?,
        score_json: row.get("score")?,
    })
}

impl Write for Dated<TrialRecord> {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let trial = &self.it;
        let id = trial.id();
        let insert = sql(INSERT)
            .bind(&id)
            .bind(sql_seed(trial.seed)?)
            .bind(&trial.code_version)
            .bind(&trial.model_hash)
            .bind(&self.at);
        connection.execute(insert).await?;
        let numbered: Vec<_> = (0_u32..).zip(&trial.seals).collect();
        for some in numbered.chunks(SEALS_A_STATEMENT) {
            let insert = format!(
                "insert into trial_case (trial_id, case_number, truth_sha256) values {}
                on conflict (trial_id, case_number) do nothing",
                connection.dialect().rows_of_values(some.len(), 3)
            );
            let bound = |insert: Statement, &(number, seal): &(u32, &String)| {
                insert.bind(&id).bind(number).bind(seal)
            };
            connection.execute(some.iter().fold(sql(insert), bound)).await?;
        }
        let ask = "select case_number, truth_sha256 from trial_case where trial_id = $1";
        for row in connection.rows(sql(ask).bind(&id)).await? {
            let number = row.get_u32("case_number")?;
            let stored: String = row.get("truth_sha256")?;
            if trial.seals.get(number as usize).is_some_and(|seal| *seal != stored) {
                return Err(LibraryError::OtherTruth { trial: id, number });
            }
        }
        Ok(())
    }
}

struct ClaimQuestion {
    trial: String,
    worker: String,
    of: Vec<i64>,
    now_unix_ms: i64,
    until_unix_ms: i64,
}

impl Write for ClaimQuestion {
    type Answer = Option<u32>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Option<u32>, LibraryError> {
        let take = sql(TAKE)
            .bind(&self.trial)
            .bind(self.of.clone())
            .bind(&self.worker)
            .bind(self.now_unix_ms)
            .bind(self.until_unix_ms);
        connection.row(take).await?.map(|row| row.get_u32("case_number")).transpose()
    }
}

/// A write that extends a lease until this time, or releases it.
struct RenewOrRelease {
    trial: String,
    worker: String,
    number: u32,
    until_unix_ms: Option<i64>,
}

impl Write for RenewOrRelease {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let of = |text| sql(text).bind(&self.trial).bind(self.number).bind(&self.worker);
        let keep = match self.until_unix_ms {
            Some(until_unix_ms) => of(RENEW).bind(until_unix_ms),
            None => of(RELEASE),
        };
        connection.execute(keep).await.map(drop)
    }
}

struct RecordAnswer {
    trial: String,
    worker: String,
    answer: TrialAnswer,
    diagnosis: Option<DiagnosisRecord>,
}

impl Write for Dated<RecordAnswer> {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.it.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let RecordAnswer { trial, worker, answer, diagnosis } = &self.it;
        let diagnosis = match diagnosis {
            Some(diagnosis) => Some(diagnosis.store(connection, &self.at).await?),
            None => None,
        };
        let insert = sql(INSERT_ANSWER)
            .bind(trial)
            .bind(answer.number)
            .bind(answer.question.name())
            .bind(diagnosis)
            .bind(&answer.score_json)
            .bind(worker)
            .bind(&self.at);
        connection.execute(insert).await.map(drop)
    }
}
