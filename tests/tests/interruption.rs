//! A campaign survives SIGKILL at any moment: nothing is lost, nothing is computed into another
//! result.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::{COARSE_MODEL, run};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Enough cases that ten interruptions fall into the work, few enough for a test.
const CASES: u32 = 600;

fn arguments<'a>(campaign: &'a str, library: &'a str, out: &'a str) -> Vec<&'a str> {
    vec!["run", campaign, "--no-train", "--library", library, "--out", out]
}

fn digest(library: &str) -> String {
    let answer = run(PROGRAM, &["library", "digest", "--library", library]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    answer.out
}

/// Cases with results; none where there is no library yet.
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
