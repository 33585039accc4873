//! The campaigns that are leased, prepared for building messages.

use super::LeaseSizer;
use parking_lot::Mutex;
use std::collections::HashMap;
use std::sync::Arc;
use tracktwin_experiment::{Experiment, ExperimentError, MODEL_HASH};
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_protocol::Shape;

/// Reasons for not dispatching a campaign.
#[derive(Debug, thiserror::Error)]
pub enum DispatchError {
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// This version cannot simulate the campaign's experiment.
    #[error("campaign {campaign}: {source}")]
    Experiment {
        /// Id of the campaign.
        campaign: String,
        /// Cause.
        source: ExperimentError,
    },
    /// Another version stored the experiment, and this version writes it in another form.
    #[error(
        "campaign {campaign}: another version of tracktwin stored its experiment, and this version does not reproduce it; \
         continue the campaign with that version, or add its file again"
    )]
    OtherForm {
        /// Id of the campaign.
        campaign: String,
    },
}

impl DispatchError {
    /// Whether later calls fail too: this version cannot simulate the campaign, or its stored data are invalid.
    pub(crate) const fn is_lasting(&self) -> bool {
        matches!(
            self,
            Self::Experiment { .. }
                | Self::OtherForm { .. }
                | Self::Library(LibraryError::Damaged { .. } | LibraryError::OtherModel { .. })
        )
    }
}

/// A campaign with the values that its messages need.
pub(crate) struct Served {
    pub(crate) record: CampaignRecord,
    pub(crate) experiment: Experiment,
    pub(crate) shape: Shape,
    lease_sizer: Mutex<LeaseSizer>,
}

impl Served {
    fn new(record: CampaignRecord) -> Result<Self, DispatchError> {
        let experiment = Experiment::from_json(&record.experiment_json)
            .map_err(|source| DispatchError::Experiment { campaign: record.id.clone(), source })?;
        // Every worker makes the same check, and would end.
        if experiment.hash() != record.experiment_hash {
            return Err(DispatchError::OtherForm { campaign: record.id });
        }
        let shape = Shape {
            bins: experiment.features.frequencies_hz().len(),
            speeds_km_h: experiment.speeds_km_h.clone(),
        };
        Ok(Self { record, experiment, shape, lease_sizer: Mutex::default() })
    }

    /// Adds measured computing times of cases, in s, to the running mean.
    pub(crate) fn measured(&self, durations_s: impl IntoIterator<Item = f64>) {
        let mut lease_sizer = self.lease_sizer.lock();
        durations_s.into_iter().for_each(|case_s| lease_sizer.measured(case_s));
    }

    /// Number of cases in a lease if this number of cores works.
    fn cases_per_lease(&self, cores: u32) -> u32 {
        self.lease_sizer.lock().cases_per_lease(cores)
    }
}

/// Cache of the library's campaigns. A campaign is read once, because its definition never changes.
pub(crate) struct Campaigns {
    library: Library,
    known: Mutex<HashMap<String, Arc<Served>>>,
}

impl Campaigns {
    pub(crate) fn new(library: Library) -> Self {
        Self { library, known: Mutex::default() }
    }

    /// Returns a campaign of the library, from the cache if possible.
    pub(crate) async fn of(&self, id: &str) -> Result<Arc<Served>, DispatchError> {
        let known = self.known.lock().get(id).cloned();
        if let Some(served) = known {
            return Ok(served);
        }
        let served = Arc::new(Served::new(self.library.campaign(id).await?)?);
        self.library.check_model(id, MODEL_HASH).await?;
        let mut known = self.known.lock();
        Ok(known.entry(id.to_owned()).or_insert(served).clone())
    }

    /// Number of cases in a lease of each known campaign if this number of cores works; at most
    /// `cases_max`.
    pub(crate) fn cases_per_lease(&self, cores: u32, cases_max: u32) -> HashMap<String, u32> {
        let size = |served: &Served| served.cases_per_lease(cores).min(cases_max);
        self.known.lock().iter().map(|(id, served)| (id.clone(), size(served))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_experiment_of_another_form_is_refused_before_a_worker_gets_it() {
        let experiment =
            crate::campaign::Campaign::built_in(Some(2)).unwrap().definition.experiment;
        let record = CampaignRecord {
            id: "c".to_owned(),
            name: "c".to_owned(),
            definition_json: String::new(),
            definition_hash: String::new(),
            experiment_json: experiment.to_json(),
            experiment_hash: experiment.hash(),
            speeds_km_h: experiment.speeds_km_h.clone(),
            seed: 1,
        };
        assert!(Served::new(record.clone()).is_ok());
        let other = CampaignRecord { experiment_hash: "0".to_owned(), ..record };
        let Err(error) = Served::new(other) else { panic!("another form was accepted") };
        assert!(error.is_lasting() && error.to_string().contains("another version"), "{error}");
    }

    #[test]
    fn a_library_that_is_away_is_no_reason_to_give_a_campaign_up() {
        let away = || LibraryError::Unavailable { reason: "no response".to_owned() };
        for error in [away(), LibraryError::DiskFull, LibraryError::Busy, LibraryError::Closed] {
            assert!(!DispatchError::Library(error).is_lasting());
        }
        let source = Experiment::from_json("?").unwrap_err();
        assert!(DispatchError::Experiment { campaign: "c".to_owned(), source }.is_lasting());
        assert!(DispatchError::OtherForm { campaign: "c".to_owned() }.is_lasting());
        let damaged = LibraryError::Damaged { what: "campaign c: speeds_km_h".to_owned() };
        assert!(DispatchError::Library(damaged).is_lasting());
    }
}
