//! Number of cases with contact loss.

use crate::engine::{Text, sql};
use crate::{Library, LibraryError};

/// Number of a campaign's cases with contact loss, and the largest share. Both databases use an index that
/// has these cases only.
const LOST: Text = Text::Each {
    sqlite: "
        select count(distinct sobol_index) as cases, max(contact_loss_share) as share
        from result where campaign_id = $1 and contact_loss_share > 0",
    postgres: "
        select count(*) as cases,
            max((select max(share) from unnest(contact_loss_shares) as of (share))) as share
        from case_result where campaign_id = $1 and 0 < any (contact_loss_shares)",
};

/// Contact loss between wheel and rail in the cases of a campaign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactLoss {
    /// Number of cases with contact loss at one speed at least.
    pub cases: u32,
    /// Largest share of a pass's recorded time with contact loss, 0 to 1.
    pub largest_share: f64,
}

impl Library {
    /// Returns the contact loss in the cases of a campaign. Results stored before schema 8 lack this
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
