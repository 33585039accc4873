//! Saturation of a farm: a discrete-event simulation of workers that lease, compute and report to one
//! library. The service times are those measured with the benchmark `service_times`.
//!
//! `cargo run --release -p tracktwin-farm --example scaling -- [--lease-ms X] [--case-ms Y]`
//!
//! A lease costs the library `lease-ms`, and a stored case `case-ms`. The library processes them one after
//! another, because it has one writer. The results are in `docs/scaling.md`.

#![expect(clippy::print_stdout, reason = "an example shows its numbers")]

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Cores of a node.
const CORES: u64 = 16;

/// Number of cases that a core computes and reports together.
const GROUP: u64 = 8;

/// Minimum and maximum computing time of a lease, in s; longer with many cores, as in the coordinator.
const LEASE_WORK_S: [f64; 2] = [1.5, 30.0];
const LEASES_A_SECOND: f64 = 100.0;

/// Maximum number of groups of a lease.
const GROUPS_MAX: f64 = 64.0;

/// Time of a message and its response within a cluster, in s.
const ROUND_TRIP_S: f64 = 0.0005;

/// Maximum delay of reports, in ns, before a full outbox stops its cores.
const BACKLOG_NS: u64 = 3_000_000_000;

/// Simulated time in s. The start up to `WARM_UP_S` is not evaluated: in an overloaded farm, every core
/// must first have had a lease.
const TIME_S: f64 = 900.0;
const WARM_UP_S: f64 = 500.0;

/// Service times of the library, in s.
#[derive(Clone, Copy)]
struct Service {
    lease_s: f64,
    case_s: f64,
}

/// Next event of a core.
#[derive(Clone, Copy)]
enum Step {
    Lease,
    /// A group is computed; the number is that of the remaining groups of the lease.
    Report(u64),
}

/// Result of a simulation.
struct Outcome {
    cases_per_s: f64,
    cores_busy: f64,
    library_busy: f64,
}

/// Time in whole nanoseconds, which can be ordered.
const fn ns(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

fn simulate(cores: u64, case_s: f64, service: Service) -> Outcome {
    let [least_s, most_s] = LEASE_WORK_S;
    let work_s = (cores as f64 / LEASES_A_SECOND).clamp(least_s, most_s);
    let groups = (work_s / (case_s * GROUP as f64)).round().clamp(1.0, GROUPS_MAX) as u64;
    let group_ns = ns(case_s * GROUP as f64);
    // Cores start one after another over a second, as nodes do.
    let mut events: BinaryHeap<_> =
        (0..cores).map(|core| Reverse((ns(core as f64 / cores as f64), core))).collect();
    let mut steps = vec![Step::Lease; cores as usize];
    let (mut library_free, mut library_busy, mut cases) = (0, 0, 0);
    while let Some(Reverse((now, core))) = events.pop() {
        if now > ns(TIME_S) {
            break;
        }
        let counts = now > ns(WARM_UP_S);
        let step = steps[core as usize];
        let work = match step {
            Step::Lease => ns(service.lease_s),
            Step::Report(_) => ns(service.case_s * GROUP as f64),
        };
        // The library does one thing at a time, in order of arrival.
        library_free = now.max(library_free) + work;
        if counts {
            library_busy += work;
        }
        let (next, step) = match step {
            Step::Lease => (library_free + ns(ROUND_TRIP_S) + group_ns, Step::Report(groups)),
            Step::Report(left) => {
                if counts {
                    cases += GROUP;
                }
                // A core goes on computing while its report is under way, until the outbox is full.
                let goes_on = now.max(library_free.saturating_sub(BACKLOG_NS));
                match left {
                    1 => (goes_on, Step::Lease),
                    _ => (goes_on + group_ns, Step::Report(left - 1)),
                }
            }
        };
        steps[core as usize] = step;
        events.push(Reverse((next, core)));
    }
    let time_s = TIME_S - WARM_UP_S;
    let cases_per_s = cases as f64 / time_s;
    Outcome {
        cases_per_s,
        cores_busy: cases_per_s * case_s / cores as f64,
        library_busy: library_busy as f64 / 1e9 / time_s,
    }
}

fn argument(name: &str, usual: f64) -> f64 {
    let mut arguments = std::env::args().skip_while(|it| it != name).skip(1);
    arguments.next().map_or(usual, |text| text.parse().expect("a number of milliseconds"))
}

fn main() {
    let service = Service {
        lease_s: argument("--lease-ms", 0.4) / 1000.0,
        case_s: argument("--case-ms", 0.07) / 1000.0,
    };
    println!("| s a case | nodes of {CORES} cores | cases a second | cores busy | library busy |");
    println!("|---|---|---|---|---|");
    for case_s in [0.01, 0.1, 1.0] {
        for nodes in [1, 10, 100, 300, 1000, 3000] {
            let it = simulate(nodes * CORES, case_s, service);
            println!(
                "| {case_s} | {nodes} | {:.0} | {:.0} % | {:.0} % |",
                it.cases_per_s,
                100.0 * it.cores_busy,
                100.0 * it.library_busy.min(1.0)
            );
        }
    }
}
