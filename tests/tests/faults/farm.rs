//! A farm of processes: its library, its coordinators, its workers.

use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, TcpListener};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use system_tests::run;
use tempfile::TempDir;
use test_postgres::Server;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// A coarse, short model: what is tested is the farm.
const CAMPAIGN: &str = "name = \"faults\"\nseed = 5\ncases = 64\nspeeds_km_h = [13]\n\
    [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n";

/// When a farm that is not done has failed.
const PATIENCE: Duration = Duration::from_mins(2);

/// Which database holds the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    Sqlite,
    Postgres,
}

/// A library, and what runs on it.
pub(crate) struct Farm {
    _folder: TempDir,
    pub(crate) library: String,
    cases: u32,
    /// The coordinators' ports: they keep them when they are started again.
    ports: [u16; 2],
    /// How long leases last, in s.
    pub(crate) lease: &'static str,
}

/// A process that ends with its handle.
pub(crate) struct Process(pub(crate) Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    /// Sends a signal by its name.
    pub(crate) fn signal(&self, name: &str) {
        let pid = self.0.id().to_string();
        let sent = Command::new("kill").args([&format!("-{name}"), &pid]).status().unwrap();
        assert!(sent.success());
    }

    /// Ends it at once.
    pub(crate) fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Waits for its end.
    pub(crate) fn ended(&mut self, within: Duration) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status;
            }
            assert!(begun.elapsed() < within, "it did not end within {within:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Farm {
    /// A library with the campaign in it; nothing where there is no such database.
    pub(crate) fn new(engine: Engine) -> Option<Self> {
        Self::many(engine, 64)
    }

    /// A library with so many cases of the campaign.
    pub(crate) fn many(engine: Engine, cases: u32) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let library = match engine {
            Engine::Sqlite => format!("sqlite:{}", folder.path().join("l.sqlite").display()),
            Engine::Postgres => Server::shared()?.database(),
        };
        Some(Self::on(folder, library, cases))
    }

    /// A library at this address with so many cases.
    pub(crate) fn on(folder: TempDir, library: String, cases: u32) -> Self {
        let campaign = folder.path().join("campaign.toml").display().to_string();
        std::fs::write(&campaign, CAMPAIGN).unwrap();
        let farm = Self {
            _folder: folder,
            library,
            cases,
            ports: [free_port(), free_port()],
            lease: "1.5",
        };
        let cases = cases.to_string();
        let add = ["campaign", "add", &campaign, "--cases", &cases, "--library", &farm.library];
        let answer = run(PROGRAM, &add);
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        farm
    }

    /// Starts the first or the second coordinator; it ends when everything is done.
    pub(crate) fn coordinator(&self, number: usize) -> Process {
        let listen = format!("127.0.0.1:{}", self.ports[number]);
        let arguments = ["coordinator", "--exit-when-done", "--library", &self.library];
        let child = Command::new(PROGRAM)
            .args(arguments)
            .args(["--listen", &listen, "--lease", self.lease])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        forwarding(child, "coordinator")
    }

    /// Port of a coordinator.
    pub(crate) const fn port(&self, number: usize) -> u16 {
        self.ports[number]
    }

    /// Starts a worker of one core for both coordinators.
    pub(crate) fn worker(&self) -> Process {
        Self::worker_of(&self.urls())
    }

    /// Addresses of both coordinators.
    pub(crate) fn urls(&self) -> String {
        self.ports.map(|port| format!("http://127.0.0.1:{port}")).join(",")
    }

    /// Starts a worker of one core for these coordinators.
    pub(crate) fn worker_of(urls: &str) -> Process {
        Self::worker_in(urls, &[])
    }

    /// Starts a worker of one core for these coordinators, with these environment variables.
    pub(crate) fn worker_in(urls: &str, environment: &[(&str, String)]) -> Process {
        let child = Command::new(WORKER)
            .args(["--coordinator", urls, "--cores", "1"])
            .envs(environment.iter().cloned())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        forwarding(child, "worker")
    }

    /// Waits until a coordinator says that everything is done.
    pub(crate) fn finish(coordinator: &mut Process) {
        assert_eq!(coordinator.ended(PATIENCE).code(), Some(0));
    }

    /// Results so far.
    pub(crate) fn finished(&self) -> u64 {
        let answer = run(PROGRAM, &["status", "--json", "--library", &self.library]);
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        let status: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
        status["campaigns"][0]["finished"].as_u64().unwrap()
    }

    /// Whether every case has a result.
    pub(crate) fn is_done(&self) -> bool {
        self.finished() == u64::from(self.cases)
    }

    /// Leases that ended without a result so far.
    pub(crate) fn attempts(&self) -> u64 {
        let ask = "select count(*) as attempts from attempt";
        let answer =
            run(PROGRAM, &["library", "sql", ask, "--format", "json", "--library", &self.library]);
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        let rows: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
        rows[0]["attempts"].as_u64().unwrap()
    }

    /// Waits until there are so many results.
    pub(crate) fn reach(&self, finished: u64) {
        let begun = Instant::now();
        while self.finished() < finished {
            assert!(begun.elapsed() < PATIENCE, "{} of {finished}", self.finished());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Every case has a result, and the results are those of an undisturbed run.
    pub(crate) fn assert_undisturbed(&self) {
        assert!(
            self.is_done(),
            "{} of {}: cases are lost or given up",
            self.finished(),
            self.cases
        );
        assert_eq!(digest(&self.library), undisturbed(self.cases));
    }
}

/// Passes on what a process says, so that a failed test tells it.
fn forwarding(mut child: Child, name: &'static str) -> Process {
    let pid = child.id();
    let said = BufReader::new(child.stderr.take().unwrap());
    std::thread::spawn(move || {
        for line in said.lines().map_while(Result::ok) {
            eprintln!("{name} {pid}: {line}");
        }
    });
    Process(child)
}

fn digest(library: &str) -> String {
    let answer = run(PROGRAM, &["library", "digest", "--library", library]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    answer.out
}

/// The digest of a campaign of so many cases that nothing disturbed.
fn undisturbed(cases: u32) -> String {
    static KNOWN: OnceLock<std::sync::Mutex<std::collections::HashMap<u32, String>>> =
        OnceLock::new();
    let mut known = KNOWN.get_or_init(Default::default).lock().unwrap();
    let fresh = || {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (campaign, library) = (path("campaign.toml"), format!("sqlite:{}", path("l.sqlite")));
        std::fs::write(&campaign, CAMPAIGN).unwrap();
        let (cases, out) = (cases.to_string(), path("out"));
        let arguments = ["run", &campaign, "--cases", &cases, "--no-train", "--out", &out];
        let answer = run(PROGRAM, &[&arguments[..], &["--library", &library]].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        digest(&library)
    };
    known.entry(cases).or_insert_with(fresh).clone()
}

/// A port that nobody listens on now.
pub(crate) fn free_port() -> u16 {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().port()
}
