//! What the queue costs: durable leases with 12 kB results, and what stays flat as a campaign grows.
//!
//! ```sh
//! cargo run --release -p tracktwin-library --example queue_speed -- sqlite:PATH 1000000 20000 50
//! ```
//! fills the library with a campaign of 1,000,000 cases (if it isn't there), lets eight workers
//! lease and report 20,000 of them, 50 at a time, and says what that took, and what opening and
//! asking for the status take. With a `postgres://...` URL the same on a server.

use std::error::Error;
use std::time::Instant;
use tokio::task::JoinSet;
use tracktwin_library::{
    CampaignRecord, CaseReport, LeaseRequest, Leased, Library, Report, State, Verdict,
};
use tracktwin_parameters::{Case, Parameter, ParameterSet};
use tracktwin_signal::{Features, ThirdOctave};

type Failure = Box<dyn Error + Send + Sync>;

/// Workers that ask at the same time.
const WORKERS: u32 = 8;

/// Three passes of 500 bins: 12 kB a case.
const SPEEDS_KM_H: [f64; 3] = [7.0, 10.0, 13.0];
const BINS: usize = 500;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [url, cases, done, batch] = &arguments[..] else {
        return Err("give URL CASES TO_DO BATCH".into());
    };
    let (cases, done, batch): (u32, u32, u32) = (cases.parse()?, done.parse()?, batch.parse()?);
    let library = Library::open_or_create(url).await?;
    let campaign = format!("speed-{cases}");
    fill(&library, &campaign, cases).await?;
    library.close().await;

    let begin = Instant::now();
    let library = Library::open(url).await?;
    println!("open: {:.1} ms", 1e3 * begin.elapsed().as_secs_f64());
    let begin = Instant::now();
    library.overview().await?;
    println!("status: {:.1} ms", 1e3 * begin.elapsed().as_secs_f64());

    let begin = Instant::now();
    let mut workers = JoinSet::new();
    for worker in 0..WORKERS {
        let (library, campaign) = (library.clone(), campaign.clone());
        workers.spawn(async move {
            work(&library, &campaign, &format!("w{worker}"), done / WORKERS, batch).await
        });
    }
    while let Some(worked) = workers.join_next().await {
        worked??;
    }
    let seconds = begin.elapsed().as_secs_f64();
    let rate = f64::from(done) / seconds;
    println!("{done} of {cases} cases, {batch} at a time: {rate:.0} cases/s durable");

    let begin = Instant::now();
    let leases = 200;
    for _ in 0..leases {
        lease(&library, &campaign, "leases", 1).await?;
    }
    let each = begin.elapsed().as_secs_f64() / f64::from(leases);
    println!("one lease of one case after another: {:.2} ms each", 1e3 * each);
    let begin = Instant::now();
    let overview = library.overview().await?;
    println!("status: {:.1} ms", 1e3 * begin.elapsed().as_secs_f64());
    for campaign in overview {
        println!("{}: {:?}", campaign.id, campaign.status);
    }
    library.close().await;
    Ok(())
}

async fn fill(library: &Library, campaign: &str, cases: u32) -> Result<(), Failure> {
    let record = CampaignRecord {
        id: campaign.to_owned(),
        name: "speed".to_owned(),
        definition_json: "{}".to_owned(),
        definition_hash: campaign.to_owned(),
        experiment_json: "{}".to_owned(),
        experiment_hash: "experiment".to_owned(),
        speeds_km_h: SPEEDS_KM_H.to_vec(),
        seed: 1,
    };
    library.insert_campaign(&record).await?;
    let begin = Instant::now();
    let first = library.status(campaign).await?.total();
    for start in (first..cases).step_by(4096) {
        let chunk: Vec<Case> = (start..cases.min(start + 4096)).map(case).collect();
        library.insert_cases(campaign, &chunk).await?;
    }
    println!("{} cases stored in {:.1} s", cases - first, begin.elapsed().as_secs_f64());
    Ok(())
}

fn case(index: u32) -> Case {
    let stiffness = 1e7 * (1.0 + f64::from(index) / 1e6);
    let parameters = ParameterSet::nominal().with(Parameter::BallastStiffness, stiffness);
    Case { index, parameters, surface_seed: index.into() }
}

async fn work(
    library: &Library,
    campaign: &str,
    worker: &str,
    cases: u32,
    batch: u32,
) -> Result<(), Failure> {
    let mut left = cases;
    while left > 0 {
        let leased = lease(library, campaign, worker, batch.min(left)).await?;
        if leased.is_empty() {
            return Err("no cases left: give a campaign of more".into());
        }
        left -= u32::try_from(leased.len())?;
        let report = Report {
            campaign: campaign.to_owned(),
            worker: worker.to_owned(),
            code_version: "0.1.0".to_owned(),
            model_hash: "model".to_owned(),
            experiment_hash: "experiment".to_owned(),
            speeds_km_h: SPEEDS_KM_H.to_vec(),
            cases: leased.iter().map(finished).collect(),
            now_unix_ms: library.now_unix_ms(),
            after_failure: |_, _| State::Waiting,
            audit_share: 0.0,
        };
        let verdicts = library.report(report).await?;
        assert!(verdicts.iter().all(|verdict| *verdict == Verdict::Stored));
    }
    Ok(())
}

async fn lease(
    library: &Library,
    campaign: &str,
    worker: &str,
    cases_max: u32,
) -> Result<Vec<Leased>, Failure> {
    let request = LeaseRequest {
        campaign: Some(campaign.to_owned()),
        indices_below: u32::MAX,
        worker: worker.to_owned(),
        cases_max,
        now_unix_ms: library.now_unix_ms(),
        lease_ms: 3_600_000,
        after_loss: |_, _| State::Waiting,
        alone_after: u32::MAX,
    };
    Ok(library.lease(request).await?.map(|lease| lease.cases).unwrap_or_default())
}

fn finished(leased: &Leased) -> CaseReport {
    let phase = f64::from(leased.case.index);
    let features = |speed: f64| Features {
        log_power: (0..BINS).map(|bin| (phase + speed * bin as f64).sin()).collect(),
        band_levels_db: vec![phase.cos(); ThirdOctave::COUNT],
    };
    CaseReport {
        index: leased.case.index,
        epoch: leased.epoch,
        parameter_hash: leased.case.parameter_hash(),
        duration_s: 0.02,
        outcome: Ok(SPEEDS_KM_H.map(features).to_vec()),
    }
}
