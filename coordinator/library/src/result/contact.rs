//! How many cases lost the rail.

use crate::engine::{Text, sql};
use crate::{Library, LibraryError};

/// Cases of a campaign that lost the rail, and the largest share; both databases read an index of these cases alone.
const LOST: Text = Text::Each {
    sqlite: "
        select count(distinct sobol_index) as cases, max(contact_loss_share) as share
        from result where campaign_id = $1 and contact_loss_share > 0",
    postgres: "
        select count(*) as cases,
            max((select max(share) from unnest(contact_loss_shares) as of (share))) as share
        from case_result where campaign_id = $1 and 0 < any (contact_loss_shares)",
};

/// Cases of a campaign whose wheel was in the air for some of the recorded time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactLoss {
    /// How many, at one speed at least.
    pub cases: u32,
    /// The largest share of a pass's recorded time, 0 to 1.
    pub largest_share: f64,
}

impl Library {
    /// Number of cases of a campaign with loss of contact. Results stored before schema 8 lack this
    /// information and are not counted.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn contact_loss(&self, campaign: &str) -> Result<ContactLoss, LibraryError> {
        let Some(row) = self.readers().row(sql(LOST).bind(campaign)).await? else {
            return Ok(ContactLoss::default());
        };
        let largest_share = row.get::<Option<f64>>("share")?.unwrap_or(0.0);
        Ok(ContactLoss { cases: row.get_u32("cases")?, largest_share })
    }
}
