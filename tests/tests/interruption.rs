//! A campaign continues correctly after SIGKILL at any moment: no result is lost or changed.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::{COARSE_MODEL, Process, run, until};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Number of cases: enough for ten interruptions during the computation, few enough for a test.
const CASES: u32 = 600;

fn arguments<'a>(campaign: &'a str, library: &'a str, out: &'a str) -> Vec<&'a str> {
    vec!["run", campaign, "--no-train", "--library", library, "--out", out]
}

fn digest(library: &str) -> String {
    let answer = run(PROGRAM, &["library", "digest", "--library", library]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    answer.out
}

/// Number of cases with results; `None` if the library does not exist yet.
fn finished(library: &str) -> u32 {
    let ask = "select count(*) from campaign_case where state = 'finished'";
    let ask = ["library", "sql", ask, "--library", library, "--format", "csv"];
    let answer = run(PROGRAM, &ask).out;
    answer.lines().nth(1).map_or(0, |count| count.parse().unwrap())
}

#[test]
fn ten_kills_at_random_moments_leave_the_digest_of_an_undisturbed_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let campaign = path("campaign.toml");
    std::fs::write(&campaign, format!("name = \"kill\"\ncases = {CASES}\n{COARSE_MODEL}")).unwrap();

    let undisturbed = format!("sqlite:{}", path("undisturbed.sqlite"));
    let out = path("out");
    let answer = run(PROGRAM, &arguments(&campaign, &undisturbed, &out));
    assert_eq!(answer.code, Some(0), "{}", answer.err);

    let disturbed = format!("sqlite:{}", path("disturbed.sqlite"));
    let mut fell_into_the_work = 0;
    for kill in 0..10_u64 {
        let mut child = Command::new(PROGRAM)
            .args(arguments(&campaign, &disturbed, &out))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Moments spread over start, work and end by the golden ratio.
        std::thread::sleep(Duration::from_millis(20 + (kill * 618) % 1000));
        child.kill().unwrap();
        child.wait().unwrap();
        fell_into_the_work += u32::from((1..CASES).contains(&finished(&disturbed)));
    }
    assert!(fell_into_the_work > 2, "{fell_into_the_work} of ten kills");
    let answer = run(PROGRAM, &arguments(&campaign, &disturbed, &out));
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert_eq!(digest(&disturbed), digest(&undisturbed));
}

#[test]
fn a_signal_stops_the_simulation_in_order_and_the_training_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let campaign = path("campaign.toml");
    let text = format!("name = \"stop\"\ncases = {CASES}\n{COARSE_MODEL}");
    std::fs::write(&campaign, text).unwrap();
    let library = format!("sqlite:{}", path("library.sqlite"));
    let out = path("out");
    let arguments = ["run", &campaign, "--library", &library, "--out", &out];
    let stopped_at = |cases: u32| {
        let mut run = Process::start(Command::new(PROGRAM).args(arguments), "run");
        until("so many cases are done", Duration::from_mins(1), || finished(&library) >= cases);
        if cases == CASES {
            // Until the farm has wound up; training takes longer than this.
            std::thread::sleep(Duration::from_secs(1));
        }
        run.signal("INT");
        run.ended(Duration::from_secs(10)).code()
    };
    assert_eq!(stopped_at(1), Some(3));
    let left = CASES - finished(&library);
    assert!((1..CASES).contains(&left), "{left} left");
    // A slow machine may still have been winding up; then nothing is left of that the next time.
    assert!((0..3).any(|_| stopped_at(CASES) == Some(130)));
    assert!(!folder.path().join("out/models/models.html").exists());

    let answer = run(PROGRAM, &arguments);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(answer.err.contains("sample recording"), "{}", answer.err);
    assert!(answer.out.starts_with("models: "), "{}", answer.out);
}
