//! A library that is opened for reading is not written to.

use crate::data::{ask, sql};
use crate::support::{CAMPAIGN, Home, finished, lease, on_both_databases, record, report};
use crate::upgrade::released;
use sqlx::{Connection, PgConnection};
use std::fs;
use tracktwin_library::{Library, LibraryError};

async fn refusal(home: &Home) -> String {
    let error = Library::open_to_read(&home.url).await.err().expect("it should be refused");
    assert!(matches!(error, LibraryError::OlderSchema { .. }) && error.is_wrong_input());
    error.to_string()
}

on_both_databases! {
    async fn what_is_opened_for_reading_is_read_and_not_written(home: &Home) {
        let library = home.library(3).await;
        let leased = lease(&library, "w", 2, 0).await;
        let reader = Library::open_to_read(&home.url).await.unwrap();
        report(&library, "w", leased.iter().map(finished).collect()).await;
        // What others write meanwhile is seen.
        assert_eq!(reader.status(CAMPAIGN).await.unwrap().finished, 2);
        assert_eq!(ask(&reader, "select * from campaign_status").await.rows.len(), 1);
        let verified = library.verify(|| ()).await.unwrap();
        assert_eq!(reader.verify(|| ()).await.unwrap(), verified);
        let error = reader.insert_campaign(&record()).await.unwrap_err();
        assert!(matches!(error, LibraryError::NotWritable { .. }), "{error:?}");
        reader.close().await;
        library.check_writable().await.unwrap();
    }

    async fn views_of_an_earlier_program_are_left_alone_by_who_reads(home: &Home) {
        home.library(1).await.close().await;
        sql(home, match home.folder {
            Some(_) => "pragma user_version = 0",
            None => "comment on view campaign_status is 'views of version 0'",
        }).await;
        sql(home, "drop view failed_case").await;
        let reader = Library::open_to_read(&home.url).await.unwrap();
        assert_eq!(reader.status(CAMPAIGN).await.unwrap().total(), 1);
        let findings = reader.verify(|| ()).await.unwrap().findings;
        assert!(findings.iter().any(|it| it.what.contains("failed_case")), "{findings:?}");
    }
}

#[tokio::test]
async fn a_file_of_an_earlier_schema_is_not_updated_by_reading_it() {
    let home = Home::sqlite();
    released(&home).await;
    let file = home.folder.as_ref().unwrap().path().join("library.sqlite");
    let before = fs::read(&file).unwrap();
    let told = refusal(&home).await;
    assert!(told.contains("schema 1 ") && told.contains("library upgrade"), "{told}");
    assert_eq!(fs::read(&file).unwrap(), before);
    home.open().await.close().await;
    Library::open_to_read(&home.url).await.unwrap();
}

#[tokio::test]
async fn a_server_s_library_of_an_earlier_schema_is_not_updated_by_reading_it() {
    let Some(home) = Home::postgres() else { return };
    let mut connection = PgConnection::connect(&home.url).await.unwrap();
    sqlx::migrate!("../../migrations/postgres").run_to(8, &mut connection).await.unwrap();
    assert!(refusal(&home).await.contains("schema 8 "));
    let version: i64 = sqlx::query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(&mut connection)
        .await
        .unwrap();
    assert_eq!(version, 8);
    connection.close().await.unwrap();
}

#[tokio::test]
async fn a_file_whose_writer_was_killed_is_read_with_what_its_log_holds() {
    let home = Home::sqlite();
    let library = home.library(1).await;
    let leased = lease(&library, "w", 1, 0).await;
    report(&library, "w", leased.iter().map(finished).collect()).await;
    // What a kill leaves: the file and its log, without the index of the log.
    let killed = Home::sqlite();
    let folder = |of: &Home| of.folder.as_ref().unwrap().path().to_owned();
    for name in ["library.sqlite", "library.sqlite-wal"] {
        fs::copy(folder(&home).join(name), folder(&killed).join(name)).unwrap();
    }
    let files = ["library.sqlite", "library.sqlite-wal"];
    let content = || files.map(|name| fs::read(folder(&killed).join(name)).unwrap());
    let before = content();
    let reader = Library::open_to_read(&killed.url).await.unwrap();
    assert_eq!(reader.status(CAMPAIGN).await.unwrap().finished, 1);
    reader.close().await;
    assert!(content() == before, "reading has written to the file or to its log");
    assert_eq!(killed.open().await.status(CAMPAIGN).await.unwrap().finished, 1);
}
