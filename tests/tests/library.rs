//! The `library` commands: queries, export, import, copy, verification.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use system_tests::{Answer, run};
use tempfile::TempDir;
use test_postgres::Server;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Campaign with a coarse, short model, because only the library is tested.
const CAMPAIGN: &str = "name = \"asked\"\nseed = 5\nspeeds_km_h = [7, 13]\n\
    [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n";

const CASES: usize = 8;
const SPEEDS: usize = 2;

/// The library of a finished campaign, created once.
fn finished() -> &'static Path {
    static FINISHED: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, file) = FINISHED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let campaign = folder.path().join("campaign.toml");
        let file = folder.path().join("finished.sqlite");
        fs::write(&campaign, format!("cases = {CASES}\n{CAMPAIGN}")).unwrap();
        let campaign = campaign.display().to_string();
        let out = folder.path().join("out").display().to_string();
        let arguments = ["run", &campaign, "--no-train", "--out", &out, "--library", &url(&file)];
        assert_done(&run(PROGRAM, &arguments));
        (folder, file)
    });
    file
}

fn url(file: &Path) -> String {
    format!("sqlite:{}", file.display())
}

/// A folder with a copy of the finished library, and the URL of this copy.
fn home() -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("l.sqlite");
    fs::copy(finished(), &file).unwrap();
    let url = url(&file);
    (folder, url)
}

/// Runs `tracktwin library` with these arguments.
fn library(arguments: &[&str]) -> Answer {
    run(PROGRAM, &[&["library"], arguments].concat())
}

fn sql(statement: &str, library: &str, format: &str) -> Answer {
    self::library(&["sql", statement, "--library", library, "--format", format])
}

fn assert_done(answer: &Answer) {
    assert_eq!(answer.code, Some(0), "{}{}", answer.out, answer.err);
}

fn digest(library: &str) -> String {
    let answer = self::library(&["digest", "--library", library]);
    assert_done(&answer);
    answer.out
}

/// Overwrites the last occurrence of a text in a file with a text of equal length.
fn rot(file: &Path, text: &str, with: &str) {
    assert_eq!(text.len(), with.len(), "what lies behind must stay where it is");
    let mut bytes = fs::read(file).unwrap();
    let place = bytes.windows(text.len()).rposition(|it| it == text.as_bytes()).unwrap();
    bytes[place..place + text.len()].copy_from_slice(with.as_bytes());
    fs::write(file, bytes).unwrap();
}

#[test]
fn an_answer_comes_as_a_table_as_csv_and_as_json() {
    let (_folder, library) = home();
    let ask = "select sobol_index, speed_km_h from result where sobol_index = 3 order by 2";
    let csv = sql(ask, &library, "csv");
    assert_done(&csv);
    assert_eq!(csv.out, "sobol_index,speed_km_h\n3,7\n3,13\n");
    let json = sql(ask, &library, "json");
    assert_done(&json);
    let rows: serde_json::Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!(rows[1], serde_json::json!({ "sobol_index": 3, "speed_km_h": 13.0 }));
    assert!(json.out.contains(r#"{"sobol_index":3,"speed_km_h":7.0}"#), "in order: {}", json.out);
    let twice = sql("select 1 as a, 2 as a", &library, "json");
    assert_eq!(twice.code, Some(2), "{}", twice.out);
    assert!(twice.err.contains("two columns are named a"), "{}", twice.err);
    let table = sql(ask, &library, "table");
    assert_done(&table);
    assert!(table.out.starts_with("sobol_index"), "{}", table.out);
}

#[test]
fn a_statement_that_would_write_is_refused_in_one_line_and_changes_nothing() {
    let (_folder, library) = home();
    let before = digest(&library);
    for statement in ["delete from result", "update worker set reason = 'x'", "drop view spectrum"]
    {
        let answer = sql(statement, &library, "table");
        assert_eq!(answer.code, Some(2), "{statement}: {}", answer.err);
        assert_eq!(answer.err.trim_end().lines().count(), 1, "{}", answer.err);
        assert!(answer.err.contains("only reads"), "{}", answer.err);
        assert!(answer.out.is_empty(), "{}", answer.out);
    }
    assert_eq!(digest(&library), before);
}

#[test]
fn a_statement_that_nobody_understands_is_refused_with_what_the_database_says() {
    let (_folder, library) = home();
    let answer = sql("select colour from result", &library, "table");
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert!(answer.err.contains("colour"), "{}", answer.err);
}

#[test]
fn status_tells_how_many_cases_stand_where() {
    let (_folder, library) = home();
    let answer = self::library(&["status", "--json", "--library", &library]);
    assert_done(&answer);
    let status: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
    assert_eq!(status[0]["finished"], CASES);
    assert_eq!(status[0]["waiting"], 0);
}

#[test]
fn exported_tables_make_the_same_library_again() {
    let (folder, library) = home();
    let tables = folder.path().join("tables").display().to_string();
    assert_done(&self::library(&["export", "--out", &tables, "--library", &library]));
    let again = url(&folder.path().join("again.sqlite"));
    assert_done(&self::library(&["import", &tables, "--library", &again]));
    assert_eq!(digest(&again), digest(&library));
    assert_done(&self::library(&["verify", "--library", &again]));
    // A folder without all of it is refused before anything is written.
    let part = folder.path().join("part");
    fs::create_dir(&part).unwrap();
    for file in fs::read_dir(&tables).unwrap().map(Result::unwrap) {
        if file.file_name() != "result.parquet" {
            fs::copy(file.path(), part.join(file.file_name())).unwrap();
        }
    }
    let none = folder.path().join("none.sqlite");
    let answer = self::library(&["import", &part.display().to_string(), "--library", &url(&none)]);
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert!(answer.err.contains("result.parquet") && !none.exists(), "{}", answer.err);
    // What is there already stays as it is.
    let twice = self::library(&["import", &tables, "--library", &again]);
    assert_done(&twice);
    let results = format!("result: 0 of {} rows added", CASES * SPEEDS);
    assert!(twice.out.contains(&results), "{}", twice.out);
}

#[test]
fn what_is_exported_imported_and_copied_is_counted_in_json() {
    let (folder, library) = home();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let json = |arguments: &[&str]| -> serde_json::Value {
        let answer = self::library(&[arguments, &["--json"]].concat());
        assert_done(&answer);
        serde_json::from_str(&answer.out).unwrap()
    };
    let results = |tables: &serde_json::Value| {
        tables.as_array().unwrap().iter().find(|it| it["table"] == "result").unwrap().clone()
    };
    let (tables, training) = (path("tables"), path("training.csv"));
    let exported = json(&["export", "--out", &tables, "--library", &library]);
    assert_eq!(results(&exported)["rows"], CASES * SPEEDS);
    let exported = json(&["export", "--out", &training, "--library", &library]);
    assert_eq!(exported[0]["file"], *training);
    let [again, copy] = ["again.sqlite", "copy.sqlite"].map(|name| url(&folder.path().join(name)));
    for added in [CASES * SPEEDS, 0] {
        let imported = results(&json(&["import", &tables, "--library", &again]));
        assert_eq!(imported["rows"], CASES * SPEEDS);
        assert_eq!(imported["added"], added);
    }
    let copied = json(&["copy", "--from", &library, "--to", &copy]);
    assert_eq!(copied["added"], copied["rows"]);
    assert_eq!(copied["left_out"], serde_json::json!([]));
    assert_eq!(copied["campaigns"][0]["equal"], true);
}

#[test]
fn the_training_set_is_one_row_a_case_and_speed() {
    let (folder, library) = home();
    let file = folder.path().join("training.csv");
    let out = file.display().to_string();
    assert_done(&self::library(&["export", "--out", &out, "--library", &library]));
    let text = fs::read_to_string(file).unwrap();
    let head = text.lines().next().unwrap();
    for column in ["ballast_stiffness_N_m", "level_1000_Hz_dB", "log_power", "surface_seed"] {
        assert!(head.split(',').any(|it| it == column), "{column} is not in {head}");
    }
    assert_eq!(text.lines().count(), 1 + CASES * SPEEDS);
}

#[test]
fn a_copy_to_postgres_and_back_is_the_same_library() {
    let Some(server) = Server::shared() else { return };
    let (folder, library) = home();
    let there = server.database();
    let back = url(&folder.path().join("back.sqlite"));
    for (from, to) in [(&library, &there), (&there, &back)] {
        let copied = self::library(&["copy", "--from", from, "--to", to]);
        assert_done(&copied);
        assert!(copied.out.contains(": equal"), "{}", copied.out);
        assert_done(&self::library(&["verify", "--library", to]));
    }
    assert_eq!(digest(&back), digest(&library));
    // As a user of the server would: nothing is written through `sql` there either.
    assert_eq!(sql("delete from result", &there, "table").code, Some(2));
    assert_eq!(digest(&there), digest(&library));
}

#[test]
fn a_row_that_rots_on_the_disk_is_found() {
    let (folder, library) = home();
    let sound = self::library(&["verify", "--library", &library]);
    assert_done(&sound);
    assert!(sound.out.contains("no faults found"), "{}", sound.out);
    let ask = "select parameter_hash from result where sobol_index = 5 and speed_km_h = 13";
    let hash = sql(ask, &library, "csv").out.lines().nth(1).unwrap().to_owned();
    let rotten = format!("{}{}", &hash[..31], if hash.ends_with('0') { '1' } else { '0' });
    rot(&folder.path().join("l.sqlite"), &hash, &rotten);
    let answer = self::library(&["verify", "--library", &library]);
    assert_eq!(answer.code, Some(1), "{}{}", answer.out, answer.err);
    assert!(answer.out.contains("case 5"), "{}", answer.out);
}

/// Size of a page of a new library, in bytes.
const PAGE: usize = 16_384;

/// The campaign file of the finished library.
fn campaign(folder: &Path) -> String {
    let file = folder.join("campaign.toml");
    fs::write(&file, format!("cases = {CASES}\n{CAMPAIGN}")).unwrap();
    file.display().to_string()
}

fn assert_one_line_each(answer: &Answer, code: i32) {
    assert_eq!(answer.code, Some(code), "{}{}", answer.out, answer.err);
    assert!(!answer.err.contains("panicked"), "{}", answer.err);
}

#[test]
fn a_level_that_is_altered_is_found_left_out_and_simulated_anew() {
    let (folder, library) = home();
    let file = folder.path().join("l.sqlite");
    let before = digest(&library);
    let alter = "update result set level_1000_Hz_dB = level_1000_Hz_dB + 3
        where sobol_index = 3 and speed_km_h = 7";
    let mut sqlite = std::process::Command::new("sqlite3");
    if !sqlite.arg(&file).arg(alter).status().is_ok_and(|status| status.success()) {
        test_needs::skipped("an altered level; there is no sqlite3");
        return;
    }
    let found = self::library(&["verify", "--library", &library]);
    assert_one_line_each(&found, 1);
    assert!(found.out.contains("checksum") && found.out.contains("case 3"), "{}", found.out);
    assert_eq!(found.out.trim_end().lines().count(), 1, "{}", found.out);
    let tables = folder.path().join("tables").display().to_string();
    let export = self::library(&["export", "--out", &tables, "--library", &library]);
    assert_ne!(export.code, Some(0), "{}", export.out);
    assert!(export.err.contains("case 3"), "{}", export.err);
    let copy = url(&folder.path().join("copy.sqlite"));
    let copied = self::library(&["copy", "--from", &library, "--to", &copy]);
    assert_one_line_each(&copied, 1);
    assert!(copied.out.contains("case 3"), "{}", copied.out);
    // In the copy it is simulated anew, as in the library itself once it was thrown away.
    let campaign = campaign(folder.path());
    let out = folder.path().join("out").display().to_string();
    assert_done(&run(PROGRAM, &["campaign", "retry", "--altered", "--library", &library]));
    for library in [&copy, &library] {
        let arguments = ["run", &campaign, "--no-train", "--out", &out, "--library", library];
        assert_done(&run(PROGRAM, &arguments));
        assert_eq!(digest(library), before);
        assert_done(&self::library(&["verify", "--library", library]));
    }
}

#[test]
fn nothing_is_added_to_a_malformed_library_and_what_is_whole_is_saved() {
    let (folder, library) = home();
    let file = folder.path().join("l.sqlite");
    let bytes = fs::read(&file).unwrap();
    let campaign = campaign(folder.path());
    let out = folder.path().join("out").display().to_string();
    let pages = bytes.len() / PAGE;
    for (what, damaged) in [
        (
            "zeros",
            [&bytes[..(pages - 2) * PAGE], &[0; PAGE], &bytes[(pages - 1) * PAGE..]].concat(),
        ),
        (
            "noise",
            [&bytes[..(pages - 2) * PAGE], &[0x5a; PAGE], &bytes[(pages - 1) * PAGE..]].concat(),
        ),
        ("cut off", bytes[..pages / 2 * PAGE].to_vec()),
        ("all zeros", vec![0; bytes.len()]),
        ("a beginning", bytes[..100].to_vec()),
        ("no database", b"dear diary".to_vec()),
    ] {
        fs::write(&file, &damaged).unwrap();
        for command in [
            &["run", &campaign, "--no-train", "--out", &out, "--library", &library][..],
            &["train", "--out", &out, "--library", &library],
            &["campaign", "add", &campaign, "--library", &library],
            &["coordinator", "--exit-when-done", "--listen", "127.0.0.1:0", "--library", &library],
        ] {
            let answer = run(PROGRAM, command);
            assert!(matches!(answer.code, Some(2 | 3)), "{what}: {command:?} {}", answer.out);
            assert_eq!(answer.err.trim_end().lines().count(), 1, "{what}: {}", answer.err);
            assert!(!answer.err.contains("panicked"), "{what}: {}", answer.err);
        }
        let found = self::library(&["verify", "--library", &library]);
        assert_one_line_each(&found, 1);
        assert!(!found.out.contains("no faults found"), "{what}: {}", found.out);
        assert_eq!(fs::read(&file).unwrap(), damaged, "{what}: it was written to");
    }
    fs::write(
        &file,
        [&bytes[..(pages - 2) * PAGE], &[0; PAGE], &bytes[(pages - 1) * PAGE..]].concat(),
    )
    .unwrap();
    let answer = run(PROGRAM, &["train", "--out", &out, "--library", &library]);
    assert!(answer.err.contains("library copy"), "{}", answer.err);
    let copy = url(&folder.path().join("copy.sqlite"));
    let copied = self::library(&["copy", "--from", &library, "--to", &copy]);
    assert_one_line_each(&copied, 1);
    assert!(copied.out.contains("left out"), "{}", copied.out);
    assert_done(&self::library(&["verify", "--library", &copy]));
}

#[test]
fn an_empty_file_is_found_and_not_filled_by_looking_at_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("empty.sqlite");
    fs::write(&file, "").unwrap();
    let found = self::library(&["verify", "--library", &url(&file)]);
    assert_one_line_each(&found, 1);
    assert!(found.out.contains("empty"), "{}", found.out);
    assert_eq!(fs::metadata(&file).unwrap().len(), 0);
}

#[test]
fn no_byte_of_an_exported_file_changes_a_result_in_silence() {
    let (folder, library) = home();
    let tables = folder.path().join("tables");
    let exported = tables.display().to_string();
    assert_done(&self::library(&["export", "--out", &exported, "--library", &library]));
    let before = digest(&library);
    let file = tables.join("result.parquet");
    let sound = fs::read(&file).unwrap();
    let mut refused = 0;
    for turn in 1..12 {
        let mut bytes = sound.clone();
        bytes[turn * sound.len() / 12] ^= 0x10;
        fs::write(&file, &bytes).unwrap();
        let to = url(&folder.path().join(format!("{turn}.sqlite")));
        let answer = self::library(&["import", &exported, "--library", &to]);
        assert!(!answer.err.contains("panicked"), "{}", answer.err);
        if answer.code == Some(0) {
            // What no checksum is made of, such as a time.
            assert_eq!(digest(&to), before, "turn {turn}");
        } else {
            assert_eq!(answer.code, Some(2), "{}", answer.err);
            refused += 1;
        }
    }
    assert!(refused > 6, "{refused}");
}
