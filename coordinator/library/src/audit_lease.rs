//! Leases of audits: renewal, and the audit that belongs to a report.

use crate::case::case_of;
use crate::engine::{Connection, Text, Write, sql};
use crate::{Audit, Library, LibraryError};

/// Extends until $4 the leases of audits ($3) of a campaign ($1) that worker $2 still has.
const RENEW: Text = Text::Each {
    sqlite: "
        update audit set lease_expires_unix_ms = $4
        where campaign_id = $1 and auditor = $2 and state = 'leased'
            and sobol_index in (select value from json_each($3))",
    postgres: "
        update audit set lease_expires_unix_ms = $4
        where campaign_id = $1 and auditor = $2 and state = 'leased' and sobol_index = any($3)",
};

/// The audit of case $2 of a campaign ($1), if it is leased to worker $3.
const LEASED: &str = "
    select campaign_case.*, audit.worker as audited from audit
    join campaign_case using (campaign_id, sobol_index)
    where campaign_id = $1 and sobol_index = $2 and auditor = $3 and audit.state = 'leased'";

/// One open audit of any campaign.
const OPEN: &str = "select sobol_index from audit where state in ('waiting', 'leased') limit 1";

impl Library {
    /// Whether any campaign has an audit that is not completed.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn has_open_audits(&self) -> Result<bool, LibraryError> {
        self.readers().row(sql(OPEN)).await.map(|row| row.is_some())
    }

    /// Extends the leases of audits: they end after `lease_ms`. Audits that the auditor has lost are ignored.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn renew_audits(
        &self,
        campaign: &str,
        auditor: &str,
        indices: Vec<u32>,
        lease_ms: i64,
    ) -> Result<(), LibraryError> {
        let (campaign, auditor) = (campaign.to_owned(), auditor.to_owned());
        let until_unix_ms = self.now_unix_ms().saturating_add(lease_ms);
        self.write(RenewAudits { campaign, auditor, indices, until_unix_ms }).await
    }

    /// Returns the audit of a case that is leased to this auditor; `None` if there is none.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn leased_audit(
        &self,
        campaign: &str,
        index: u32,
        auditor: &str,
    ) -> Result<Option<Audit>, LibraryError> {
        let ask = sql(LEASED).bind(campaign).bind(index).bind(auditor);
        let Some(row) = self.readers().row(ask).await? else { return Ok(None) };
        let (campaign, worker) = (campaign.to_owned(), row.get("audited")?);
        Ok(Some(Audit { campaign, case: case_of(&row)?, worker }))
    }
}

struct RenewAudits {
    campaign: String,
    auditor: String,
    indices: Vec<u32>,
    until_unix_ms: i64,
}

impl Write for RenewAudits {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.auditor)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let indices: Vec<_> = self.indices.iter().copied().map(i64::from).collect();
        let renew = sql(RENEW).bind(&self.campaign).bind(&self.auditor).bind(indices);
        connection.execute(renew.bind(self.until_unix_ms)).await.map(drop)
    }
}
