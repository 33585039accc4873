//! Libraries of earlier program versions are updated and keep their content.

use crate::support::{GIVE_UP, Home};
use sqlx::{AssertSqlSafe, Connection, PgConnection, SqliteConnection};
use std::collections::HashMap;
use tracktwin_library::{LeaseRequest, Library, State, Status};

pub(crate) const CAMPAIGN: &str = "released-13c0db7b51c4";

/// Creates a library with the first released schema.
pub(crate) async fn released(home: &Home) {
    let url = format!("{}?mode=rwc", home.url);
    let mut connection = SqliteConnection::connect(&url).await.unwrap();
    sqlx::raw_sql(include_str!("schemas/0001.sql")).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

#[tokio::test]
async fn a_library_of_the_first_schema_keeps_all_it_holds() {
    let home = Home::sqlite();
    released(&home).await;
    let library = Library::open(&home.url).await.unwrap();
    // As a program in another language works it out from the file before.
    assert_eq!(
        library.digest(CAMPAIGN).await.unwrap(),
        "c24f8103cab5b073b4e54c6fed3983706acdd0dc7b0906fcab182fbccdc17274"
    );
    let status = library.status(CAMPAIGN).await.unwrap();
    assert_eq!(status, Status { leased: 1, finished: 1, failed: 1, waiting: 0 });
    let given_up = library.case(CAMPAIGN, 1).await.unwrap().unwrap();
    assert_eq!((given_up.state, given_up.attempts), (State::Failed, 3));
    assert_eq!(given_up.error.as_deref(), Some("it does not stand"));
}

#[tokio::test]
async fn a_library_of_the_first_schema_is_gone_on_with() {
    let home = Home::sqlite();
    released(&home).await;
    let library = Library::open(&home.url).await.unwrap();
    let request = LeaseRequest {
        campaign: None,
        indices_below: u32::MAX,
        worker: "w".to_owned(),
        cases_max: 9,
        cases_max_of: HashMap::new(),
        held: Vec::new(),
        // Its lease has expired long ago.
        now_unix_ms: library.now_unix_ms(),
        lease_ms: 1000,
        attempts_max: GIVE_UP,
        alone_after: u32::MAX,
    };
    let lease = library.lease(request).await.unwrap().unwrap();
    assert_eq!((lease.campaign.as_str(), lease.cases.len()), (CAMPAIGN, 1));
    assert_eq!((lease.cases[0].case.index, lease.cases[0].epoch), (2, 2));
}

#[tokio::test]
async fn the_bins_of_an_old_campaign_are_known_after_opening_it() {
    let home = Home::sqlite();
    released(&home).await;
    Library::open(&home.url).await.unwrap().close().await;
    let mut connection = SqliteConnection::connect(&home.url).await.unwrap();
    let [bins, values]: [i64; 2] = sqlx::query_as::<_, (i64, i64)>(
        "select (select count(*) from frequency_bin),
            (select sum(length(log_power)) / 16 from result)",
    )
    .fetch_one(&mut connection)
    .await
    .map(Into::into)
    .unwrap();
    assert_eq!(bins, values);
    connection.close().await.unwrap();
}

#[tokio::test]
async fn arrays_of_a_server_s_library_of_the_fourth_schema_become_series_of_the_same_numbers() {
    let Some(home) = Home::postgres() else { return };
    let mut connection = PgConnection::connect(&home.url).await.unwrap();
    sqlx::migrate!("../../migrations/postgres").run_to(4, &mut connection).await.unwrap();
    let store = "insert into stored_array (key, kind, meta, numbers, created_at)
        values ('key', 'kind', '{}', array[-1.5, 0, 1e-300], '2026-11-01T00:00:00Z')";
    sqlx::query(store).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    let library = Library::open(&home.url).await.unwrap();
    let stored = library.array("key").await.unwrap().unwrap();
    assert_eq!(stored.numbers, [-1.5, 0.0, 1e-300]);
}

#[tokio::test]
async fn results_of_a_server_s_library_of_the_fifth_schema_stay_as_they_were() {
    let Some(home) = Home::postgres() else { return };
    let mut connection = PgConnection::connect(&home.url).await.unwrap();
    let migrations = sqlx::migrate!("../../migrations/postgres");
    migrations.run_to(5, &mut connection).await.unwrap();
    let case = "insert into campaign (id, name, definition, definition_hash, experiment,
            experiment_hash, speeds_km_h, seed, created_at)
        values ('c', 'c', '{}', 'd', '{}', 'e', '[7, 10, 13]', 1, '2026-11-01T00:00:00Z');
        insert into campaign_case (campaign_id, sobol_index, railpad_stiffness_N_m,
            railpad_damping_N_s_m, ballast_stiffness_N_m, ballast_damping_N_s_m, sleeper_EI_N_m2,
            irregularity_level, surface_seed, parameter_hash)
        select 'c', index, 1, 1, 1, 1, 1, 1, 1, 'p' || index from generate_series(3, 4) as index";
    sqlx::raw_sql(case).execute(&mut connection).await.unwrap();
    // The faster pass first; no two numbers alike.
    let numbers: Vec<_> = (1..=20).map(|place| format!("speed / {place} - index")).collect();
    let results = format!(
        "insert into result
        select 'c', index, speed, float8send(speed / 3) || float8send(index / speed), {},
            0.25, 'w' || index, 'v', 'm', 'e', 'p' || index, '2026-11-01T00:00:00Z', null
        from unnest(array[13, 7, 10]::double precision[]) as speed, generate_series(3, 4) as index",
        numbers.join(", ")
    );
    sqlx::raw_sql(AssertSqlSafe(results)).execute(&mut connection).await.unwrap();
    let all = "select array_agg(cast(result as text) order by sobol_index, speed_km_h),
            count(*) from result";
    let before: (Vec<String>, i64) = sqlx::query_as(all).fetch_one(&mut connection).await.unwrap();
    assert_eq!(before.1, 6);
    for version in migrations.iter().map(|it| it.version).filter(|version| *version > 5) {
        migrations.run_to(version, &mut connection).await.unwrap();
        let mut after: (Vec<String>, i64) =
            sqlx::query_as(all).fetch_one(&mut connection).await.unwrap();
        if version > 7 {
            // Two columns more, in which nothing stands.
            for row in &mut after.0 {
                let shorter = row.strip_suffix(",,)").map(|row| format!("{row})"));
                *row = shorter.expect("nobody made up what was not known");
            }
        }
        assert_eq!(after, before, "{version}");
    }
    connection.close().await.unwrap();
    let library = Library::open(&home.url).await.unwrap();
    assert_eq!(library.verify(|| ()).await.unwrap().unattested, 2);
    library.close().await;
}

#[tokio::test]
async fn results_of_the_first_schema_have_no_checksum_and_pass() {
    let home = Home::sqlite();
    released(&home).await;
    let library = Library::open(&home.url).await.unwrap();
    let verified = library.verify(|| ()).await.unwrap();
    assert_eq!((verified.attested, verified.unattested), (0, 1));
    assert_eq!(verified.findings, []);
    let mut entries = 0;
    library.training_set(CAMPAIGN, |_| entries += 1).await.unwrap();
    assert_eq!(entries, 1);
}
