//! The statements of the page on queries are valid in both databases.

use crate::data::{Kept, copy};
use crate::provenance::{diagnosis, evaluation, training};
use crate::support::{Home, case, features, message, on_both_databases, passes, reported, request};
use crate::upgrade::{CAMPAIGN, released};
use sqlx::{Connection, PgConnection};
use tracktwin_experiment::Outcome;
use tracktwin_library::{
    CampaignRecord, Cell, DiagnosisRecord, EvaluationRecord, LeaseRequest, Leased, Library,
    LibraryError, Registration, Report, TrainingRecord,
};
use tracktwin_protocol::CaseReport;
use tracktwin_signal::Features;

const PAGE: &str = include_str!("../../../../docs/how-to/query-the-library.md");

/// The code blocks of the page in this language.
fn blocks(language: &str) -> Vec<&'static str> {
    let begin = format!("```{language}\n");
    PAGE.split(begin.as_str()).skip(1).filter_map(|block| block.split("```").next()).collect()
}

/// A library with rows in every table that the page queries.
async fn library(home: &Home) -> Library {
    let file = Home::sqlite();
    released(&file).await;
    let old = Library::open(&file.url).await.unwrap();
    let library = Library::open_or_create(&home.url).await.unwrap();
    copy(&old, &library).await;
    work(&library, CAMPAIGN).await;
    let campaign = || CAMPAIGN.to_owned();
    library.record_training(TrainingRecord { campaign: campaign(), ..training() }).await.unwrap();
    let evaluation = EvaluationRecord { campaign: campaign(), ..evaluation() };
    library.record_evaluation(evaluation).await.unwrap();
    let diagnosis = DiagnosisRecord { recording: "dev-01".to_owned(), ..diagnosis() };
    library.record_diagnosis(diagnosis).await.unwrap();
    library
}

/// The results of the page's queries.
async fn answers(library: &Library) -> Vec<Vec<Vec<Cell>>> {
    let mut answers = Vec::new();
    for query in blocks("sql") {
        let mut answer = Kept::default();
        let asked = library.query(query, &mut answer).await;
        asked.unwrap_or_else(|error| panic!("{query}: {error}"));
        answers.push(answer.rows);
    }
    answers
}

/// Adds a campaign like the first one, with results, models, and an evaluation of the same recording.
async fn another_campaign(library: &Library) {
    let campaign = || "another-000000000000".to_owned();
    let record = CampaignRecord { id: campaign(), ..library.campaign(CAMPAIGN).await.unwrap() };
    library.insert_campaign(&record).await.unwrap();
    library
        .insert_cases(&campaign(), &(0..4).map(case).collect::<Vec<_>>(), |_| None)
        .await
        .unwrap();
    work(library, &campaign()).await;
    let mut training = TrainingRecord { campaign: campaign(), ..training() };
    training.surrogates[0].mase_test = 0.01;
    library.record_training(training).await.unwrap();
    let evaluation = EvaluationRecord { campaign: campaign(), ..evaluation() };
    library.record_evaluation(evaluation).await.unwrap();
}

/// Finishes the waiting cases of a campaign.
async fn work(library: &Library, campaign: &str) {
    let now_unix_ms = library.now_unix_ms();
    let registration = Registration {
        worker: "w".to_owned(),
        code_version: "0.1.0".to_owned(),
        model_hash: "m".to_owned(),
        cores: 1,
        now_unix_ms,
    };
    library.register_worker(registration).await.unwrap();
    let request =
        LeaseRequest { campaign: Some(campaign.to_owned()), ..request("w", 9, now_unix_ms) };
    let lease = library.lease(request).await.unwrap().unwrap();
    let record = library.campaign(campaign).await.unwrap();
    // As many bins as the experiment has, no two alike.
    let bins = |first: f64| (0..303).map(|bin| first + f64::from(bin) / 303.0).collect();
    let pass = |pass: Features| Features { log_power: bins(pass.log_power[0]), ..pass };
    let done = |leased: &Leased| {
        let features = features(leased.case.index).into_iter().map(pass).collect();
        CaseReport { duration_s: 0.02, ..reported(leased, Outcome::Finished(passes(features))) }
    };
    let report = Report {
        campaign: campaign.to_owned(),
        experiment_hash: record.experiment_hash,
        speeds_km_h: record.speeds_km_h,
        now_unix_ms,
        audit_share: 1.0,
        ..message("w", lease.cases.iter().map(done).collect())
    };
    library.report(report).await.unwrap();
}

on_both_databases! {
    async fn every_query_of_the_page_has_an_answer(home: &Home) {
        let library = library(home).await;
        let alone = answers(&library).await;
        assert_eq!(alone.len(), 12);
        another_campaign(&library).await;
        for (query, (before, after)) in blocks("sql").iter().zip(alone.iter().zip(answers(&library).await)) {
            assert!(!before.is_empty(), "{query}");
            // What it says of one campaign does not change with the other.
            assert!(before.iter().all(|row| after.contains(row)), "{query}: {before:?} {after:?}");
        }
    }

    async fn a_spectrum_in_plain_sql_is_the_stored_one_to_the_bit(home: &Home) {
        let library = library(home).await;
        let mut answer = Kept::default();
        let ask = "select log_power from spectrum
            where sobol_index = 0 and speed_km_h = 13 order by frequency_Hz";
        library.query(ask, &mut answer).await.unwrap();
        let entry = library.entry(CAMPAIGN, 0).await.unwrap().unwrap();
        let stored = entry.features[1].log_power.iter().map(|&value| vec![value.into()]);
        assert_eq!(answer.rows, stored.collect::<Vec<_>>());
    }
}

#[tokio::test]
async fn postgres_reads_every_double_of_a_series() {
    let Some(home) = Home::postgres() else { return };
    home.library(1).await.close().await;
    let mut connection = PgConnection::connect(&home.url).await.unwrap();
    let numbers =
        [0.0, -0.0, 1.0, -13.4, 5e-324, 1e-310, f64::MIN_POSITIVE, f64::MAX, f64::NEG_INFINITY];
    let bytes: Vec<u8> = numbers.iter().flat_map(|number: &f64| number.to_be_bytes()).collect();
    let (read, before, beyond): (Vec<f64>, Option<f64>, Option<f64>) =
        sqlx::query_as("select doubles($1), double_at($1, 0), double_at($1, 10)")
            .bind(bytes)
            .fetch_one(&mut connection)
            .await
            .unwrap();
    // Zeros with their signs.
    assert_eq!(read.iter().map(|it| it.to_bits()).collect::<Vec<_>>(), numbers.map(f64::to_bits));
    assert_eq!((before, beyond), (None, None));
}

#[tokio::test]
async fn the_pages_role_for_analysts_reads_and_does_not_write() {
    let Some(home) = Home::postgres() else { return };
    let library = library(&home).await;
    let mut owner = PgConnection::connect(&home.url).await.unwrap();
    let [role] = blocks("postgresql")[..] else { panic!("one block makes the role") };
    sqlx::raw_sql(role).execute(&mut owner).await.unwrap();
    let url = home.url.replace("postgres@", "analyst:choose%20one@");
    let analyst = Library::open(&url).await.unwrap();
    let digest = library.digest(CAMPAIGN).await.unwrap();
    assert_eq!(analyst.digest(CAMPAIGN).await.unwrap(), digest);
    for query in blocks("sql") {
        analyst.query(query, &mut Kept::default()).await.unwrap();
    }
    for refused in [analyst.pause(CAMPAIGN).await, analyst.check_writable().await] {
        let error = refused.unwrap_err();
        assert!(matches!(error, LibraryError::NotWritable { .. }), "{error:?}");
    }
    let mut connection = PgConnection::connect(&url).await.unwrap();
    for attempt in [
        "delete from case_result",
        "set default_transaction_read_only = off; update campaign set name = 'mine'",
        "begin read write; insert into worker select * from worker; commit",
        "create table mine (x text)",
    ] {
        let refused = sqlx::raw_sql(attempt).execute(&mut connection).await;
        assert!(refused.is_err(), "{attempt}");
        let _ = sqlx::raw_sql("rollback").execute(&mut connection).await;
    }
}
