//! What a lease and a case cost `SQLite`'s writer: the service times of `docs/scaling.md`.
//!
//! `cargo bench -p tracktwin-benches --bench service_times`
//!
//! Eight workers lease and report a batch at a time; told is the CPU time of the threads that speak with
//! the database. A lease and its report cost `a`, a case in them `b`: the time of n leases of m cases is
//! n a + n m b, fitted to the batches by least squares of the time a case.

use tracktwin_benches::{Failure, cpu_of_threads, fill, finish, sqlite_library};
use tracktwin_library::Library;

/// Cases of a lease, and how many are done with leases of that size.
const BATCHES: [(u32, u32); 4] = [(1, 4_000), (8, 16_000), (50, 40_000), (128, 40_000)];

/// Of the threads in which sqlx speaks with `SQLite`.
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

/// What the writer takes for so many cases, a batch at a time, in s.
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
