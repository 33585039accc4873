//! The library as plain tables: queries, copies, verification.

use crate::support::{CAMPAIGN, Home, failed, fill, finished, lease, on_both_databases, report};
use sqlx::{AssertSqlSafe, Connection, PgConnection, SqliteConnection};
use tracktwin_library::{Answer, Cell, Library, LibraryError, ReportVerdict, Table};

/// The stored result of a query.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) columns: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Answer for Kept {
    type Error = LibraryError;

    fn columns(&mut self, names: &[String]) -> Result<(), LibraryError> {
        self.columns = names.to_vec();
        Ok(())
    }

    fn row(&mut self, cells: Vec<Cell>) -> Result<(), LibraryError> {
        self.rows.push(cells);
        Ok(())
    }
}

pub(crate) async fn ask(library: &Library, text: &str) -> Kept {
    let mut kept = Kept::default();
    library.query(text, &mut kept).await.unwrap();
    kept
}

async fn refusal(library: &Library, text: &str) -> LibraryError {
    library.query(text, &mut Kept::default()).await.expect_err(text)
}

/// A library with one finished, one given-up, one leased and one waiting case.
async fn some_of_all(home: &Home) -> Library {
    let library = home.library(4).await;
    let leased = lease(&library, "w", 2, 0).await;
    report(&library, "w", vec![finished(&leased[0]), failed(&leased[1])]).await;
    for later_ms in [100, 200] {
        let again = lease(&library, "w", 1, later_ms).await;
        report(&library, "w", vec![failed(&again[0])]).await;
    }
    lease(&library, "w", 1, i64::MAX / 2).await;
    library
}

pub(crate) async fn copy(from: &Library, to: &Library) -> u64 {
    let mut added = 0;
    for table in Table::ALL {
        let take = async |rows| {
            added += to.write_table(table, rows).await?;
            Ok::<(), LibraryError>(())
        };
        from.read_table(table, 3, take).await.unwrap();
    }
    to.finish_complete_cases().await.unwrap();
    added
}

/// Changes the database directly, without the library.
pub(crate) async fn sql(home: &Home, statement: impl Into<String>) {
    let statement = AssertSqlSafe(statement.into());
    if home.folder.is_some() {
        let mut connection = SqliteConnection::connect(&home.url).await.unwrap();
        sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
    } else {
        let mut connection = PgConnection::connect(&home.url).await.unwrap();
        sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
    }
}

/// Damages a library, and checks that the verification finds the damage.
async fn verify_finds(home: &Home, damage: &'static str, what: &str) {
    let library = some_of_all(home).await;
    sql(home, damage).await;
    let findings = library.verify(|| ()).await.unwrap().findings;
    assert!(findings.iter().any(|it| it.what.contains(what)), "{what}: {findings:?}");
}

on_both_databases! {
    async fn an_answer_has_the_schemas_names_and_the_values_as_they_were(home: &Home) {
        let library = some_of_all(home).await;
        let answer = ask(
            &library,
            "select sobol_index, ballast_stiffness_N_m, log_power, flagged, level_50_Hz_dB
            from result_with_parameters where speed_km_h = 7",
        )
        .await;
        let names =
            ["sobol_index", "ballast_stiffness_N_m", "log_power", "flagged", "level_50_Hz_dB"];
        assert_eq!(answer.columns, names);
        let features = &crate::support::features(0)[0];
        assert_eq!(
            answer.rows,
            [vec![
                Cell::Integer(0),
                Cell::Real(1e7),
                Cell::Doubles(features.log_power.clone()),
                Cell::Null,
                Cell::Real(features.band_levels_db[0]),
            ]]
        );
    }

    async fn sums_and_means_of_integers_are_numbers(home: &Home) {
        let library = some_of_all(home).await;
        let answer = ask(
            &library,
            "select sum(sobol_index) as s, sum(1000000 * sobol_index) as l, count(*) as n,
                sum(-sobol_index) as m, avg(sobol_index * 1.0) as a
            from campaign_case",
        )
        .await;
        let row = &answer.rows[0];
        assert_eq!(row[..4], [6, 6_000_000, 4, -6].map(Cell::Integer));
        assert_eq!(row[4], Cell::Real(1.5));
    }

    async fn an_answer_without_rows_has_columns(home: &Home) {
        let library = home.library(1).await;
        let answer = ask(&library, "select key, kind from stored_array").await;
        assert_eq!((answer.columns.len(), answer.rows.len()), (2, 0));
    }

    async fn nothing_is_written_by_asking(home: &Home) {
        let library = some_of_all(home).await;
        let digest = library.digest(CAMPAIGN).await.unwrap();
        for text in [
            "delete from result",
            "update campaign set name = 'x'",
            "create table diary (entry text)",
            "drop view failed_case",
            "with gone as (select 1) insert into worker select * from worker",
        ] {
            let error = refusal(&library, text).await;
            assert!(matches!(error, LibraryError::OnlyReads), "{text}: {error:?}");
            assert!(error.is_wrong_input());
        }
        assert_eq!(library.digest(CAMPAIGN).await.unwrap(), digest);
    }

    async fn no_statement_opens_the_door_for_another(home: &Home) {
        let library = some_of_all(home).await;
        for text in [
            "pragma query_only = off; delete from result",
            "commit; delete from result",
            "select 1; delete from result",
            "set transaction read write; delete from result",
        ] {
            // Whatever the database says, it does nothing.
            let _ = library.query(text, &mut Kept::default()).await;
        }
        let answer = ask(&library, "select count(*) as n from result").await;
        assert_eq!(answer.rows, [[Cell::Integer(2)]]);
    }

    async fn what_is_no_sql_is_refused_with_the_databases_words(home: &Home) {
        let library = home.library(1).await;
        for text in ["selekt 1", "select nothing from nowhere", ""] {
            let refused = library.query(text, &mut Kept::default()).await;
            // PostgreSQL answers to nothing with nothing.
            let Err(error) = refused else {
                assert_eq!(text, "");
                continue;
            };
            assert!(error.is_wrong_input(), "{text}: {error:?}");
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    async fn a_copy_has_the_same_digest_and_goes_on_where_it_was(home: &Home) {
        let library = some_of_all(home).await;
        for other in [Some(Home::sqlite()), Home::postgres()].into_iter().flatten() {
            let there = other.library(0).await;
            assert!(copy(&library, &there).await > 0);
            let digest = library.digest(CAMPAIGN).await.unwrap();
            assert_eq!(there.digest(CAMPAIGN).await.unwrap(), digest);
            // The lease stayed behind.
            let mut expected = library.status(CAMPAIGN).await.unwrap();
            expected.waiting += std::mem::take(&mut expected.leased);
            assert_eq!(there.status(CAMPAIGN).await.unwrap(), expected);
            assert_eq!(copy(&library, &there).await, 0);
            // What came since.
            let more = lease(&library, "v", 1, 0).await;
            if let Some(more) = more.first() {
                report(&library, "v", vec![finished(more)]).await;
            }
            copy(&library, &there).await;
            let digest = library.digest(CAMPAIGN).await.unwrap();
            assert_eq!(there.digest(CAMPAIGN).await.unwrap(), digest);
            let finished = library.status(CAMPAIGN).await.unwrap().finished;
            assert_eq!(there.status(CAMPAIGN).await.unwrap().finished, finished);
        }
    }

    async fn results_that_come_in_from_elsewhere_are_in_no_report_s_way(home: &Home) {
        let library = some_of_all(home).await;
        let other = home.another();
        let there = other.library(4).await;
        let leased = lease(&there, "v", 1, 0).await;
        let results = Table::named("result").unwrap();
        let take = async |rows| there.write_table(results, rows).await.map(drop);
        library.read_table(results, 9, take).await.unwrap();
        // The copy ended here.
        assert_eq!(report(&there, "v", vec![finished(&leased[0])]).await, [ReportVerdict::Duplicate]);
        assert_eq!(there.status(CAMPAIGN).await.unwrap().finished, 1);
        assert_eq!(there.digest(CAMPAIGN).await.unwrap(), library.digest(CAMPAIGN).await.unwrap());
    }

    async fn results_of_cases_that_are_not_there_are_refused(home: &Home) {
        let library = some_of_all(home).await;
        let other = home.another();
        // Its campaign has no cases.
        let there = other.library(0).await;
        let results = Table::named("result").unwrap();
        let mut refused = None;
        let take = async |rows| {
            refused = there.write_table(results, rows).await.err();
            Ok::<(), LibraryError>(())
        };
        library.read_table(results, 9, take).await.unwrap();
        assert!(refused.is_some());
        assert_eq!(there.count(results).await.unwrap(), 0);
    }

    async fn passes_of_a_case_may_come_one_by_one_and_in_any_order(home: &Home) {
        let library = some_of_all(home).await;
        let other = home.another();
        let there = other.library(4).await;
        let results = Table::named("result").unwrap();
        let mut passes = Vec::new();
        let keep = async |rows| {
            passes.extend(rows);
            Ok::<(), LibraryError>(())
        };
        library.read_table(results, 9, keep).await.unwrap();
        assert_eq!(passes.len(), 2);
        let before = there.digest(CAMPAIGN).await.unwrap();
        for pass in passes.iter().rev() {
            let twice = vec![pass.clone(); 2];
            assert_eq!(there.write_table(results, twice).await.unwrap(), 1);
        }
        assert_eq!(there.write_table(results, passes.clone()).await.unwrap(), 0);
        let mut found = Vec::new();
        let keep = async |rows| {
            found.extend(rows);
            Ok::<(), LibraryError>(())
        };
        there.read_table(results, 9, keep).await.unwrap();
        assert_eq!(found, passes);
        there.finish_complete_cases().await.unwrap();
        assert_eq!(there.status(CAMPAIGN).await.unwrap().finished, 1);
        assert_ne!(there.digest(CAMPAIGN).await.unwrap(), before);
    }

    async fn a_copy_never_mixes_two_definitions(home: &Home) {
        let library = home.library(1).await;
        let other = home.another();
        let there = other.library(1).await;
        sql(&other, "update campaign set definition_hash = 'other'").await;
        let mut error = None;
        let take = async |rows| {
            error = there.write_table(Table::ALL[0], rows).await.err();
            Ok::<(), LibraryError>(())
        };
        library.read_table(Table::ALL[0], 9, take).await.unwrap();
        assert!(matches!(error, Some(LibraryError::OtherDefinition { .. })), "{error:?}");
    }

    async fn looking_over_a_sound_library_finds_only_what_the_test_made_up(home: &Home) {
        let library = some_of_all(home).await;
        let findings = library.verify(|| ()).await.unwrap().findings;
        // Its campaign's hashes are single letters.
        assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")));
        assert_eq!(findings.len(), 2, "{findings:?}");
    }

    async fn every_damage_is_found(home: &Home) {
        // What SQLite has in a row a pass, PostgreSQL has in one a case.
        let (lost_pass, other_parameters, other_experiment, infinite) = if home.folder.is_some() {
            (
                "delete from result where speed_km_h = 7",
                "update result set parameter_hash = 'x'",
                "update result set experiment_hash = 'x'",
                "update result set level_50_Hz_dB = 1e999",
            )
        } else {
            (
                "update case_result set speeds_km_h = speeds_km_h[2:], levels_dB = levels_dB[21:],
                    contact_loss_shares = contact_loss_shares[2:]",
                "update case_result set parameter_hash = 'x'",
                "update case_result set experiment_hash = 'x'",
                "update case_result set levels_dB[1] = 'infinity'",
            )
        };
        for (damage, what) in [
            (lost_pass, "finished cases without a result"),
            ("update campaign_case set state = 'waiting' where state = 'finished'", "not finished"),
            (other_parameters, "with parameters that differ"),
            (other_experiment, "with an experiment that differs"),
            (
                "update campaign_case set irregularity_level = 1.5 where sobol_index = 3",
                "cases that do not match their hash",
            ),
            (infinite, "NaN or infinite"),
            ("update case_count set cases = cases + 1", "counts"),
            ("delete from campaign_case where sobol_index = 2", "gaps"),
            (
                "update campaign_case set parameter_hash = (select parameter_hash from campaign_case
                    where sobol_index = 2) where sobol_index = 3",
                "of an earlier case",
            ),
        ] {
            verify_finds(&home.another(), damage, what).await;
        }
    }

    async fn the_tables_are_those_of_the_schema(home: &Home) {
        let library = home.library(1).await;
        fill(&library, "other-000000000000", 1).await;
        for table in Table::ALL {
            let answer = ask(&library, &format!("select * from {}", table.name)).await;
            let mut found = answer.columns;
            let mut expected: Vec<_> =
                table.columns.iter().map(|column| column.name.to_owned()).collect();
            found.sort();
            expected.sort();
            assert_eq!(found, expected, "{}", table.name);
        }
        let answer = ask(&library, "select * from result_with_parameters").await;
        let expected: Vec<_> = Table::ENTRIES.columns.iter().map(|column| column.name).collect();
        assert_eq!(answer.columns, expected);
    }
}

#[tokio::test]
async fn what_no_foreign_key_keeps_together_on_a_server_is_looked_over() {
    let Some(home) = Home::postgres() else { return };
    for (damage, what) in [
        ("delete from case_series where speed_km_h = 7", "results without their series"),
        ("update case_result set sobol_index = 17", "orphaned results: their case is missing"),
        ("update case_result set campaign_id = 'x'", "orphaned results: their case is missing"),
        ("delete from case_result", "series without their results"),
    ] {
        verify_finds(&home.another(), damage, what).await;
    }
}

#[tokio::test]
async fn what_only_a_server_has_types_for_is_shown_as_it_writes_it() {
    let Some(home) = Home::postgres() else { return };
    let library = home.library(2).await;
    let answer = ask(
        &library,
        "select sobol_index as n, 7 as n, to_timestamp(0) at time zone 'utc' as began,
            date '2026-11-24' as day, interval '90 s' as lasted, array[1, 2] as \"both\",
            cast(null as date) as never
        from campaign_case order by sobol_index desc; ",
    )
    .await;
    assert_eq!(answer.columns, ["n", "n", "began", "day", "lasted", "both", "never"]);
    let row = |n| {
        let texts = ["1970-01-01 00:00:00", "2026-11-24", "00:01:30", "{1,2}"];
        let mut row = vec![Cell::Integer(n), Cell::Integer(7)];
        row.extend(texts.map(|text| Cell::Text(text.to_owned())));
        row.push(Cell::Null);
        row
    };
    assert_eq!(answer.rows, [row(1), row(0)]);
}

#[tokio::test]
async fn no_statement_writes_another_file() {
    let home = Home::sqlite();
    let library = some_of_all(&home).await;
    let folder = home.folder.as_ref().unwrap().path();
    let other = folder.join("other.sqlite");
    for text in [
        format!("vacuum into '{}'", other.display()),
        format!("-- a remark\nvacuum into '{}'", other.display()),
        format!("select 1; vacuum into '{}'", other.display()),
        format!("attach '{}' as other", other.display()),
        format!("attach '{}' as other; create table other.t (x)", other.display()),
    ] {
        let _ = library.query(&text, &mut Kept::default()).await;
        assert!(!other.exists(), "{text}");
    }
}
