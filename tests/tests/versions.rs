//! Libraries of other program versions: an earlier schema, and results of another model.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::{Answer, COARSE_MODEL, Process, free_port, run, until};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Sets one case of a finished campaign to waiting, and the results of the others to another model.
const ONE_WAITS: &str = "
    delete from result where sobol_index = 2;
    update campaign_case set state = 'waiting' where sobol_index = 2;
    update result set model_hash = 'earlier';";

/// Runs statements on a file without the program. Returns `false` if there is no `sqlite3`.
fn sqlite(file: &str, statements: &str) -> bool {
    let Ok(mut sqlite) = Command::new("sqlite3").arg(file).stdin(Stdio::piped()).spawn() else {
        test_needs::skipped("libraries of other versions; there is no sqlite3");
        return false;
    };
    sqlite.stdin.take().unwrap().write_all(statements.as_bytes()).unwrap();
    assert!(sqlite.wait().unwrap().success());
    true
}

fn assert_refused(answer: &Answer) {
    assert_eq!(answer.code, Some(2), "{}{}", answer.out, answer.err);
    assert_eq!(answer.err.trim_end().lines().count(), 1, "{}", answer.err);
}

#[test]
fn results_of_another_model_are_not_continued_and_are_computed_again_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, library, out) =
        (path("l.sqlite"), format!("sqlite:{}", path("l.sqlite")), path("out"));
    let campaign = |cases: u32| {
        let file = path("campaign.toml");
        fs::write(&file, format!("name = \"asked\"\ncases = {cases}\n{COARSE_MODEL}")).unwrap();
        file
    };
    let finish = || {
        let file = campaign(4);
        run(PROGRAM, &["run", &file, "--no-train", "--out", &out, "--library", &library])
            .succeeded();
        run(PROGRAM, &["library", "digest", "--library", &library]).succeeded()
    };
    let before = finish();
    if !sqlite(&file, "update result set model_hash = 'earlier';") {
        return;
    }
    let more = campaign(5);
    for command in [
        &["run", &more, "--no-train", "--out", &out][..],
        &["campaign", "add", &more],
        &["coordinator", "--exit-when-done", "--listen", "127.0.0.1:0", "--campaign", &more],
    ] {
        let answer = run(PROGRAM, &[command, &["--library", &library]].concat());
        assert_refused(&answer);
        for word in ["model earlier", "new campaign", "campaign retry asked", "--other-model"] {
            assert!(answer.err.contains(word), "{word} is not in {}", answer.err);
        }
    }
    let again = ["campaign", "retry", "--other-model", "--library", &library];
    assert!(run(PROGRAM, &again).succeeded().contains("4 cases"), "no case was added");
    assert_eq!(finish(), before);
}

#[test]
fn a_coordinator_pauses_a_campaign_of_another_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, campaign) = (path("l.sqlite"), path("campaign.toml"));
    let library = format!("sqlite:{file}");
    fs::write(&campaign, format!("name = \"asked\"\ncases = 4\n{COARSE_MODEL}")).unwrap();
    let run_all = ["run", &campaign, "--no-train", "--out", &path("out"), "--library", &library];
    run(PROGRAM, &run_all).succeeded();
    if !sqlite(&file, ONE_WAITS) {
        return;
    }
    let listen = format!("127.0.0.1:{}", free_port());
    let mut coordinator = Command::new(PROGRAM);
    coordinator.args(["coordinator", "--listen", &listen, "--library", &library]);
    let mut worker = Command::new(WORKER);
    worker.args(["--coordinator", &format!("http://{listen}"), "--cores", "1"]);
    let _farm = [(&mut coordinator, "coordinator"), (&mut worker, "worker")]
        .map(|(it, name)| Process::start(it, name));
    let status = || run(PROGRAM, &["status", "--json", "--library", &library]).out;
    until("it is paused", Duration::from_mins(1), || status().contains("\"paused\""));
    let counts = "select finished, waiting from campaign_status";
    let counts =
        run(PROGRAM, &["library", "sql", counts, "--format", "csv", "--library", &library]);
    assert_eq!(counts.succeeded(), "finished,waiting\n3,1\n");
}

#[test]
fn a_library_of_an_earlier_schema_is_upgraded_by_nothing_that_only_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let file = path("l.sqlite");
    let earlier = include_str!("../../coordinator/library/tests/library/schemas/0001.sql");
    if !sqlite(&file, earlier) {
        return;
    }
    let (library, before) = (format!("sqlite:{file}"), fs::read(&file).unwrap());
    let (tables, copy) = (path("tables"), format!("sqlite:{}", path("copy.sqlite")));
    for command in [
        &["status", "--library", &library][..],
        &["library", "status", "--library", &library],
        &["library", "digest", "--library", &library],
        &["library", "sql", "select 1", "--library", &library],
        &["library", "export", "--out", &tables, "--library", &library],
        &["library", "verify", "--library", &library],
        &["library", "copy", "--from", &library, "--to", &copy],
    ] {
        let answer = run(PROGRAM, command);
        assert_refused(&answer);
        assert!(answer.err.contains("`tracktwin library upgrade`"), "{command:?}: {}", answer.err);
    }
    assert_eq!(fs::read(&file).unwrap(), before);
    for done in ["upgrade", "verify"] {
        run(PROGRAM, &["library", done, "--library", &library]).succeeded();
    }
}
