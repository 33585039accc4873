//! Campaigns are added and controlled from the command line, without a coordinator.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::{Answer, COARSE_MODEL, run, until};
use tempfile::TempDir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Time limit of all actions in this test, also on a busy machine.
const LONG: Duration = Duration::from_mins(1);

/// A folder with a campaign file and a library.
struct Home(TempDir);

impl Home {
    fn new() -> Self {
        let home = Self(tempfile::tempdir().unwrap());
        home.campaign(5);
        home
    }

    /// Writes the campaign file with this seed.
    fn campaign(&self, seed: u32) {
        let text = format!("name = \"coarse\"\ncases = 60\n{COARSE_MODEL}");
        let text = text.replace("seed = 5", &format!("seed = {seed}"));
        fs::write(self.0.path().join("coarse.toml"), text).unwrap();
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn library(&self) -> String {
        format!("sqlite:{}", self.path("library.sqlite"))
    }

    fn tell(&self, arguments: &[&str]) -> Answer {
        run(PROGRAM, &[&["campaign"], arguments, &["--library", &self.library()]].concat())
    }

    fn add(&self) -> Answer {
        self.tell(&["add", &self.path("coarse.toml")])
    }

    fn cases(&self) -> u64 {
        let answer = run(PROGRAM, &["status", "--json", "--library", &self.library()]);
        if answer.code != Some(0) {
            return 0;
        }
        let status: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
        status["campaigns"][0]["cases"].as_u64().unwrap_or(0)
    }
}

fn assert_refused(answer: &Answer, words: &[&str]) {
    assert_eq!(answer.code, Some(2), "{}{}", answer.out, answer.err);
    for word in words {
        assert!(answer.err.contains(word), "{word} is not in {}", answer.err);
    }
}

#[test]
fn adding_cases_that_is_interrupted_says_how_far_it_came_and_goes_on() {
    let home = Home::new();
    let (file, library) = (home.path("coarse.toml"), home.library());
    let mut command = Command::new(PROGRAM);
    command.args(["campaign", "add", &file, "--cases", "1000000", "--library", &library]);
    let mut adding = command.stderr(Stdio::piped()).spawn().unwrap();
    until("some cases are there", LONG, || home.cases() > 0);
    let told = Command::new("kill").arg("-INT").arg(adding.id().to_string()).status();
    assert!(told.unwrap().success());
    let mut said = String::new();
    adding.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(adding.wait().unwrap().code(), Some(3), "{said}");
    let stored = home.cases();
    assert!(stored < 1_000_000);
    assert!(said.contains(&format!("{stored} of 1000000 cases")), "{said}");
    // With fewer than 65,536 its cases would be those of another sequence, and it another campaign.
    let more = (stored + 10).max(70_000);
    home.tell(&["add", &file, "--cases", &more.to_string()]).succeeded();
    assert_eq!(home.cases(), more);
}

#[test]
fn a_campaign_is_found_by_its_name_and_by_its_id_where_several_have_it() {
    let home = Home::new();
    home.add().succeeded();
    assert!(home.tell(&["pause", "coarse"]).succeeded().contains("is paused"));
    assert!(home.add().succeeded().contains("campaign resume"), "nothing is handed out");
    home.campaign(6);
    let second = home.add();
    assert!(second.err.contains("has the same name"), "{}", second.err);
    let id = second.succeeded().split(':').next().unwrap().to_owned();
    assert_refused(&home.tell(&["resume", "coarse"]), &["give the id", &id]);
    assert_refused(&home.tell(&["resume"]), &["name one", &id]);
    assert_refused(&home.tell(&["resume", "other"]), &["no campaign other", &id]);
    home.tell(&["cancel", &id]).succeeded();
}

#[test]
fn only_what_was_given_up_is_tried_again() {
    let home = Home::new();
    home.add().succeeded();
    assert_refused(&home.tell(&["retry", "--case", "500"]), &["case 500 does not exist"]);
    assert_refused(&home.tell(&["retry", "--case", "5"]), &["case 5 is waiting"]);
    assert!(home.tell(&["retry"]).succeeded().contains("0 cases"));
}

#[test]
fn cases_of_a_paused_campaign_are_tried_again_with_the_remedy() {
    let home = Home::new();
    home.add().succeeded();
    assert!(!home.tell(&["retry"]).succeeded().contains("resume"));
    home.tell(&["pause"]).succeeded();
    let answer = home.tell(&["retry"]).succeeded();
    assert!(answer.contains("it is paused: run `tracktwin campaign resume`"), "{answer}");
    let answer: serde_json::Value =
        serde_json::from_str(&home.tell(&["retry", "--json"]).succeeded()).unwrap();
    assert_eq!(answer["state"], "paused");
}

#[test]
fn a_run_and_a_coordinator_tell_that_they_add_cases() {
    let home = Home::new();
    let (file, out) = (home.path("coarse.toml"), home.path("out"));
    let arguments = ["run", &file, "--no-train", "--out", &out, "--library", &home.library()];
    let told = |cases: &str| run(PROGRAM, &[&arguments[..], &["--cases", cases]].concat()).err;
    assert!(told("8").contains("adding cases: done"));
    assert!(!told("8").contains("adding cases"), "there is nothing to add");
    let listen = format!("127.0.0.1:{}", system_tests::free_port());
    home.tell(&["pause"]).succeeded();
    let arguments = ["coordinator", "--exit-when-done", "--listen", &listen, "--campaign", &file];
    let answer = run(PROGRAM, &[&arguments[..], &["--library", &home.library()]].concat());
    assert!(answer.err.contains("adding cases"), "{}", answer.err);
    assert!(answer.err.contains("cases=60 total=60"), "{}", answer.err);
    assert_eq!(home.cases(), 60);
}

#[test]
fn a_parameter_that_is_altered_is_restored_with_and_without_results() {
    let home = Home::new();
    let (file, out, url) = (home.path("coarse.toml"), home.path("out"), home.library());
    let simulate = ["run", &file, "--no-train", "--cases", "8", "--out", &out, "--library", &url];
    let library = |command: &str| run(PROGRAM, &["library", command, "--library", &url]);
    run(PROGRAM, &simulate).succeeded();
    let digest = library("digest").succeeded();
    let alter = "update campaign_case set railpad_stiffness_N_m = 2 * railpad_stiffness_N_m where sobol_index = 3";
    let discard = "delete from result where sobol_index = 3;
        update campaign_case set state = 'waiting' where sobol_index = 3";
    for (change, is_given_up) in [(alter.to_owned(), false), (format!("{alter}; {discard}"), true)]
    {
        let mut sqlite = Command::new("sqlite3");
        let altered = sqlite.arg(home.path("library.sqlite")).arg(change).status();
        if !altered.is_ok_and(|status| status.success()) {
            test_needs::skipped("an altered parameter; there is no sqlite3");
            return;
        }
        assert_eq!(library("verify").code, Some(1));
        run(PROGRAM, &simulate).succeeded();
        let status = library("status").succeeded();
        assert_eq!(status.contains("campaign retry --altered"), is_given_up, "{status}");
        let restored = home.tell(&["retry", "--altered"]).succeeded();
        assert!(
            restored.contains("the parameters of 1 cases were restored, 0 cases"),
            "{restored}"
        );
        run(PROGRAM, &simulate).succeeded();
        assert_eq!(library("digest").succeeded(), digest);
        library("verify").succeeded();
    }
}

#[test]
fn cases_added_and_tried_again_are_counted_in_json() {
    let home = Home::new();
    let tell = |arguments: &[&str]| -> serde_json::Value {
        let answer = home.tell(&[arguments, &["--json"]].concat()).succeeded();
        serde_json::from_str(&answer).unwrap()
    };
    let added = tell(&["add", &home.path("coarse.toml")]);
    assert_eq!((&added["cases"], &added["to_simulate"]), (&60.into(), &60.into()));
    assert_eq!(added["state"], "running");
    let again = tell(&["retry"]);
    assert_eq!((&again["campaign"], &again["to_simulate"]), (&added["campaign"], &0.into()));
}

#[test]
fn watching_ends_when_nobody_reads() {
    let home = Home::new();
    home.add().succeeded();
    let mut command = Command::new(PROGRAM);
    command.args(["status", "--watch", "--every", "1", "--library", &home.library()]);
    let mut watching = command.stdout(Stdio::piped()).spawn().unwrap();
    drop(watching.stdout.take());
    until("it ends", LONG, || watching.try_wait().unwrap().is_some());
    assert_eq!(watching.wait().unwrap().code(), Some(0));
}

#[test]
fn a_coordinator_that_ends_says_what_paused_campaigns_have_left() {
    let home = Home::new();
    home.add().succeeded();
    home.tell(&["pause"]).succeeded();
    let listen = format!("127.0.0.1:{}", system_tests::free_port());
    let arguments = ["coordinator", "--exit-when-done", "--listen", &listen, "--library"];
    let answer = run(PROGRAM, &[&arguments[..], &[&home.library()]].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(answer.err.contains("done, except for paused campaigns cases=60"), "{}", answer.err);
}
