//! Version of the physics that computed the results of a campaign.

use crate::engine::{Text, sql};
use crate::result::StoredCase;
use crate::{Library, LibraryError};

/// Model of the result with the lowest index. A campaign is not continued with another model, so one result stands for
/// all.
const FIRST: Text = Text::Each {
    sqlite: "
        select model_hash from result where campaign_id = $1
        order by sobol_index, speed_km_h limit 1",
    postgres: "
        select model_hash from case_result where campaign_id = $1
        order by sobol_index limit 1",
};

impl Library {
    /// Checks that no other model than `own` has computed the results of a campaign. A campaign without results, or one
    /// that does not exist, passes. The cost does not depend on the number of cases.
    ///
    /// # Errors
    /// Returns [`LibraryError::OtherModel`], or an error if the library cannot be read.
    pub async fn check_model(&self, campaign: &str, own: &str) -> Result<(), LibraryError> {
        let Some(first) = self.readers().row(sql(FIRST).bind(campaign)).await? else {
            return Ok(());
        };
        let stored: String = first.get("model_hash")?;
        if stored == own {
            return Ok(());
        }
        Err(LibraryError::OtherModel { campaign: campaign.to_owned(), stored, own: own.to_owned() })
    }
}

/// Checks that all cases of a campaign have results of one model.
pub(crate) struct OneModel<'a> {
    campaign: &'a str,
    first: Option<String>,
}

impl<'a> OneModel<'a> {
    pub(crate) const fn of(campaign: &'a str) -> Self {
        Self { campaign, first: None }
    }

    /// # Errors
    /// [`LibraryError::MixedModels`] if the model of this case is not that of the first one.
    pub(crate) fn check(&mut self, case: &StoredCase) -> Result<(), LibraryError> {
        let one = self.first.get_or_insert_with(|| case.model_hash.clone());
        if *one == case.model_hash {
            return Ok(());
        }
        Err(LibraryError::MixedModels {
            campaign: self.campaign.to_owned(),
            one: one.clone(),
            other: case.model_hash.clone(),
            index: case.case.index,
        })
    }
}
