//! The table `audit`: finished cases that a second worker simulates again.
//!
//! The hash of a case decides whether the case is audited. The sample therefore does not depend on the
//! order of the results, and a worker cannot influence it. The caller compares the results of the second
//! worker; this module only stores the outcome.

use crate::case::case_of;
use crate::engine::{Connection, Row, Text, Write, sql};
use crate::quarantine::Flag;
use crate::state::named;
use crate::{Library, LibraryError, Report};
use std::collections::HashMap;
use tracktwin_parameters::Case;
use tracktwin_protocol::CaseReport;

/// Inserts audits for cases ($2) of a campaign ($1) whose results are from worker $3.
const MARK: Text = Text::Each {
    sqlite: "
        insert into audit (campaign_id, sobol_index, worker)
        select campaign_id, sobol_index, $3 from campaign_case
        where campaign_id = $1 and sobol_index in (select value from json_each($2))
        on conflict (campaign_id, sobol_index) do nothing",
    postgres: "
        insert into audit (campaign_id, sobol_index, worker)
        select campaign_id, sobol_index, $3 from campaign_case
        where campaign_id = $1 and sobol_index = any($2)
        on conflict (campaign_id, sobol_index) do nothing",
};

/// Leases until $5 the first $4 audits of a running campaign ($1) that are not leased at time $3. Audits of
/// the worker's ($2) own results are excluded.
const TAKE: Text = Text::Each {
    sqlite: "
        with next as (
            select campaign_id as next_campaign, sobol_index as next_index from audit
            where campaign_id = $1 and worker <> $2
                and (state = 'waiting' or (state = 'leased' and lease_expires_unix_ms <= $3))
                and exists (select 1 from campaign where id = $1 and state = 'running')
            order by sobol_index limit $4)
        update audit set state = 'leased', auditor = $2, lease_expires_unix_ms = $5
        from next where campaign_id = next_campaign and sobol_index = next_index
        returning sobol_index, worker",
    postgres: "
        with next as (
            select campaign_id as next_campaign, sobol_index as next_index from audit
            where campaign_id = $1 and worker <> $2
                and (state = 'waiting' or (state = 'leased' and lease_expires_unix_ms <= $3))
                and exists (select 1 from campaign where id = $1 and state = 'running')
            order by sobol_index limit $4 for update skip locked)
        update audit set state = 'leased', auditor = $2, lease_expires_unix_ms = $5
        from next where campaign_id = next_campaign and sobol_index = next_index
        returning sobol_index, worker",
};

/// The cases of leased audits.
const CASES: Text = Text::Each {
    sqlite: "
        select * from campaign_case
        where campaign_id = $1 and sobol_index in (select value from json_each($2))
        order by sobol_index",
    postgres: "
        select * from campaign_case
        where campaign_id = $1 and sobol_index = any($2)
        order by sobol_index",
};

/// Stores the outcome of an audit if it is still leased to this worker ($3). Returns the worker whose
/// result was audited.
const KEEP: &str = "
    update audit set state = $4, difference_dB = $5, ended_unix_ms = $6, lease_expires_unix_ms = null
    where campaign_id = $1 and sobol_index = $2 and auditor = $3 and state = 'leased'
    returning worker";

/// Releases audits that are still leased to this worker ($2).
const RELEASE: Text = Text::Each {
    sqlite: "
        update audit set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and auditor = $2 and state = 'leased'
            and sobol_index in (select value from json_each($3))",
    postgres: "
        update audit set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and auditor = $2 and state = 'leased' and sobol_index = any($3)",
};

/// Number of open audits that a worker with a message since $2 could do.
const TO_DO: &str = "
    select count(*) as cases from audit
    where campaign_id = $1 and state in ('waiting', 'leased') and exists (
        select 1 from worker where id <> audit.worker and state = 'active' and last_seen_unix_ms >= $2)";

/// A finished case to be simulated again.
#[derive(Clone, Debug, PartialEq)]
pub struct Audit {
    /// Id of the campaign.
    pub campaign: String,
    /// The finished case.
    pub case: Case,
    /// Worker whose result is audited.
    pub worker: String,
}

/// Outcome of an audit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuditFinding {
    /// Whether both results agree within the caller's tolerance.
    pub agrees: bool,
    /// Largest difference of a band level, in dB.
    pub difference_db: f64,
}

impl AuditFinding {
    const fn state(self) -> AuditState {
        if self.agrees { AuditState::Agrees } else { AuditState::Differs }
    }
}

/// Number of audits of a campaign by state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AuditCounts {
    /// Audits that are not completed.
    pub open: u32,
    /// Audits whose results agree.
    pub agree: u32,
    /// Audits whose results differ.
    pub differ: u32,
}

/// State of an audit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AuditState {
    Waiting,
    Leased,
    Agrees,
    Differs,
}

impl AuditState {
    const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Leased => "leased",
            Self::Agrees => "agrees",
            Self::Differs => "differs",
        }
    }

    fn from_name(name: &str) -> Result<Self, LibraryError> {
        let all = [Self::Waiting, Self::Leased, Self::Agrees, Self::Differs];
        named("an audit", name, all, Self::name)
    }
}

impl Library {
    /// Leases cases of a campaign to `worker` for an audit: at most the requested number, none with the
    /// worker's own result, and none if the campaign is not running. The lease ends after `lease_ms`.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn audit_sample(
        &self,
        campaign: &str,
        worker: &str,
        cases_max: u32,
        lease_ms: i64,
    ) -> Result<Vec<Audit>, LibraryError> {
        let (campaign, worker) = (campaign.to_owned(), worker.to_owned());
        let now_unix_ms = self.now_unix_ms();
        self.write(Sample { campaign, worker, cases_max, now_unix_ms, lease_ms }).await
    }

    /// Stores the finding of an auditor. Returns the worker whose result was audited; `None` if the audit
    /// is no longer leased to this auditor. The same write puts the worker in `wrong` into quarantine, with
    /// the reason in `wrong`; see [`Library::flag_worker`].
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn audited(
        &self,
        campaign: &str,
        index: u32,
        auditor: &str,
        finding: AuditFinding,
        wrong: Option<(&str, &str)>,
    ) -> Result<Option<String>, LibraryError> {
        let (campaign, auditor) = (campaign.to_owned(), auditor.to_owned());
        let now_unix_ms = self.now_unix_ms();
        let wrong = wrong
            .map(|(worker, reason)| Flag { worker: worker.to_owned(), reason: reason.to_owned() });
        self.write(RecordAudit { campaign, index, auditor, finding, wrong, now_unix_ms }).await
    }

    /// Releases the audits of these cases, which the auditor will not do.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_audits(
        &self,
        campaign: &str,
        auditor: &str,
        indices: Vec<u32>,
    ) -> Result<(), LibraryError> {
        let (campaign, auditor) = (campaign.to_owned(), auditor.to_owned());
        self.write(ReleaseAudits { campaign, auditor, indices }).await
    }

    /// Number of open audits of a campaign that some worker could do. This worker has sent a message since
    /// the given time, is not in quarantine, and did not simulate the case itself.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn audits_to_do(
        &self,
        campaign: &str,
        since_unix_ms: i64,
    ) -> Result<u32, LibraryError> {
        let rows = self.readers().rows(sql(TO_DO).bind(campaign).bind(since_unix_ms)).await?;
        rows.first().map_or(Ok(0), |row| row.get_u32("cases"))
    }

    /// Number of a campaign's audits by state.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn audits(&self, campaign: &str) -> Result<AuditCounts, LibraryError> {
        let ask =
            "select state, count(*) as cases from audit where campaign_id = $1 group by state";
        let mut counts = AuditCounts::default();
        for row in self.readers().rows(sql(ask).bind(campaign)).await? {
            let cases = row.get_u32("cases")?;
            match AuditState::from_name(&row.get::<String>("state")?)? {
                AuditState::Agrees => counts.agree = cases,
                AuditState::Differs => counts.differ = cases,
                AuditState::Waiting | AuditState::Leased => counts.open += cases,
            }
        }
        Ok(counts)
    }
}

/// Inserts audits for the sampled share of newly finished cases.
pub(crate) async fn sample<'a>(
    connection: &mut Connection,
    report: &Report,
    finished: impl Iterator<Item = &'a CaseReport>,
) -> Result<(), LibraryError> {
    let sampled = finished.filter(|case| is_sampled(&case.parameter_hash, report.audit_share));
    let sampled: Vec<_> = sampled.map(|case| i64::from(case.index)).collect();
    if sampled.is_empty() {
        return Ok(());
    }
    let mark = sql(MARK).bind(&report.campaign).bind(sampled).bind(&report.worker);
    connection.execute(mark).await.map(drop)
}

/// Whether the case with this parameter hash (hexadecimal) belongs to the sampled share.
fn is_sampled(parameter_hash: &str, share: f64) -> bool {
    let leading = parameter_hash.get(..8).and_then(|digits| u32::from_str_radix(digits, 16).ok());
    leading.is_some_and(|leading| f64::from(leading) < share * 2_f64.powi(32))
}

struct Sample {
    campaign: String,
    worker: String,
    cases_max: u32,
    now_unix_ms: i64,
    lease_ms: i64,
}

impl Write for Sample {
    type Answer = Vec<Audit>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Vec<Audit>, LibraryError> {
        let take = sql(TAKE)
            .bind(&self.campaign)
            .bind(&self.worker)
            .bind(self.now_unix_ms)
            .bind(self.cases_max)
            .bind(self.now_unix_ms.saturating_add(self.lease_ms));
        let taken = |row: &Row| Ok((row.get_u32("sobol_index")?, row.get("worker")?));
        let rows = connection.rows(take).await?;
        let taken =
            rows.iter().map(taken).collect::<Result<HashMap<u32, String>, LibraryError>>()?;
        self.audits(connection, taken).await
    }
}

impl Sample {
    /// The cases with these indices, each with the worker whose result is audited.
    async fn audits(
        &self,
        connection: &mut Connection,
        mut taken: HashMap<u32, String>,
    ) -> Result<Vec<Audit>, LibraryError> {
        if taken.is_empty() {
            return Ok(Vec::new());
        }
        let indices: Vec<_> = taken.keys().copied().map(i64::from).collect();
        let rows = connection.rows(sql(CASES).bind(&self.campaign).bind(indices)).await?;
        let mut audits = Vec::with_capacity(rows.len());
        for row in &rows {
            let case = case_of(row)?;
            if let Some(worker) = taken.remove(&case.index) {
                audits.push(Audit { campaign: self.campaign.clone(), case, worker });
            }
        }
        Ok(audits)
    }
}

struct RecordAudit {
    campaign: String,
    index: u32,
    auditor: String,
    finding: AuditFinding,
    wrong: Option<Flag>,
    now_unix_ms: i64,
}

impl Write for RecordAudit {
    type Answer = Option<String>;

    fn worker(&self) -> Option<&str> {
        Some(&self.auditor)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Option<String>, LibraryError> {
        let keep = sql(KEEP)
            .bind(&self.campaign)
            .bind(self.index)
            .bind(&self.auditor)
            .bind(self.finding.state().name())
            .bind(self.finding.difference_db)
            .bind(self.now_unix_ms);
        let Some(kept) = connection.row(keep).await? else { return Ok(None) };
        if let Some(wrong) = &self.wrong {
            wrong.apply(connection).await?;
        }
        kept.get("worker").map(Some)
    }
}

struct ReleaseAudits {
    campaign: String,
    auditor: String,
    indices: Vec<u32>,
}

impl Write for ReleaseAudits {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.auditor)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let indices: Vec<_> = self.indices.iter().copied().map(i64::from).collect();
        let release = sql(RELEASE).bind(&self.campaign).bind(&self.auditor).bind(indices);
        connection.execute(release).await.map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::is_sampled;

    #[test]
    fn the_share_of_sampled_hashes_is_the_share_asked_for() {
        let hash = |case: u32| blake3::hash(&case.to_be_bytes()).to_hex();
        for (share, expected) in [(0.0, 0..=0), (1.0, 10_000..=10_000), (0.01, 70..=130)] {
            let sampled = (0..10_000).filter(|&case| is_sampled(&hash(case), share)).count();
            // Three standard deviations about the mean of 100.
            assert!(expected.contains(&sampled), "{sampled} at {share}");
        }
    }
}
