//! A worker in a batch system: the exit code states whether to start the worker again, and the log is a
//! file.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::{Answer, COARSE_MODEL, Process, free_port, run, until};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Time limit of all actions in this test, also on a busy machine.
const LONG: Duration = Duration::from_mins(1);

/// A coordinator without cases that requires a token, and its address.
fn coordinator(folder: &Path) -> (Process, String) {
    fs::write(folder.join("token"), "a-token-of-thirty-two-characters").unwrap();
    let address = format!("127.0.0.1:{}", free_port());
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(["coordinator", "--library", "sqlite:library.sqlite"]);
    command.args(["--token-file", "token", "--listen", &address]);
    let process = Process::start(&mut command, "coordinator");
    until("the coordinator listens", LONG, || std::net::TcpStream::connect(&address).is_ok());
    (process, format!("http://{address}"))
}

fn worker(arguments: &[&str]) -> Answer {
    run(WORKER, &[&["--cores", "1"], arguments].concat())
}

#[test]
fn a_worker_without_coordinator_may_be_started_again() {
    let nobody = format!("http://127.0.0.1:{}", free_port());
    let answer = worker(&["--coordinator", &nobody, "--give-up-after", "1"]);
    assert_eq!(answer.code, Some(3), "{}", answer.err);
    assert!(answer.err.contains("does not respond"), "it logs: {}", answer.err);
    assert!(!answer.err.contains('\u{1b}'), "colours are for terminals: {}", answer.err);
}

#[test]
fn a_refused_worker_is_not_to_be_started_again() {
    let folder = tempfile::tempdir().unwrap();
    let (_coordinator, address) = coordinator(folder.path());
    let answer = worker(&["--coordinator", &address]);
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert!(answer.err.contains("--token-file"), "{}", answer.err);
}

#[test]
fn a_token_that_no_worker_can_show_is_refused_by_the_coordinator() {
    let folder = tempfile::tempdir().unwrap();
    let token = folder.path().join("token");
    let library = folder.path().join("library.sqlite");
    let (file, url) = (token.display().to_string(), format!("sqlite:{}", library.display()));
    for wrong in ["", "two words", "schlüssel"] {
        fs::write(&token, wrong).unwrap();
        let answer = run(PROGRAM, &["coordinator", "--library", &url, "--token-file", &file]);
        assert_eq!(answer.code, Some(2), "{wrong}: {}", answer.err);
        assert!(answer.err.contains(&file) && answer.err.contains("certs"), "{}", answer.err);
        assert!(!library.exists());
    }
}

#[test]
fn a_worker_without_work_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let (_coordinator, address) = coordinator(folder.path());
    let token = folder.path().join("token").display().to_string();
    let answer = worker(&["--coordinator", &address, "--token-file", &token, "--idle-exit", "1"]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
}

#[test]
fn a_run_on_one_machine_takes_results_of_nobody_else_there() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = format!("name = \"alone\"\ncases = 2000\n{COARSE_MODEL}");
    fs::write(folder.path().join("campaign.toml"), campaign).unwrap();
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder.path()).args(["run", "campaign.toml", "--cores", "1"]);
    let running = Process::start(&mut command, "run");
    until("it has a port", LONG, || running.port().is_some());
    let address = format!("http://127.0.0.1:{}", running.port().unwrap());
    let answer = worker(&["--coordinator", &address, "--give-up-after", "5"]);
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert!(answer.err.contains("the token is missing"), "{}", answer.err);
}

#[test]
fn a_log_that_nobody_takes_stops_neither_coordinator_nor_worker_nor_run() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = format!("name = \"unheard\"\ncases = 16\n{COARSE_MODEL}");
    fs::write(folder.path().join("campaign.toml"), campaign).unwrap();
    let unheard = |program: &str, arguments: &[&str]| {
        // Every write to this device fails.
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(program);
        command.current_dir(folder.path()).args(arguments).env("RUST_LOG", "info");
        command.stdout(Stdio::null()).stderr(full).spawn().unwrap()
    };
    let address = format!("127.0.0.1:{}", free_port());
    let arguments = ["--library", "sqlite:library.sqlite", "--campaign", "campaign.toml"];
    let listen = ["coordinator", "--exit-when-done", "--listen", &address];
    let mut coordinator = unheard(PROGRAM, &[&listen[..], &arguments].concat());
    let url = format!("http://{address}");
    let mut worker =
        unheard(WORKER, &["--cores", "1", "--coordinator", &url, "--give-up-after", "1"]);
    until("the campaign is done", LONG, || coordinator.try_wait().unwrap().is_some());
    assert_eq!(coordinator.wait().unwrap().code(), Some(0));
    until("the worker ends", LONG, || worker.try_wait().unwrap().is_some());
    let run = ["run", "campaign.toml", "--no-train", "--cores", "1"];
    let mut run = unheard(PROGRAM, &run);
    until("the run ends", LONG, || run.try_wait().unwrap().is_some());
    assert_eq!(run.wait().unwrap().code(), Some(0));
}
