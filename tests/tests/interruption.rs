//! A campaign survives SIGKILL at any moment: nothing is lost, nothing is computed into another
//! result.

use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Enough cases that ten interruptions fall into the work, few enough for a test.
const CASES: &str = "96";

fn arguments<'a>(campaign: &'a str, library: &'a str, out: &'a str) -> Vec<&'a str> {
    vec!["run", campaign, "--cases", CASES, "--no-train", "--library", library, "--out", out]
}

fn digest(library: &str) -> String {
    let answer = run(PROGRAM, &["library", "digest", "--library", library]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    answer.out
}

#[test]
fn ten_kills_at_random_moments_leave_the_digest_of_an_undisturbed_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let campaign = path("campaign.toml");
    // A coarse, short model: what is tested is the farm.
    std::fs::write(
        &campaign,
        "name = \"kill\"\nseed = 5\ncases = 96\nspeeds_km_h = [13]\n\
         [simulation]\nrail_elements_per_span = 2\nsleeper_elements = 2\n",
    )
    .unwrap();

    let undisturbed = format!("sqlite:{}", path("undisturbed.sqlite"));
    let out = path("out");
    let answer = run(PROGRAM, &arguments(&campaign, &undisturbed, &out));
    assert_eq!(answer.code, Some(0), "{}", answer.err);

    let disturbed = format!("sqlite:{}", path("disturbed.sqlite"));
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
    }
    let answer = run(PROGRAM, &arguments(&campaign, &disturbed, &out));
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert_eq!(digest(&disturbed), digest(&undisturbed));
}
