//! Workers that compute nothing. They lease from a library, and report features of 12 kB per case.

use std::collections::HashMap;
use tempfile::TempDir;
use tokio::task::JoinSet;
use tracktwin_experiment::{Outcome, PassFeatures};
use tracktwin_library::{
    AttemptsMax, CampaignRecord, LeaseRequest, Leased, Library, Report, ReportVerdict,
};
use tracktwin_parameters::{Case, Parameter, ParameterSet};
use tracktwin_protocol::{CaseReport, checksum};
use tracktwin_signal::{Features, ThirdOctave};

/// Error that ends a measurement.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Id of the campaign of these workers.
pub const CAMPAIGN: &str = "queue";

/// Number of workers that send requests at the same time.
const WORKERS: u32 = 8;

/// Speeds in km/h: three passes of 500 bins, 12 kB per case.
const SPEEDS_KM_H: [f64; 3] = [7.0, 10.0, 13.0];
const BINS: usize = 500;

/// Limits of attempts that are never reached, because no case fails.
const NEVER_GIVEN_UP: AttemptsMax = AttemptsMax { failed: u32::MAX, lost: u32::MAX };

/// A new folder in `$TRACKTWIN_BENCH_DIR`, or in the current folder, and the URL of a `SQLite` library in
/// it.
///
/// # Errors
/// Returns an error if the folder cannot be created.
pub fn sqlite_library() -> Result<(TempDir, String), Failure> {
    let home = std::env::var("TRACKTWIN_BENCH_DIR").unwrap_or_else(|_| ".".into());
    let folder = tempfile::tempdir_in(home)?;
    let url = format!("sqlite:{}", folder.path().join("l.sqlite").display());
    Ok((folder, url))
}

/// Stores a campaign with this number of cases.
///
/// # Errors
/// Returns an error if the library cannot be written.
pub async fn fill(library: &Library, cases: u32) -> Result<(), Failure> {
    let record = CampaignRecord {
        id: CAMPAIGN.to_owned(),
        name: CAMPAIGN.to_owned(),
        definition_json: "{}".to_owned(),
        definition_hash: "definition".to_owned(),
        experiment_json: "{}".to_owned(),
        experiment_hash: "experiment".to_owned(),
        speeds_km_h: SPEEDS_KM_H.to_vec(),
        seed: 1,
    };
    library.insert_campaign(&record).await?;
    for start in (0..cases).step_by(4096) {
        let chunk: Vec<Case> = (start..cases.min(start + 4096)).map(case).collect();
        library.insert_cases(CAMPAIGN, &chunk, |_| None).await?;
    }
    Ok(())
}

fn case(index: u32) -> Case {
    let stiffness = 1e7 * (1.0 + f64::from(index) / 1e6);
    let parameters = ParameterSet::nominal().with(Parameter::BallastStiffness, stiffness);
    Case { index, parameters, surface_seed: index.into() }
}

/// Finishes `cases` cases with all workers together; each worker leases `batch` cases at a time.
///
/// # Errors
/// Returns an error if the library cannot be written or has no more cases.
///
/// # Panics
/// Panics if a result is not stored.
pub async fn finish(library: &Library, cases: u32, batch: u32) -> Result<(), Failure> {
    let mut workers = JoinSet::new();
    for worker in 0..WORKERS {
        let share = cases / WORKERS + u32::from(worker < cases % WORKERS);
        let library = library.clone();
        workers.spawn(async move { work(&library, &format!("w{worker}"), share, batch).await });
    }
    while let Some(worked) = workers.join_next().await {
        worked??;
    }
    Ok(())
}

async fn work(library: &Library, worker: &str, cases: u32, batch: u32) -> Result<(), Failure> {
    let mut left = cases;
    while left > 0 {
        let leased = lease(library, worker, batch.min(left)).await?;
        left -= u32::try_from(leased.len())?;
        let report = Report {
            campaign: CAMPAIGN.to_owned(),
            worker: worker.to_owned(),
            code_version: "0.1.0".to_owned(),
            model_hash: "model".to_owned(),
            experiment_hash: "experiment".to_owned(),
            speeds_km_h: SPEEDS_KM_H.to_vec(),
            cases: leased.iter().map(finished).collect(),
            now_unix_ms: library.now_unix_ms(),
            attempts_max: NEVER_GIVEN_UP,
            audit_share: 0.0,
        };
        let verdicts = library.report(report).await?;
        assert!(verdicts.iter().all(|verdict| *verdict == ReportVerdict::Stored));
    }
    Ok(())
}

/// Leases up to this number of cases to one worker.
///
/// # Errors
/// Returns an error if the library cannot be written or has no more cases.
pub async fn lease(
    library: &Library,
    worker: &str,
    cases_max: u32,
) -> Result<Vec<Leased>, Failure> {
    let request = LeaseRequest {
        campaign: Some(CAMPAIGN.to_owned()),
        indices_below: u32::MAX,
        worker: worker.to_owned(),
        cases_max,
        cases_max_of: HashMap::new(),
        held: Vec::new(),
        now_unix_ms: library.now_unix_ms(),
        lease_ms: 12_000,
        attempts_max: NEVER_GIVEN_UP,
        alone_after: u32::MAX,
    };
    let lease = library.lease(request).await?;
    Ok(lease.ok_or("nothing waits: give more cases")?.cases)
}

fn finished(leased: &Leased) -> CaseReport {
    let phase = f64::from(leased.case.index);
    let pass = |speed_km_h: f64| PassFeatures {
        speed_km_h,
        features: Features {
            log_power: (0..BINS).map(|bin| (phase + speed_km_h * bin as f64).sin()).collect(),
            band_levels_db: vec![phase.cos(); ThirdOctave::COUNT],
        },
        contact_loss_share: Some(0.0),
    };
    let outcome = Outcome::Finished(SPEEDS_KM_H.map(pass).to_vec());
    let parameter_hash = leased.case.parameter_hash();
    CaseReport {
        index: leased.case.index,
        epoch: leased.epoch,
        duration_s: 0.02,
        checksum: checksum(leased.case.index, &parameter_hash, &outcome),
        parameter_hash,
        outcome,
    }
}
