//! A library in a temporary folder, and a campaign to put into it.

use tempfile::TempDir;
use tracktwin_library::{
    CampaignRecord, CaseReport, Ending, Held, LeaseRequest, Leased, Library, Report, State, Verdict,
};
use tracktwin_parameters::{Case, Parameter, ParameterSet};
use tracktwin_signal::{Features, ThirdOctave};

pub(crate) const CAMPAIGN: &str = "test-000000000000";

/// Attempts before a case is given up, in these tests.
pub(crate) const ATTEMPTS_MAX: u32 = 3;

pub(crate) fn policy(_: Ending, attempts: u32) -> State {
    if attempts < ATTEMPTS_MAX { State::Waiting } else { State::Failed }
}

pub(crate) fn url(folder: &TempDir) -> String {
    format!("sqlite:{}", folder.path().join("library.sqlite").display())
}

/// A library of so many cases.
pub(crate) async fn library(folder: &TempDir, count: u32) -> Library {
    let library = Library::open_or_create(&url(folder)).await.unwrap();
    library.insert_campaign(&record()).await.unwrap();
    let cases: Vec<_> = (0..count).map(case).collect();
    library.insert_cases(CAMPAIGN, &cases).await.unwrap();
    library
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

/// What the case's simulation would find: a function of the case alone.
pub(crate) fn features(index: u32) -> Vec<Features> {
    let pass = |speed: f64| Features {
        log_power: (0..5)
            .map(|bin| (f64::from(index) + speed).sin() / f64::from(bin + 1))
            .collect(),
        band_levels_db: vec![f64::from(index) / 3.0 - speed; ThirdOctave::COUNT],
    };
    record().speeds_km_h.into_iter().map(pass).collect()
}

pub(crate) async fn lease(library: &Library, worker: &str, max: u32, now: i64) -> Vec<Leased> {
    let request = LeaseRequest {
        campaign: CAMPAIGN.to_owned(),
        indices_below: u32::MAX,
        worker: worker.to_owned(),
        cases_max: max,
        now_unix_ms: now,
        lease_ms: 1000,
        after_loss: policy,
    };
    library.lease(request).await.unwrap()
}

pub(crate) fn held(leased: &Leased) -> Held {
    Held { index: leased.case.index, epoch: leased.epoch }
}

pub(crate) fn finished(leased: &Leased) -> CaseReport {
    CaseReport {
        index: leased.case.index,
        epoch: leased.epoch,
        parameter_hash: leased.case.parameter_hash(),
        duration_s: 0.25,
        outcome: Ok(features(leased.case.index)),
    }
}

pub(crate) fn failed(leased: &Leased) -> CaseReport {
    CaseReport { outcome: Err("it does not stand".to_owned()), ..finished(leased) }
}

pub(crate) async fn report(
    library: &Library,
    worker: &str,
    cases: Vec<CaseReport>,
) -> Vec<Verdict> {
    let report = Report {
        campaign: CAMPAIGN.to_owned(),
        worker: worker.to_owned(),
        code_version: "0.1.0".to_owned(),
        model_hash: "m".to_owned(),
        experiment_hash: "e".to_owned(),
        speeds_km_h: record().speeds_km_h,
        cases,
        now_unix_ms: 1_700_000_000_000,
        after_failure: policy,
    };
    library.report(report).await.unwrap()
}
