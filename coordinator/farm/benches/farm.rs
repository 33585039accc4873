//! Throughput of the farm in cases per second: durable leases, and 12 kB of results per case through gRPC
//! into the library, from workers that compute nothing.
//!
//! `cargo bench -p tracktwin-farm --bench farm -- [throughput|sqlite|postgres|workers|memory] [--cases N]`
//!
//! Coordinator and workers run in this process. The CPU time is that of this process and, stated
//! separately, that of the PostgreSQL server it has started. Libraries are created in
//! `$TRACKTWIN_BENCH_DIR`, or in the current folder.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark reports by stopping")]

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};
use test_postgres::Server;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_experiment::{Case, Experiment, ExperimentError, Outcome, PassFeatures, Simulate};
use tracktwin_farm::campaign::{self, Campaign};
use tracktwin_farm::dispatch::{Counts, Dispatch, Settings};
use tracktwin_farm::security::Security;
use tracktwin_farm::serve;
use tracktwin_library::Library;
use tracktwin_signal::{Features, ThirdOctave};
use tracktwin_worker::agent::{self, Config};

/// Voices per octave. 79 voices give 500 bins per pass, and 12 kB of features per case with three passes.
/// The 48 voices of the built-in campaign give 7 kB.
const VOICES_PER_OCTAVE: u32 = 79;

/// Replaces the track model: it returns the same features for every case.
struct StandIn(Vec<PassFeatures>);

impl Simulate for StandIn {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        vec![Outcome::Finished(self.0.clone()); cases.len()]
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn stand_in(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    let bins = experiment.features.frequencies_hz().len();
    assert_eq!(bins * experiment.speeds_km_h.len() * size_of::<f64>(), 12_000);
    let pass = |&speed_km_h: &f64| PassFeatures {
        speed_km_h,
        features: Features {
            log_power: (0..bins).map(|bin| (bin as f64 * speed_km_h).sin()).collect(),
            band_levels_db: vec![speed_km_h; ThirdOctave::COUNT],
        },
        contact_loss_share: Some(0.0),
    };
    Ok(Box::new(StandIn(experiment.speeds_km_h.iter().map(pass).collect())))
}

/// Cost of a run.
struct Cost {
    seconds: f64,
    cpu: Cpu,
    memory_mb: f64,
}

/// CPU time in s.
struct Cpu {
    total_s: f64,
    /// Part of the processes that this process has started.
    server_s: f64,
}

/// CPU time, until now, of this process and of all processes that it has started.
///
/// Read from `stat` of proc(5): parent (field 4), and times in hundredths of a second of the process itself
/// (14, 15) and of its ended children (16, 17).
fn cpu() -> Cpu {
    let mut parents = HashMap::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Ok(stat) = std::fs::read_to_string(entry.path().join("stat")) else { continue };
        let pid: u32 = stat.split(' ').next().unwrap().parse().unwrap();
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
        let time: f64 = fields[11..15].iter().map(|field| field.parse::<f64>().unwrap()).sum();
        parents.insert(pid, (fields[1].parse::<u32>().unwrap(), time / 100.0));
    }
    let mine = |&pid: &u32| {
        let parent = |&pid: &u32| parents.get(&pid).map(|(parent, _)| *parent);
        std::iter::successors(Some(pid), parent).any(|it| it == std::process::id())
    };
    let mine = parents.iter().filter(|(pid, _)| mine(pid));
    let total_s: f64 = mine.map(|(_, (_, time))| time).sum();
    Cpu { total_s, server_s: total_s - parents[&std::process::id()].1 }
}

/// Memory of this process in MB.
fn memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

/// Simulates this number of cases with this number of workers of one core each.
async fn pass_through(url: &str, cases: u32, workers: usize) -> Cost {
    let mut campaign = Campaign::built_in(Some(cases)).unwrap();
    campaign.definition.experiment.features.voices_per_octave = VOICES_PER_OCTAVE;
    let library = Library::open_or_create(url).await.unwrap();
    campaign::store_campaign(&library, &campaign).await.unwrap();
    let settings = Settings { prepare: stand_in, ..Settings::default() };
    let dispatch = Dispatch::new(library.clone(), settings, Counts::default());
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let coordinator = format!("http://{}", listener.local_addr().unwrap());
    let stop = CancellationToken::new();
    let end = stop.clone();
    let server =
        tokio::spawn(async move { serve(listener, dispatch, &Security::default(), end).await });

    let (begun, before) = (Instant::now(), cpu());
    let done = CancellationToken::new();
    let workers: Vec<_> = (0..workers)
        .map(|_| {
            let config =
                Config { prepare: stand_in, ..Config::new(coordinator.clone(), NonZeroUsize::MIN) };
            tokio::spawn(agent::run(config, done.clone()))
        })
        .collect();
    let id = campaign.id();
    while library.status(&id).await.unwrap().finished < cases {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let (seconds, after) = (begun.elapsed().as_secs_f64(), cpu());
    let cpu =
        Cpu { total_s: after.total_s - before.total_s, server_s: after.server_s - before.server_s };
    let memory_mb = memory_mb();
    done.cancel();
    for worker in workers {
        worker.await.unwrap().unwrap();
    }
    stop.cancel();
    server.await.unwrap().unwrap();
    library.close().await;
    Cost { seconds, cpu, memory_mb }
}

fn tell(name: &str, cases: u32, workers: usize, cost: &Cost) {
    let Cost { seconds, cpu, memory_mb } = cost;
    let cases = f64::from(cases);
    println!(
        "| {name} | {cases} | {workers} | {:.0} | {:.3} | {:.3} | {memory_mb:.0} |",
        cases / seconds,
        1000.0 * cpu.total_s / cases,
        1000.0 * cpu.server_s / cases
    );
}

async fn through_sqlite(name: &str, cases: u32, workers: usize) {
    let folder =
        tempfile::tempdir_in(std::env::var("TRACKTWIN_BENCH_DIR").unwrap_or_else(|_| ".".into()))
            .unwrap();
    let url = format!("sqlite:{}", folder.path().join("l.sqlite").display());
    tell(name, cases, workers, &pass_through(&url, cases, workers).await);
}

async fn through_postgres(server: &Server, name: &str, cases: u32, workers: usize) {
    let database = server.database();
    tell(name, cases, workers, &pass_through(&database, cases, workers).await);
    server.remove(&database);
    server.checkpoint();
}

/// Measures with a second library, after a run with a first one, which is removed. The first run warms up
/// the file cache, and a new PostgreSQL server fills its log files with zeros during it.
async fn measure(engine: &str, cases: u32) {
    if engine == "sqlite" {
        for name in ["SQLite, synchronous=FULL, first", "SQLite, synchronous=FULL"] {
            through_sqlite(name, cases, 2).await;
        }
        return;
    }
    let durable = test_postgres::Settings { durable: true };
    let Some(server) = Server::start(durable) else { return };
    for name in ["PostgreSQL, fsync, first", "PostgreSQL, fsync"] {
        through_postgres(&server, name, cases, 2).await;
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|it| it != "--bench").collect();
    let cases = arguments.iter().skip_while(|it| *it != "--cases").nth(1);
    let cases: u32 = cases.map_or(20_000, |text| text.parse().expect("--cases N"));
    let what = arguments.first().filter(|it| !it.starts_with('-')).map_or("throughput", |it| it);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    println!(
        "| library | cases | workers | cases a second | CPU in ms a case | of it the server's | memory in MB |"
    );
    println!("|---|---|---|---|---|---|---|");
    runtime.block_on(async {
        match what {
            "sqlite" | "postgres" => measure(what, cases).await,
            "workers" => through_sqlite("SQLite, synchronous=FULL", cases, 1000).await,
            "memory" => {
                for cases in [cases / 10, cases] {
                    through_sqlite("SQLite, synchronous=FULL", cases, 2).await;
                }
            }
            _ => {
                measure("sqlite", cases).await;
                measure("postgres", cases).await;
            }
        }
    });
}
