//! The campaigns being leased, prepared for messages.

use super::LeaseSizer;
use parking_lot::Mutex;
use std::collections::HashMap;
use std::sync::Arc;
use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_protocol::Shape;

/// Why a campaign can't be dispatched.
#[derive(Debug, thiserror::Error)]
pub enum DispatchError {
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// Its experiment can't be done by this version.
    #[error("campaign {campaign}: {source}")]
    Experiment {
        /// The campaign.
        campaign: String,
        /// Why not.
        source: ExperimentError,
    },
}

/// A campaign, and what its messages must look like.
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
        let shape = Shape {
            bins: experiment.features.frequencies_hz().len(),
            speeds_km_h: experiment.speeds_km_h.clone(),
        };
        Ok(Self { record, experiment, shape, lease_sizer: Mutex::default() })
    }

    /// Takes measured computing times of cases, in s.
    pub(crate) fn measured(&self, durations_s: impl IntoIterator<Item = f64>) {
        let mut lease_sizer = self.lease_sizer.lock();
        durations_s.into_iter().for_each(|case_s| lease_sizer.measured(case_s));
    }

    /// Cases of a lease for this number of working cores.
    fn cases_per_lease(&self, cores: u32) -> u32 {
        self.lease_sizer.lock().cases_per_lease(cores)
    }
}

/// The campaigns of a library, read when they are first needed: they never change.
pub(crate) struct Campaigns {
    library: Library,
    known: Mutex<HashMap<String, Arc<Served>>>,
    latest: Mutex<Option<Arc<Served>>>,
}

impl Campaigns {
    pub(crate) fn new(library: Library) -> Self {
        Self { library, known: Mutex::default(), latest: Mutex::default() }
    }

    /// A campaign of the library.
    pub(crate) async fn of(&self, id: &str) -> Result<Arc<Served>, DispatchError> {
        let known = self.known.lock().get(id).cloned();
        if let Some(served) = known {
            return Ok(served);
        }
        let served = Arc::new(Served::new(self.library.campaign(id).await?)?);
        let mut known = self.known.lock();
        Ok(known.entry(id.to_owned()).or_insert(served).clone())
    }

    /// Caches the campaign leased last: the next lease is most likely of the same one.
    pub(crate) fn leased(&self, served: &Arc<Served>) {
        *self.latest.lock() = Some(served.clone());
    }

    /// Cases of the next lease, as far as one can know before.
    pub(crate) fn cases_per_lease(&self, cores: u32) -> u32 {
        let latest = self.latest.lock();
        let unknown = || LeaseSizer::default().cases_per_lease(cores);
        latest.as_ref().map_or_else(unknown, |it| it.cases_per_lease(cores))
    }
}
