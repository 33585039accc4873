//! Costs of a lease and of a case in the writer of `SQLite`: the service times of `docs/scaling.md`.
//!
//! `cargo bench -p tracktwin-benches --bench service_times`
//!
//! Eight workers lease and report one batch at a time. The result is the CPU time of the threads that call
//! the database. A lease with its report costs `a`, each of its cases `b`: n leases of m cases take n a + n
//! m b. The values are fitted to the batches by least squares of the time per case.

use tracktwin_benches::{Failure, cpu_of_threads, fill, finish, sqlite_library};
use tracktwin_library::Library;

/// Number of cases in a lease, and number of cases processed with leases of this size.
const BATCHES: [(u32, u32); 4] = [(1, 4_000), (8, 16_000), (50, 40_000), (128, 40_000)];

/// Name of the threads in which sqlx calls `SQLite`.
const THREADS: &str = "sqlx-sqlite-wor";

#[tokio::main]
async fn main() -> Result<(), Failure> {
    println!("| cases a lease | cases | writer's CPU in ms a case |");
    println!("|---|---|---|");
    let mut points = Vec::new();
    for (batch, cases) in BATCHES {
        let case_ms = 1e3 * writer_s(batch, cases).await? / f64::from(cases);
        println!("| {batch} | {cases} | {case_ms:.3} |");
        points.push((1.0 / f64::from(batch), case_ms));
    }
    let (lease_ms, case_ms) = line(&points);
    println!("a lease: {lease_ms:.2} ms, a case: {case_ms:.3} ms");
    Ok(())
}

/// CPU time of the writer in s for this number of cases, with leases of `batch` cases.
async fn writer_s(batch: u32, cases: u32) -> Result<f64, Failure> {
    let (_folder, url) = sqlite_library()?;
    let library = Library::open_or_create(&url).await?;
    fill(&library, cases).await?;
    let before = cpu_of_threads(THREADS);
    finish(&library, cases, batch).await?;
    let cpu_s = cpu_of_threads(THREADS) - before;
    library.close().await;
    Ok(cpu_s)
}

/// Slope and intercept of the line through these points, by least squares.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|it| it.0), mean(|it| it.1));
    let covariance: f64 = points.iter().map(|it| (it.0 - x) * (it.1 - y)).sum();
    let variance: f64 = points.iter().map(|it| (it.0 - x).powi(2)).sum();
    let slope = covariance / variance;
    (slope, y - slope * x)
}
