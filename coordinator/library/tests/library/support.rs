//! A library in either database, and a campaign for tests.

use std::collections::HashMap;
use tempfile::TempDir;
use test_postgres::Server;
use tracktwin_experiment::{Outcome, PassFeatures};
use tracktwin_library::{
    AttemptsMax, CampaignRecord, Held, LeaseRequest, Leased, Library, Report, ReportVerdict,
};
use tracktwin_parameters::{Case, Parameter, ParameterSet};
use tracktwin_protocol::{CaseReport, checksum};
use tracktwin_signal::{Features, ThirdOctave};

pub(crate) const CAMPAIGN: &str = "test-000000000000";

/// Attempts before a case is given up, in these tests.
pub(crate) const ATTEMPTS_MAX: u32 = 3;

/// The limits of attempts as an argument for the library.
pub(crate) const GIVE_UP: AttemptsMax = AttemptsMax { failed: ATTEMPTS_MAX, lost: ATTEMPTS_MAX };

/// Location of a test's library, which no other test uses.
pub(crate) struct Home {
    pub(crate) url: String,
    /// Folder of a `SQLite` library.
    pub(crate) folder: Option<TempDir>,
}

impl Home {
    pub(crate) fn sqlite() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
        Self { url, folder: Some(folder) }
    }

    /// A file in memory, if the system supports it; for tests that are not about the disk.
    pub(crate) fn sqlite_in_memory() -> Self {
        let memory = std::path::Path::new("/dev/shm");
        if !memory.is_dir() {
            return Self::sqlite();
        }
        let folder = TempDir::new_in(memory).unwrap();
        let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
        Self { url, folder: Some(folder) }
    }

    /// A database on the test server; `None` without a server.
    pub(crate) fn postgres() -> Option<Self> {
        Server::shared().map(|server| Self { url: server.database(), folder: None })
    }

    /// Another database of the same kind.
    pub(crate) fn another(&self) -> Self {
        match self.folder {
            Some(_) => Self::sqlite(),
            None => Self::postgres().unwrap(),
        }
    }

    /// A library with this number of cases.
    pub(crate) async fn library(&self, count: u32) -> Library {
        let library = Library::open_or_create(&self.url).await.unwrap();
        fill(&library, CAMPAIGN, count).await;
        library
    }

    pub(crate) async fn open(&self) -> Library {
        Library::open(&self.url).await.unwrap()
    }
}

/// Defines the same test for both databases, as `NAME::sqlite` and `NAME::postgres`.
macro_rules! on_both_databases {
    ($(async fn $name:ident($home:ident: &Home) $body:block)*) => {$(
        mod $name {
            use super::*;

            async fn body($home: &Home) $body

            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn sqlite() {
                body(&Home::sqlite()).await;
            }

            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn postgres() {
                if let Some(home) = Home::postgres() {
                    body(&home).await;
                }
            }
        }
    )*};
}
pub(crate) use on_both_databases;

/// Stores a campaign with this number of cases.
pub(crate) async fn fill(library: &Library, campaign: &str, count: u32) {
    let record = CampaignRecord { id: campaign.to_owned(), ..record() };
    library.insert_campaign(&record).await.unwrap();
    let cases: Vec<_> = (0..count).map(case).collect();
    library.insert_cases(campaign, &cases, |_| None).await.unwrap();
}

pub(crate) fn record() -> CampaignRecord {
    CampaignRecord {
        id: CAMPAIGN.to_owned(),
        name: "test".to_owned(),
        definition_json: "{}".to_owned(),
        definition_hash: "d".to_owned(),
        experiment_json: "{}".to_owned(),
        experiment_hash: "e".to_owned(),
        speeds_km_h: vec![7.0, 13.0],
        seed: 1,
    }
}

pub(crate) fn case(index: u32) -> Case {
    let stiffness = 1e7 * (1.0 + f64::from(index) / 7.0);
    let parameters = ParameterSet::nominal().with(Parameter::BallastStiffness, stiffness);
    Case { index, parameters, surface_seed: u64::MAX / 2 - u64::from(index) }
}

/// Features of a case: a function of its index.
pub(crate) fn features(index: u32) -> Vec<Features> {
    let pass = |speed: f64| Features {
        log_power: (0..5)
            .map(|bin| (f64::from(index) + speed).sin() / f64::from(bin + 1))
            .collect(),
        band_levels_db: (0..ThirdOctave::COUNT)
            .map(|band| f64::from(index) / 3.0 - speed + band as f64 / 7.0)
            .collect(),
    };
    record().speeds_km_h.into_iter().map(pass).collect()
}

/// Request for up to `max` cases of any campaign.
pub(crate) fn request(worker: &str, max: u32, now: i64) -> LeaseRequest {
    LeaseRequest {
        campaign: None,
        indices_below: u32::MAX,
        worker: worker.to_owned(),
        cases_max: max,
        cases_max_of: HashMap::new(),
        held: Vec::new(),
        now_unix_ms: now,
        lease_ms: 1000,
        attempts_max: GIVE_UP,
        alone_after: u32::MAX,
    }
}

pub(crate) async fn lease(library: &Library, worker: &str, max: u32, now: i64) -> Vec<Leased> {
    let request = LeaseRequest { campaign: Some(CAMPAIGN.to_owned()), ..request(worker, max, now) };
    library.lease(request).await.unwrap().map(|lease| lease.cases).unwrap_or_default()
}

pub(crate) fn held(leased: &Leased) -> Held {
    Held { index: leased.case.index, epoch: leased.epoch }
}

/// Features as passes in a worker's report.
pub(crate) fn passes(features: Vec<Features>) -> Vec<PassFeatures> {
    let pass = |(speed_km_h, features)| PassFeatures {
        speed_km_h,
        features,
        contact_loss_share: Some(0.0),
    };
    record().speeds_km_h.into_iter().zip(features).map(pass).collect()
}

/// A case report with the checksum that its worker computes.
pub(crate) fn reported(leased: &Leased, outcome: Outcome) -> CaseReport {
    let parameter_hash = leased.case.parameter_hash();
    CaseReport {
        index: leased.case.index,
        epoch: leased.epoch,
        duration_s: 0.25,
        checksum: checksum(leased.case.index, &parameter_hash, &outcome),
        parameter_hash,
        outcome,
    }
}

pub(crate) fn finished(leased: &Leased) -> CaseReport {
    reported(leased, Outcome::Finished(passes(features(leased.case.index))))
}

pub(crate) fn failed(leased: &Leased) -> CaseReport {
    reported(leased, Outcome::Failed { reason: "it does not stand".to_owned() })
}

pub(crate) async fn report(
    library: &Library,
    worker: &str,
    cases: Vec<CaseReport>,
) -> Vec<ReportVerdict> {
    library.report(message(worker, cases)).await.unwrap()
}

/// Report of a worker.
pub(crate) fn message(worker: &str, cases: Vec<CaseReport>) -> Report {
    Report {
        campaign: CAMPAIGN.to_owned(),
        worker: worker.to_owned(),
        code_version: "0.1.0".to_owned(),
        model_hash: "m".to_owned(),
        experiment_hash: "e".to_owned(),
        speeds_km_h: record().speeds_km_h,
        cases,
        now_unix_ms: 1_700_000_000_000,
        attempts_max: GIVE_UP,
        audit_share: 0.0,
    }
}
