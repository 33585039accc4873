//! A farm of several processes: library, coordinators, workers.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::process::Command;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;
use system_tests::{COARSE_MODEL, Process, free_port, run, until};
use tempfile::TempDir;
use test_postgres::Server;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
pub(crate) const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Time limit for a farm to finish.
pub(crate) const PATIENCE: Duration = Duration::from_mins(2);

/// The database that contains the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    Sqlite,
    Postgres,
}

/// A library, and the settings of the processes that use it.
pub(crate) struct Farm {
    folder: TempDir,
    pub(crate) library: String,
    cases: u32,
    /// Ports of the coordinators. A restarted coordinator uses the same port.
    ports: [u16; 2],
    /// Length of the leases, in s.
    pub(crate) lease: &'static str,
}

impl Farm {
    /// A library with the campaign; `None` if the database is not available.
    pub(crate) fn new(engine: Engine) -> Option<Self> {
        Self::many(engine, 64)
    }

    /// A library with this number of cases of the campaign.
    pub(crate) fn many(engine: Engine, cases: u32) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let library = match engine {
            Engine::Sqlite => format!("sqlite:{}", folder.path().join("l.sqlite").display()),
            Engine::Postgres => Server::shared()?.database(),
        };
        Some(Self::on(folder, library, cases))
    }

    /// A library at this URL with this number of cases.
    pub(crate) fn on(folder: TempDir, library: String, cases: u32) -> Self {
        let campaign = folder.path().join("campaign.toml").display().to_string();
        std::fs::write(&campaign, campaign_of(cases)).unwrap();
        run(PROGRAM, &["campaign", "add", &campaign, "--library", &library]).succeeded();
        let ports = [free_port(), free_port()];
        Self { folder, library, cases, ports, lease: "1.5" }
    }

    /// Command of a coordinator that listens at this address and ends when everything is done.
    pub(crate) fn coordinating(&self, listen: &str) -> Command {
        let mut coordinator = Command::new(PROGRAM);
        coordinator.args(["coordinator", "--exit-when-done", "--library", &self.library]);
        coordinator.args(["--listen", listen, "--lease", self.lease]);
        coordinator
    }

    /// Starts the campaign in one process, with these additional arguments.
    pub(crate) fn run(&self, arguments: &[&str]) -> Process {
        let mut run = Command::new(PROGRAM);
        run.arg("run").arg(self.campaign()).args(["--no-train", "--library", &self.library]);
        run.arg("--out").arg(self.folder.path().join("out")).args(arguments);
        Process::start(&mut run, "run")
    }

    /// Path of the campaign file.
    pub(crate) fn campaign(&self) -> PathBuf {
        self.folder.path().join("campaign.toml")
    }

    /// Number of cases in the library.
    pub(crate) fn cases(&self) -> u64 {
        self.count("1 = 1")
    }

    /// Starts the first or the second coordinator.
    pub(crate) fn coordinator(&self, number: usize) -> Process {
        let listen = format!("127.0.0.1:{}", self.ports[number]);
        Process::start(&mut self.coordinating(&listen), "coordinator")
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
        let mut worker = Command::new(WORKER);
        worker.args(["--coordinator", urls, "--cores", "1"]).envs(environment.iter().cloned());
        Process::start(&mut worker, "worker")
    }

    /// Cuts off a working remote worker for longer than its lease, until a local worker has finished one of
    /// its cases. The remaining cases are left to the remote worker.
    pub(crate) fn outlives_a_cut(
        &self,
        cut: impl FnOnce(),
        near: impl FnOnce() -> Process,
        repair: impl FnOnce(),
    ) {
        self.reach(4);
        cut();
        // Twice a lease. The first cases given out then are those that the far worker held.
        std::thread::sleep(Duration::from_secs(3));
        let near = near();
        let done_again = || self.results().values().any(|(leases, _)| *leases > 1);
        until("the near worker does what the far one held", PATIENCE, done_again);
        near.kill();
        assert!(!self.is_done(), "nothing is left for the far worker");
        repair();
    }

    /// Waits until a coordinator reports that everything is done.
    pub(crate) fn finish(coordinator: &mut Process) {
        assert_eq!(coordinator.ended(PATIENCE).code(), Some(0));
    }

    /// Present number of results.
    pub(crate) fn finished(&self) -> u64 {
        let answer = run(PROGRAM, &["status", "--json", "--library", &self.library]).succeeded();
        let status: serde_json::Value = serde_json::from_str(&answer).unwrap();
        status["campaigns"][0]["finished"].as_u64().unwrap()
    }

    /// Whether every case has a result.
    pub(crate) fn is_done(&self) -> bool {
        self.finished() == u64::from(self.cases)
    }

    /// Result of a query on the library.
    fn ask(&self, sql: &str) -> Vec<serde_json::Value> {
        let ask = ["library", "sql", sql, "--format", "json"];
        let answer = run(PROGRAM, &[&ask[..], &["--library", &self.library]].concat());
        serde_json::from_str(&answer.succeeded()).unwrap()
    }

    /// Present number of leases that ended without a result.
    pub(crate) fn attempts(&self) -> u64 {
        let rows = self.ask("select count(*) as attempts from attempt");
        rows[0]["attempts"].as_u64().unwrap()
    }

    /// Number of cases leased more than once.
    pub(crate) fn leased_again(&self) -> u64 {
        self.count("epoch > 1")
    }

    /// Number of cases that are leased at present.
    pub(crate) fn leased(&self) -> u64 {
        self.count("state = 'leased'")
    }

    fn count(&self, which: &str) -> u64 {
        let ask = format!("select count(*) as cases from campaign_case where {which}");
        self.ask(&ask)[0]["cases"].as_u64().unwrap()
    }

    /// For each case with a result: number of leases, and time of the result.
    pub(crate) fn results(&self) -> BTreeMap<u64, (u64, String)> {
        let rows = self.ask(
            "select sobol_index, epoch, finished_at
            from campaign_case join result using (campaign_id, sobol_index)",
        );
        let came = |row: &serde_json::Value| {
            let leases = row["epoch"].as_u64().unwrap();
            (row["sobol_index"].as_u64().unwrap(), (leases, row["finished_at"].to_string()))
        };
        rows.iter().map(came).collect()
    }

    /// Waits until there is this number of results.
    pub(crate) fn reach(&self, finished: u64) {
        until(&format!("{finished} results"), PATIENCE, || self.finished() >= finished);
    }

    /// Checks that every case has a result, and that the results equal those of a run without faults.
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

/// Text of the campaign file.
fn campaign_of(cases: u32) -> String {
    format!("name = \"faults\"\ncases = {cases}\n{COARSE_MODEL}")
}

fn digest(library: &str) -> String {
    run(PROGRAM, &["library", "digest", "--library", library]).succeeded()
}

/// Digest of a campaign with this number of cases, simulated without faults.
fn undisturbed(cases: u32) -> String {
    static KNOWN: OnceLock<Mutex<HashMap<u32, String>>> = OnceLock::new();
    let mut known = KNOWN.get_or_init(Mutex::default).lock().unwrap();
    let fresh = || {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (campaign, library) = (path("campaign.toml"), format!("sqlite:{}", path("l.sqlite")));
        std::fs::write(&campaign, campaign_of(cases)).unwrap();
        let arguments = ["run", &campaign, "--no-train", "--out", &path("out")];
        run(PROGRAM, &[&arguments[..], &["--library", &library]].concat()).succeeded();
        digest(&library)
    };
    known.entry(cases).or_insert_with(fresh).clone()
}
