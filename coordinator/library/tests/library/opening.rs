//! Opening: which files and databases are accepted as a library, and which are refused.

use crate::support::{CAMPAIGN, Home, case, on_both_databases, record};
use sqlx::{Connection, PgConnection, SqliteConnection};
use tracktwin_library::{CampaignRecord, Library, LibraryError};

/// Changes the database directly, without the library.
async fn sql(home: &Home, statement: &'static str) {
    if home.folder.is_some() {
        let mut connection =
            SqliteConnection::connect(&format!("{}?mode=rwc", home.url)).await.unwrap();
        sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
        connection.close().await.unwrap();
    } else {
        let mut connection = PgConnection::connect(&home.url).await.unwrap();
        sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
        connection.close().await.unwrap();
    }
}

async fn refusal(url: &str) -> LibraryError {
    let error = Library::open(url).await.err().expect("it should be refused");
    assert!(error.is_wrong_input(), "{error:?}");
    assert!(!error.to_string().contains('\n'), "{error}");
    error
}

on_both_databases! {
    async fn what_is_stored_is_there_after_reopening(home: &Home) {
        home.library(3).await.close().await;
        let library = home.open().await;
        assert_eq!(library.campaigns().await.unwrap(), [record()]);
        assert_eq!(library.case(CAMPAIGN, 2).await.unwrap().unwrap().case, case(2));
        assert_eq!(library.case(CAMPAIGN, 3).await.unwrap(), None);
    }

    async fn a_database_of_somebody_else_is_refused_and_left_alone(home: &Home) {
        sql(home, "create table diary (entry text)").await;
        assert!(matches!(refusal(&home.url).await, LibraryError::NotALibrary { .. }));
        let error = Library::open_or_create(&home.url).await.err().unwrap();
        assert!(matches!(error, LibraryError::NotALibrary { .. }), "{error}");
        // As it was: a table of the same name as ours can still be made.
        sql(home, "create table campaign (diary text); create table _sqlx_migrations (diary text)")
            .await;
    }

    async fn a_library_of_a_later_schema_is_refused(home: &Home) {
        home.library(1).await.close().await;
        sql(
            home,
            "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
            values (99, 'later', true, '', 0)",
        )
        .await;
        let error = refusal(&home.url).await;
        assert!(matches!(error, LibraryError::NewerSchema { found: 99, .. }), "{error}");
    }

    async fn a_campaign_may_grow_but_not_become_another(home: &Home) {
        let library = home.library(2).await;
        let cases: Vec<_> = (0..5).map(case).collect();
        library.insert_campaign(&record()).await.unwrap();
        library.insert_cases(CAMPAIGN, &cases, |_| None).await.unwrap();
        assert_eq!(library.status(CAMPAIGN).await.unwrap().total(), 5);
        let other = CampaignRecord { definition_hash: "other".to_owned(), ..record() };
        let error = library.insert_campaign(&other).await.unwrap_err();
        assert!(matches!(error, LibraryError::OtherDefinition { .. }), "{error}");
    }

    async fn a_closed_library_says_so(home: &Home) {
        let library = home.library(1).await;
        library.clone().close().await;
        let error = library.insert_campaign(&record()).await.unwrap_err();
        assert!(matches!(error, LibraryError::Closed), "{error}");
        let error = library.campaigns().await.unwrap_err();
        assert!(matches!(error, LibraryError::Closed), "{error}");
    }
}

#[tokio::test]
async fn a_missing_file_is_not_made_by_asking_it() {
    let home = Home::sqlite();
    assert!(matches!(refusal(&home.url).await, LibraryError::Missing { .. }));
    let folder = home.folder.as_ref().unwrap().path();
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 0);
    let deeper = format!("sqlite:{}/no/library.sqlite", folder.display());
    let error = Library::open_or_create(&deeper).await.err().unwrap();
    assert!(matches!(error, LibraryError::NoFolder { .. }), "{error}");
}

#[tokio::test]
async fn an_empty_database_is_not_filled_by_asking_it() {
    let Some(home) = Home::postgres() else { return };
    assert!(matches!(refusal(&home.url).await, LibraryError::Empty { .. }));
    assert!(matches!(refusal(&home.url).await, LibraryError::Empty { .. }));
}

#[tokio::test]
async fn a_server_that_is_not_there_or_lets_nobody_in_is_told_apart() {
    let error = Library::open("postgres://me:secret@127.0.0.1:1/tracks").await.err().unwrap();
    assert!(matches!(error, LibraryError::Unreachable { .. }), "{error:?}");
    assert_eq!(
        error.to_string(),
        "library postgres://me@127.0.0.1:1/tracks: the server cannot be reached; check host and \
         port, and that the server runs"
    );
    let Some(home) = Home::postgres() else { return };
    let elsewhere = format!("{}_that_is_not_there", home.url);
    let error = refusal(&elsewhere).await;
    assert!(error.to_string().contains("does not exist; correct the user"), "{error}");
}

#[tokio::test]
async fn a_file_that_is_no_database_is_refused_and_left_alone() {
    let home = Home::sqlite();
    let path = home.folder.as_ref().unwrap().path().join("library.sqlite");
    std::fs::write(&path, "railpad,ballast\n1,2\n".repeat(100)).unwrap();
    let before = std::fs::read(&path).unwrap();
    assert!(matches!(refusal(&home.url).await, LibraryError::NotALibrary { .. }));
    assert_eq!(std::fs::read(&path).unwrap(), before);

    std::fs::remove_file(&path).unwrap();
    sql(&home, "create table diary (entry text)").await;
    let before = std::fs::read(&path).unwrap();
    assert!(matches!(refusal(&home.url).await, LibraryError::NotALibrary { .. }));
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[tokio::test]
async fn with_a_file_one_process_at_a_time_hands_out_cases() {
    let home = Home::sqlite();
    let library = home.library(1).await;
    let claim = library.claim().unwrap();
    assert!(claim.is_exclusive());
    let other = home.open().await;
    assert!(matches!(other.claim(), Err(LibraryError::InUse { .. })));
    drop(claim);
    other.claim().unwrap();
}

/// A second name of a library's file.
struct SecondName {
    path: std::path::PathBuf,
    /// Mount point that must be unmounted.
    mounted: Option<std::path::PathBuf>,
}

impl Drop for SecondName {
    fn drop(&mut self) {
        if let Some(folder) = &self.mounted {
            let _ = std::process::Command::new("umount").arg("-l").arg(folder).status();
        }
    }
}

/// Names of several kinds for one file; a mounted one only if mounting is allowed.
fn second_names(file: &std::path::Path, elsewhere: &std::path::Path) -> Vec<SecondName> {
    let name = |name: &str| elsewhere.join(name);
    std::fs::hard_link(file, name("hard.sqlite")).unwrap();
    std::os::unix::fs::symlink(file, name("soft.sqlite")).unwrap();
    let folder = file.parent().unwrap();
    let round_about = elsewhere.join("..").join(folder.file_name().unwrap()).join("library.sqlite");
    let paths = [name("hard.sqlite"), name("soft.sqlite"), round_about];
    let mut names: Vec<_> =
        paths.map(|path| SecondName { path, mounted: None }).into_iter().collect();
    let mount = name("mounted");
    std::fs::create_dir(&mount).unwrap();
    let mut bind = std::process::Command::new("mount");
    bind.arg("--bind").args([folder, &mount]).stderr(std::process::Stdio::null());
    if bind.status().is_ok_and(|status| status.success()) {
        names.push(SecondName { path: mount.join("library.sqlite"), mounted: Some(mount) });
    } else {
        test_needs::skipped("a file by a second mount; nothing may be mounted here");
    }
    names
}

#[tokio::test]
async fn whatever_name_a_file_has_one_process_at_a_time_hands_out_its_cases() {
    let home = Home::sqlite();
    home.library(1).await.close().await;
    let file = home.folder.as_ref().unwrap().path().join("library.sqlite");
    let elsewhere = tempfile::tempdir().unwrap();
    for second in second_names(&file, elsewhere.path()) {
        let library = home.open().await;
        let claim = library.claim().unwrap();
        let other = Library::open(&format!("sqlite:{}", second.path.display())).await.unwrap();
        let refused = other.claim().unwrap_err();
        assert!(
            matches!(refused, LibraryError::InUse { .. }),
            "{}: {refused}",
            second.path.display()
        );
        drop(claim);
        let claim = other.claim().unwrap();
        assert!(matches!(library.claim(), Err(LibraryError::InUse { .. })));
        drop(claim);
        other.close().await;
        library.close().await;
    }
}

#[tokio::test]
async fn closing_a_library_that_was_only_read_waits_for_nobody_who_writes() {
    let home = Home::sqlite();
    home.library(1).await.close().await;
    let library = home.open().await;
    assert_eq!(library.status(CAMPAIGN).await.unwrap().total(), 1);
    let mut writer = SqliteConnection::connect(&home.url).await.unwrap();
    sqlx::raw_sql("begin immediate").execute(&mut writer).await.unwrap();
    // A transaction would wait for half a minute for the one that is open, and end with an error.
    let closing = tokio::time::timeout(std::time::Duration::from_secs(20), library.close());
    closing.await.expect("closing waits for a lock that it does not need");
    sqlx::raw_sql("rollback").execute(&mut writer).await.unwrap();
}

#[tokio::test]
async fn a_server_that_takes_connections_and_never_answers_is_given_up_within_a_bound() {
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("postgres://me@{}/tracks", silent.local_addr().unwrap());
    let opening = tokio::time::timeout(std::time::Duration::from_mins(1), Library::open(&url));
    let error = opening.await.expect("opening waits for ever").err().unwrap();
    let LibraryError::Unreachable { source, .. } = &error else { panic!("{error:?}") };
    assert!(source.to_string().contains("no response within"), "{source}");
}

on_both_databases! {
    async fn states_that_nobody_knows_are_told_and_not_taken_for_others(home: &Home) {
        let library = home.library(2).await;
        library.register_worker(crate::workers::registration("w", 0)).await.unwrap();
        sql(home, match home.folder {
            Some(_) => "pragma ignore_check_constraints = on;
                update campaign_case set state = 'parked' where sobol_index = 1;
                update worker set state = 'asleep', reason = '?';
                insert into audit (campaign_id, sobol_index, worker, state)
                    select campaign_id, 0, 'w', 'lost' from campaign_case where sobol_index = 0;
                update campaign set state = 'stopped'",
            None => "alter table campaign_case drop constraint state_is_known;
                alter table campaign_case disable trigger user;
                update campaign_case set state = 'parked' where sobol_index = 1;
                alter table worker drop constraint worker_state_is_known;
                update worker set state = 'asleep', reason = '?';
                alter table audit drop constraint audit_state_is_known;
                insert into audit (campaign_id, sobol_index, worker, state)
                    select campaign_id, 0, 'w', 'lost' from campaign_case where sobol_index = 0;
                alter table campaign drop constraint campaign_state_is_known;
                update campaign set state = 'stopped'",
        })
        .await;
        let told = [
            library.case(CAMPAIGN, 1).await.map(drop),
            library.worker("w").await.map(drop),
            library.heartbeat("w", 0).await.map(drop),
            library.audits(CAMPAIGN).await.map(drop),
            library.overview().await.map(drop),
        ];
        for (told, state) in told.into_iter().zip(["parked", "asleep", "asleep", "lost", "stopped"]) {
            let error = told.unwrap_err();
            assert!(matches!(error, LibraryError::Damaged { .. }), "{error:?}");
            assert!(error.to_string().contains(state), "{error}");
        }
        assert!(library.case(CAMPAIGN, 0).await.unwrap().is_some(), "what is known is read");
    }
}

#[tokio::test]
async fn with_a_server_any_number_of_processes_hands_out_cases() {
    let Some(home) = Home::postgres() else { return };
    let (one, other) = (home.library(1).await, home.open().await);
    let claims = [one.claim().unwrap(), other.claim().unwrap()];
    assert!(claims.iter().all(|claim| !claim.is_exclusive()));
}

#[test]
fn of_many_that_open_a_new_library_at_once_one_makes_it_and_none_fails() {
    let folder = tempfile::tempdir().unwrap();
    for round in 0..10 {
        let url = format!("sqlite:{}", folder.path().join(format!("{round}.sqlite")).display());
        let opening = (0..8).map(|_| {
            let url = url.clone();
            std::thread::spawn(move || {
                let runtime = tokio::runtime::Runtime::new().unwrap();
                runtime.block_on(async { Library::open_or_create(&url).await.map(drop) })
            })
        });
        for opened in opening.collect::<Vec<_>>() {
            opened.join().unwrap().unwrap();
        }
    }
}
