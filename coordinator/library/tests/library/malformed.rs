//! Damaged files are detected and not written to, and their intact rows are copied.

use crate::checksums::salvage;
use crate::support::{CAMPAIGN, Home, features, finished, lease, report};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use test_postgres::{Server, Settings};
use tracktwin_library::{Library, LibraryError};

const CASES: u32 = 300;

/// Size of a page of a new library, in bytes.
const PAGE: usize = 16_384;

/// The file of a library with finished cases, and its digest.
struct Sound {
    home: Home,
    bytes: Vec<u8>,
    digest: String,
}

impl Sound {
    async fn new(cases: u32) -> Self {
        let home = Home::sqlite_in_memory();
        let library = home.library(cases).await;
        let leased = lease(&library, "w", cases, 0).await;
        report(&library, "w", leased.iter().map(finished).collect()).await;
        let digest = library.digest(CAMPAIGN).await.unwrap();
        library.close().await;
        let bytes = fs::read(path(&home)).unwrap();
        assert_eq!(bytes.len() % PAGE, 0);
        Self { home, bytes, digest }
    }

    fn pages(&self) -> usize {
        self.bytes.len() / PAGE
    }

    /// Writes a second file with changed bytes.
    fn with(&self, change: impl FnOnce(&mut Vec<u8>)) -> (PathBuf, String) {
        let file = path(&self.home).with_file_name("damaged.sqlite");
        let mut bytes = self.bytes.clone();
        change(&mut bytes);
        for end in ["", "-wal", "-shm"] {
            let mut name = file.as_os_str().to_owned();
            name.push(end);
            let _ = fs::remove_file(name);
        }
        fs::write(&file, bytes).unwrap();
        let url = format!("sqlite:{}", file.display());
        (file, url)
    }
}

fn path(home: &Home) -> PathBuf {
    home.folder.as_ref().unwrap().path().join("library.sqlite")
}

/// Whether the damage of a library is detected, when it is opened or verified.
async fn is_found(url: &str) -> bool {
    match Library::open(url).await {
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "{error}");
            true
        }
        Ok(library) => {
            let findings = library.verify(|| ()).await.unwrap().findings;
            library.close().await;
            assert!(findings.iter().all(|it| !it.what.contains('\n')), "{findings:?}");
            // The campaign's own hashes are single letters.
            findings.iter().any(|it| !it.what.ends_with("does not match its hash"))
        }
    }
}

/// Whether adding to a library is refused.
async fn is_refused(url: &str) -> bool {
    let Ok(library) = Library::open_or_create(url).await else { return true };
    let whole = library.check_whole().await;
    library.close().await;
    if let Err(error) = &whole {
        assert!(matches!(error, LibraryError::Malformed { .. }), "{error:?}");
        assert!(error.to_string().contains("tracktwin library copy"), "{error}");
    }
    whole.is_err()
}

/// Number of finished cases in a copy of the intact rows. Each of them equals its report.
async fn saved(url: &str) -> Option<u32> {
    let from = Library::open(url).await.ok()?;
    let home = Home::sqlite_in_memory();
    let to = Library::open_or_create(&home.url).await.unwrap();
    salvage(&from, &to).await;
    let mut count = 0;
    if to.campaign(CAMPAIGN).await.is_ok() {
        let compare = |entry: tracktwin_library::LibraryEntry| {
            assert_eq!(entry.features, features(entry.case.index));
            count += 1;
        };
        to.training_set(CAMPAIGN, compare).await.unwrap();
        assert_eq!(to.status(CAMPAIGN).await.unwrap().finished, count);
    }
    to.close().await;
    from.close().await;
    Some(count)
}

#[tokio::test]
async fn a_page_that_is_lost_anywhere_is_found_and_added_to_by_nobody() {
    let sound = Sound::new(CASES).await;
    assert!(sound.pages() > 20, "{} pages", sound.pages());
    for filling in [0, 0xff, 0x5a] {
        for page in 0..sound.pages() {
            let (_, url) = sound.with(|bytes| bytes[page * PAGE..][..PAGE].fill(filling));
            assert!(is_found(&url).await, "page {page} of {filling:x}");
            assert!(is_refused(&url).await, "page {page} of {filling:x}");
        }
    }
}

#[tokio::test]
async fn what_a_lost_page_does_not_hold_is_saved() {
    let sound = Sound::new(CASES).await;
    let mut all = Vec::new();
    for page in 1..sound.pages() {
        let (_, url) = sound.with(|bytes| bytes[page * PAGE..][..PAGE].fill(0));
        all.extend(saved(&url).await);
    }
    // Most pages hold results, some 20 cases each; few hold what all others hang from.
    let mostly = all.iter().filter(|saved| **saved >= CASES * 2 / 3).count();
    assert!(mostly * 10 >= sound.pages() * 7, "{mostly} of {} pages: {all:?}", sound.pages());
}

#[tokio::test]
async fn a_row_with_a_huge_number_makes_no_rescue_endless() {
    let sound = Sound::new(CASES).await;
    let (file, _) = sound.with(|_| ());
    let last =
        "update result set rowid = 2400000000000 where rowid = (select max(rowid) from result)";
    alter(&file, last).await;
    let root = root_of_results(&file).await;
    let bytes = fs::read(&file).unwrap();
    let rescue = async |page: usize| {
        let mut damaged = bytes.clone();
        damaged[page * PAGE..][..PAGE].fill(0);
        let (_, url) = sound.with(|bytes| *bytes = damaged);
        let saved = tokio::time::timeout(Duration::from_mins(1), saved(&url)).await;
        saved.expect("it ends")
    };
    // The page from which all results are found.
    assert_eq!(rescue(root).await, Some(0));
    // The results were written last. Their leaves begin with this byte and have many cells.
    let leaves = (1..bytes.len() / PAGE).filter(|page| {
        let head = &bytes[page * PAGE..];
        head[0] == 0x0d && u16::from_be_bytes([head[3], head[4]]) > 10
    });
    for page in leaves.rev().take(2) {
        let saved = rescue(page).await.unwrap();
        assert!((CASES * 2 / 3..CASES).contains(&saved), "page {page}: {saved}");
    }
}

/// Number of the page, from 0, at which the table of results begins.
async fn root_of_results(file: &Path) -> usize {
    use sqlx::Connection as _;
    let url = format!("sqlite:{}", file.display());
    let mut connection = sqlx::SqliteConnection::connect(&url).await.unwrap();
    let ask = "select rootpage from sqlite_schema where name = 'result'";
    let root: i64 = sqlx::query_scalar(ask).fetch_one(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    usize::try_from(root).unwrap() - 1
}

#[tokio::test]
async fn a_file_that_is_cut_off_is_found_and_added_to_by_nobody() {
    let sound = Sound::new(CASES).await;
    let length = sound.bytes.len();
    for kept in [1, 99, 100, 512, PAGE, PAGE + 1, length / 3, length / 2 / PAGE * PAGE] {
        let (_, url) = sound.with(|bytes| bytes.truncate(kept));
        assert!(is_found(&url).await, "{kept} bytes");
        assert!(is_refused(&url).await, "{kept} bytes");
    }
    // A byte that is missing reads as zero: the pages fit together, a number is another.
    let (_, url) = sound.with(|bytes| bytes.truncate(length - 1));
    assert!(is_found(&url).await);
    // Whatever can be read of half a file, nothing in it is wrong.
    let (_, url) = sound.with(|bytes| bytes.truncate(length / 2 / PAGE * PAGE));
    let _ = saved(&url).await;
}

#[tokio::test]
async fn an_empty_file_is_no_library_and_stays_as_it_is() {
    let sound = Sound::new(1).await;
    let (file, url) = sound.with(Vec::clear);
    let error = Library::open(&url).await.err().unwrap();
    assert!(matches!(error, LibraryError::Empty { .. }), "{error:?}");
    assert_eq!(fs::metadata(&file).unwrap().len(), 0);
    // A run may fill it, unless its log says that there was more.
    let log = file.with_file_name("damaged.sqlite-wal");
    fs::write(&log, "what was written").unwrap();
    for opened in [Library::open(&url).await, Library::open_or_create(&url).await] {
        let error = opened.err().unwrap();
        assert!(matches!(error, LibraryError::Malformed { .. }), "{error:?}");
    }
    assert!(log.is_file());
    fs::remove_file(&log).unwrap();
    Library::open_or_create(&url).await.unwrap().close().await;
}

#[tokio::test]
async fn what_is_no_database_is_found() {
    let sound = Sound::new(1).await;
    for text in [
        "not a database at all, but long enough to be read as the head of one ".repeat(9),
        "x".to_owned(),
    ] {
        let (file, url) = sound.with(|bytes| *bytes = text.clone().into_bytes());
        assert!(is_found(&url).await && is_refused(&url).await);
        assert_eq!(fs::read(&file).unwrap(), text.as_bytes());
    }
    let (_, url) = sound.with(|bytes| bytes[..100].fill(0));
    assert!(is_found(&url).await && is_refused(&url).await);
}

#[tokio::test]
async fn no_flipped_bit_of_a_result_goes_unnoticed() {
    let sound = Sound::new(40).await;
    let bits = 8 * sound.bytes.len();
    let (mut found, mut harmless) = (0, 0);
    for turn in 0..250 {
        // Spread over the file by the golden ratio.
        let bit = (f64::from(turn) * 0.618_033_988_75).fract() * bits as f64;
        let bit = bit as usize;
        let (_, url) = sound.with(|bytes| bytes[bit / 8] ^= 1 << (bit % 8));
        if is_found(&url).await {
            found += 1;
            continue;
        }
        // Free space, or what no checksum is made of.
        harmless += 1;
        let library = Library::open(&url).await.unwrap();
        assert_eq!(library.digest(CAMPAIGN).await.unwrap(), sound.digest, "bit {bit}");
        library.close().await;
    }
    assert!(found > 20, "{found} found, {harmless} harmless");
}

#[tokio::test]
async fn what_the_schema_lacks_is_found() {
    let sound = Sound::new(2).await;
    for (damage, what) in [
        ("drop view failed_case", "the view failed_case is missing"),
        ("drop view spectrum", "the view spectrum is missing"),
        ("drop table progress", "the table progress is missing"),
        ("drop index campaign_case_by_state", "the index campaign_case_by_state is missing"),
        ("drop trigger count_updated_case", "the trigger count_updated_case is missing"),
        (
            "drop view failed_case; create view failed_case as select * from campaign_case",
            "the view failed_case differs from this program's",
        ),
        ("pragma foreign_keys = off; drop table result", "the table result is missing"),
        ("pragma foreign_keys = off; drop table campaign", "the table campaign is missing"),
        (
            "pragma foreign_keys = off; update result set sobol_index = 9 where sobol_index = 1",
            "orphaned rows of result: their row of campaign_case is missing",
        ),
        (
            "pragma foreign_keys = off; update attempt set epoch = 7",
            "leases with an impossible epoch",
        ),
    ] {
        let (file, url) = sound.with(|_| ());
        attempt(&url).await;
        alter(&file, damage).await;
        let findings = match Library::open(&url).await {
            Ok(library) => library.verify(|| ()).await.unwrap().findings,
            Err(error) => panic!("{damage}: {error}"),
        };
        assert!(findings.iter().any(|it| it.what.contains(what)), "{damage}: {findings:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_server_loses_of_its_pages_is_found_and_the_rest_is_saved() {
    let Some(server) = Server::start(Settings::default()) else { return };
    for (table, filling, least) in [
        ("case_series", 0x5a, CASES / 2),
        ("case_series", 0, CASES / 2),
        ("case_result", 0x5a, CASES / 2),
        ("campaign_case", 0x5a, CASES / 4),
        ("frequency_bin", 0x5a, CASES),
    ] {
        let url = server.database();
        let library = Library::open_or_create(&url).await.unwrap();
        crate::support::fill(&library, CAMPAIGN, CASES).await;
        let leased = lease(&library, "w", CASES, 0).await;
        report(&library, "w", leased.iter().map(finished).collect()).await;
        library.close().await;
        let Some(file) = file_of(&url, table).await else { continue };
        server.stop();
        let mut bytes = fs::read(&file).unwrap();
        bytes[..8192].fill(filling);
        fs::write(&file, bytes).unwrap();
        server.start_again();
        assert!(is_found(&url).await, "{table} {filling:x}");
        let saved = saved(&url).await.unwrap();
        assert!((least..=CASES).contains(&saved), "{table} {filling:x}: {saved}");
        assert!(saved < CASES || table == "frequency_bin", "{table} {filling:x}: {saved}");
    }
}

/// File of a table on a server, after its data were written to the disk; `None` if the table has no page.
async fn file_of(url: &str, table: &str) -> Option<PathBuf> {
    use sqlx::Connection as _;
    let mut connection = sqlx::PgConnection::connect(url).await.unwrap();
    sqlx::raw_sql("checkpoint").execute(&mut connection).await.unwrap();
    let ask = "select current_setting('data_directory') || '/' || pg_relation_filepath($1)";
    let path: String =
        sqlx::query_scalar(ask).bind(table).fetch_one(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    let path = PathBuf::from(path);
    fs::metadata(&path).is_ok_and(|file| file.len() >= 8192).then_some(path)
}

/// Adds a case and an attempt of it to a library.
async fn attempt(url: &str) {
    let library = Library::open(url).await.unwrap();
    library.insert_cases(CAMPAIGN, &[crate::support::case(2)], |_| None).await.unwrap();
    let leased = lease(&library, "w", 1, 0).await;
    report(&library, "w", vec![crate::support::failed(&leased[0])]).await;
    library.close().await;
}

async fn alter(file: &Path, statement: &'static str) {
    use sqlx::Connection as _;
    let url = format!("sqlite:{}", file.display());
    let mut connection = sqlx::SqliteConnection::connect(&url).await.unwrap();
    sqlx::raw_sql(statement).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}
