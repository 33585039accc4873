//! Costs of the queue during a campaign: durable leases, results of 12 kB, opening, and status.
//!
//! `cargo bench -p tracktwin-benches --bench queue -- [sqlite|postgres] [--cases N] [--batch N]`
//!
//! Eight workers lease and report a batch (50) at a time. The measurement stops at a thousand finished
//! cases, at three thousand, and so on up to 90 % of N (100,000). The cost of a lease at each stop is drawn
//! in `docs/figures/leases.svg`. Libraries are created in `$TRACKTWIN_BENCH_DIR`, or in the current folder;
//! N cases need 15 kB each.

use std::path::Path;
use std::time::Instant;
use test_postgres::{Server, Settings};
use tracktwin_benches::{CAMPAIGN, Curve, Failure, figure, fill, finish, lease, sqlite_library};
use tracktwin_library::{Held, Library};

/// Number of successive single-case leases over which the mean is taken.
const LEASES: u32 = 200;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|it| it != "--bench").collect();
    let number = |name: &str, otherwise: u32| {
        let text = arguments.iter().skip_while(|it| *it != name).nth(1);
        text.map_or(Ok(otherwise), |text| text.parse())
    };
    let (cases, batch) = (number("--cases", 100_000)?, number("--batch", 50)?);
    let wanted = |engine| {
        !arguments.iter().any(|it| it == "sqlite" || it == "postgres")
            || arguments.iter().any(|it| it == engine)
    };
    let mut curves = Vec::new();
    if wanted("sqlite") {
        let (_folder, url) = sqlite_library()?;
        curves.push(measure("SQLite, synchronous=FULL", &url, cases, batch).await?);
    }
    if wanted("postgres")
        && let Some(server) = Server::start(Settings { durable: true })
    {
        curves.push(measure("PostgreSQL, fsync", &server.database(), cases, batch).await?);
    }
    let figures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/figures");
    let drawn = figure("A lease by finished cases", "finished cases", "ms", &curves);
    std::fs::write(figures.join("leases.svg"), drawn)?;
    Ok(())
}

/// Processes most of a campaign, with stops for measurements.
async fn measure(name: &str, url: &str, cases: u32, batch: u32) -> Result<Curve, Failure> {
    let mut library = Library::open_or_create(url).await?;
    let begin = Instant::now();
    fill(&library, cases).await?;
    println!("{name}: {cases} cases stored in {:.1} s", begin.elapsed().as_secs_f64());
    println!("| finished | cases a second since | open in ms | status in ms | a lease in ms |");
    println!("|---|---|---|---|---|");
    let mut points = Vec::new();
    let mut finished = 0;
    for stop in (3..).flat_map(|decade| [10_u32.pow(decade), 3 * 10_u32.pow(decade)]) {
        let stop = stop.min(cases / 10 * 9);
        let begin = Instant::now();
        finish(&library, stop - finished, batch).await?;
        let rate = f64::from(stop - finished) / begin.elapsed().as_secs_f64();
        finished = stop;

        library.close().await;
        let begin = Instant::now();
        library = Library::open(url).await?;
        let open_ms = ms(begin);
        let begin = Instant::now();
        library.overview().await?;
        let status_ms = ms(begin);
        let lease_ms = leases(&library).await?;
        println!("| {finished} | {rate:.0} | {open_ms:.1} | {status_ms:.1} | {lease_ms:.2} |");
        points.push((f64::from(finished), lease_ms));
        if finished == cases / 10 * 9 {
            break;
        }
    }
    library.close().await;
    Ok(Curve { name: name.to_owned(), points })
}

fn ms(begin: Instant) -> f64 {
    1e3 * begin.elapsed().as_secs_f64()
}

/// Mean time of a lease of one case in ms, over successive leases. The cases are released afterwards.
async fn leases(library: &Library) -> Result<f64, Failure> {
    let mut held = Vec::new();
    let begin = Instant::now();
    for _ in 0..LEASES {
        held.extend(lease(library, "one by one", 1).await?);
    }
    let each_ms = ms(begin) / f64::from(LEASES);
    let held = held.iter().map(|it| Held { index: it.case.index, epoch: it.epoch }).collect();
    library.release(CAMPAIGN, "one by one", held).await?;
    Ok(each_ms)
}
