//! Verification of every number of the results.

use super::{Fault, Survey};
use crate::engine::sql;
use crate::result::{Attested, Gathering, StoredCase, passes_of};
use crate::{CampaignRecord, LibraryError};
use tokio_stream::StreamExt;

/// Faults in a campaign's results.
#[derive(Default)]
struct Faults {
    altered: Fault,
    finite: Fault,
    shape: Fault,
}

impl<F: FnMut()> Survey<'_, F> {
    /// Compares every result with its checksum, and its numbers with their valid range.
    pub(super) async fn values(&mut self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        let library = self.library;
        let bins = library.bins(&campaign.experiment_hash).await.unwrap_or(0);
        let mut faults = Faults::default();
        let mut gathering = Gathering::default();
        let mut rows = library.readers().stream(passes_of(&campaign.id));
        let mut last = None;
        while let Some(row) = rows.next().await {
            match row.and_then(|row| gathering.take(&row)) {
                Ok(None) => {}
                Ok(Some(case)) => {
                    last = Some(case.case.index);
                    self.value(&case, bins, &mut faults);
                }
                Err(error) => {
                    let after = last.map_or_else(String::new, |it| format!(" after case {it}"));
                    self.unreadable(&campaign.id, &format!("results{after}"), error)?;
                    break;
                }
            }
        }
        if let Some(case) = gathering.end() {
            self.value(&case, bins, &mut faults);
        }
        let Faults { altered, finite, shape } = faults;
        let place = &campaign.id;
        self.fault(
            place,
            "results that do not match their checksum: a number was altered",
            &altered,
        );
        self.fault(place, "results with NaN or infinite features", &finite);
        self.fault(place, "results with too many or too few bins", &shape);
        Ok(())
    }

    fn value(&mut self, case: &StoredCase, bins: usize, faults: &mut Faults) {
        (self.looked_at)();
        let index = case.case.index;
        match case.attested() {
            Attested::Whole => self.found.attested += 1,
            Attested::Unknown => self.found.unattested += 1,
            Attested::Altered => faults.altered.at(index),
        }
        let features = || case.passes.iter().map(|pass| &pass.features);
        let mut numbers = features().flat_map(|it| it.log_power.iter().chain(&it.band_levels_db));
        if !numbers.all(|number| number.is_finite()) {
            faults.finite.at(index);
        }
        if bins > 0 && features().any(|it| it.log_power.len() != bins) {
            faults.shape.at(index);
        }
    }
}

impl crate::Library {
    async fn bins(&self, experiment_hash: &str) -> Result<usize, LibraryError> {
        let ask = sql("select count(*) as n from frequency_bin where experiment_hash = $1");
        let row = self.readers().row(ask.bind(experiment_hash)).await?;
        row.map_or(Ok(0), |row| row.get_u32("n").map(|count| count as usize))
    }
}
