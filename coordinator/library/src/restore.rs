//! Cases that were altered after they were added, and their restoration.

use crate::campaign::sql_seed;
use crate::case::case_of;
use crate::engine::{Connection, Write, sql};
use crate::{Library, LibraryError};
use tokio_stream::StreamExt;
use tracktwin_parameters::{Case, Parameter};

/// A case that does not match its hash.
#[derive(Clone, Debug, PartialEq)]
pub struct AlteredCase {
    /// The case as stored.
    pub case: Case,
    /// The stored hash.
    pub parameter_hash: String,
}

impl Library {
    /// The cases of a campaign that do not match their hash, by ascending index.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn altered_cases(&self, campaign: &str) -> Result<Vec<AlteredCase>, LibraryError> {
        let ask = "select * from campaign_case where campaign_id = $1 order by sobol_index";
        let mut rows = self.readers().stream(sql(ask).bind(campaign));
        let mut altered = Vec::new();
        while let Some(row) = rows.next().await {
            let row = row?;
            let (case, parameter_hash) = (case_of(&row)?, row.get::<String>("parameter_hash")?);
            if case.parameter_hash() != parameter_hash {
                altered.push(AlteredCase { case, parameter_hash });
            }
        }
        Ok(altered)
    }

    /// Overwrites parameters, seed and hash of existing cases, each with what was drawn for it besides. A case
    /// that was given up waits again, with zero attempts; results are kept.
    ///
    /// # Errors
    /// Returns [`LibraryError::SeedTooLarge`], or an error if the library cannot be written.
    pub async fn restore_cases(
        &self,
        campaign: &str,
        cases: Vec<(Case, Option<String>)>,
    ) -> Result<(), LibraryError> {
        self.write(Restore { campaign: campaign.to_owned(), cases }).await
    }
}

struct Restore {
    campaign: String,
    cases: Vec<(Case, Option<String>)>,
}

impl Write for Restore {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let columns = Parameter::ALL.iter().map(|parameter| parameter.name());
        let columns = columns.chain(["surface_seed", "parameter_hash", "drawn"]);
        let set: Vec<_> = (3..).zip(columns).map(|(n, name)| format!("{name} = ${n}")).collect();
        let set = set.join(", ");
        let restore = format!(
            "update campaign_case set {set},
                attempts = case when state = 'failed' then 0 else attempts end,
                error = case when state = 'failed' then null else error end,
                state = case when state = 'failed' then 'waiting' else state end
            where campaign_id = $1 and sobol_index = $2"
        );
        for (case, drawn) in &self.cases {
            let mut restore = sql(restore.clone()).bind(&self.campaign).bind(case.index);
            restore = case.parameters.values().iter().fold(restore, |it, &value| it.bind(value));
            restore = restore.bind(sql_seed(case.surface_seed)?).bind(case.parameter_hash());
            connection.execute(restore.bind(drawn.clone())).await?;
        }
        Ok(())
    }
}
