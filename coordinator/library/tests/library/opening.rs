//! What is a library, and what is not.

use crate::support::{CAMPAIGN, case, library, record, url};
use sqlx::{Connection, SqliteConnection};
use tracktwin_library::{CampaignRecord, Library, LibraryError};

async fn sql(folder: &tempfile::TempDir, statement: &'static str) {
    let path = format!("{}?mode=rwc", url(folder));
    let mut connection = SqliteConnection::connect(&path).await.unwrap();
    sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

async fn refusal(url: &str) -> LibraryError {
    let error = Library::open(url).await.err().expect("it should be refused");
    assert!(error.is_wrong_input(), "{error:?}");
    assert!(!error.to_string().contains('\n'), "{error}");
    error
}

#[tokio::test]
async fn what_is_stored_is_there_after_reopening() {
    let folder = tempfile::tempdir().unwrap();
    library(&folder, 3).await.close().await;
    let library = Library::open(&url(&folder)).await.unwrap();
    assert_eq!(library.campaigns().await.unwrap(), [record()]);
    assert_eq!(library.case(CAMPAIGN, 2).await.unwrap().unwrap().case, case(2));
    assert_eq!(library.case(CAMPAIGN, 3).await.unwrap(), None);
}

#[tokio::test]
async fn a_missing_library_is_not_made_by_asking_it() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(refusal(&url(&folder)).await, LibraryError::Missing { .. }));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
    let deeper = format!("sqlite:{}/no/library.sqlite", folder.path().display());
    let error = Library::open_or_create(&deeper).await.err().unwrap();
    assert!(matches!(error, LibraryError::NoFolder { .. }), "{error}");
}

#[tokio::test]
async fn a_file_that_is_no_library_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("library.sqlite");
    std::fs::write(&path, "railpad,ballast\n1,2\n".repeat(100)).unwrap();
    let before = std::fs::read(&path).unwrap();
    assert!(matches!(refusal(&url(&folder)).await, LibraryError::NotALibrary { .. }));
    assert_eq!(std::fs::read(&path).unwrap(), before);

    std::fs::remove_file(&path).unwrap();
    sql(&folder, "create table diary (entry text)").await;
    let before = std::fs::read(&path).unwrap();
    assert!(matches!(refusal(&url(&folder)).await, LibraryError::NotALibrary { .. }));
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[tokio::test]
async fn a_library_of_a_later_schema_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    library(&folder, 1).await.close().await;
    sql(
        &folder,
        "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
        values (99, 'later', true, x'00', 0)",
    )
    .await;
    let error = refusal(&url(&folder)).await;
    assert!(matches!(error, LibraryError::NewerSchema { found: 99, known: 1, .. }), "{error}");
}

#[tokio::test]
async fn one_process_at_a_time_hands_out_cases() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, 1).await;
    let claim = library.claim().unwrap();
    let other = Library::open(&url(&folder)).await.unwrap();
    assert!(matches!(other.claim(), Err(LibraryError::InUse { .. })));
    drop(claim);
    other.claim().unwrap();
}

#[tokio::test]
async fn a_campaign_may_grow_but_not_become_another() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, 2).await;
    let cases: Vec<_> = (0..5).map(case).collect();
    library.insert_campaign(&record()).await.unwrap();
    library.insert_cases(CAMPAIGN, &cases).await.unwrap();
    assert_eq!(library.status(CAMPAIGN).await.unwrap().total(), 5);
    let other = CampaignRecord { definition_hash: "other".to_owned(), ..record() };
    let error = library.insert_campaign(&other).await.unwrap_err();
    assert!(matches!(error, LibraryError::OtherDefinition { .. }), "{error}");
}

#[tokio::test]
async fn a_closed_library_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, 1).await;
    library.clone().close().await;
    let error = library.insert_campaign(&record()).await.unwrap_err();
    assert!(matches!(error, LibraryError::Closed), "{error}");
}
