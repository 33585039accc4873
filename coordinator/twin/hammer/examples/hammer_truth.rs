//! Hammer tests of the reference simulator, evaluated: errors and coverage; see
//! `docs/how-to/evaluate-a-hammer-test.md`.
//!
//! `cargo run --release -p tracktwin-hammer --example hammer_truth -- TRACKS`

#![expect(clippy::unwrap_used, reason = "in a measurement a panic is the report")]
#![expect(clippy::print_stdout, reason = "the table is the result")]

#[path = "../tests/truth/scene.rs"]
mod scene;

use scene::{STRUCK, scene, seat_m, strike};
use std::time::Instant;
use tracktwin_hammer::{HammerRecord, Selection, fit, select};
use tracktwin_parameters::{Parameter, Preset};
use tracktwin_reference_simulator::SleeperTruth;

/// Seeds of the tracks begin here.
const SEED: u64 = 100;

/// A quantity and its true value.
type Truth = (Parameter, fn(&SleeperTruth) -> f64);

const COMPARED: [Truth; 3] = [
    (Parameter::RailpadStiffness, |it| it.railpad_stiffness_n_m),
    (Parameter::BallastStiffness, |it| it.ballast_stiffness_n_m),
    (Parameter::SleeperBendingStiffness, |it| it.sleeper_ei_n_m2),
];

/// Logarithms of an estimate and of its truth, and whether the 90 % interval holds the truth.
struct Pair {
    estimate: f64,
    truth: f64,
    is_inside: bool,
    width: f64,
}

fn main() {
    let tracks: u64 = std::env::args().nth(1).map_or(4, |text| text.parse().unwrap());
    println!(
        "| scatter | parameter | sleepers | median of the absolute error of the logarithm | mean error | truths inside the 90 % interval | correlation along the track | median width of the interval |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let started = Instant::now();
    for scatter in [0.05, 0.15, 0.3] {
        let mut pairs: [Vec<Pair>; 3] = Default::default();
        let mut correlations: [Vec<f64>; 3] = Default::default();
        for track in 0..tracks {
            for (index, found) in evaluate(SEED + track, scatter).into_iter().enumerate() {
                correlations[index].push(correlation(&found));
                pairs[index].extend(found);
            }
        }
        for (index, (parameter, _)) in COMPARED.iter().enumerate() {
            let all = &pairs[index];
            let count = all.len() as f64;
            let errors = all.iter().map(|it| (it.estimate - it.truth).abs());
            let bias = all.iter().map(|it| it.estimate - it.truth).sum::<f64>() / count;
            let inside = all.iter().filter(|it| it.is_inside).count() as f64 / count;
            println!(
                "| {:.0} % | {} | {} | {:.3} | {bias:+.3} | {:.0} % | {:.2} | {:.3} |",
                100.0 * scatter,
                parameter.label(),
                all.len(),
                median(errors),
                100.0 * inside,
                median(correlations[index].iter().copied()),
                median(all.iter().map(|it| it.width))
            );
        }
    }
    println!("\n{:.0} s", started.elapsed().as_secs_f64());
}

fn evaluate(seed: u64, scatter: f64) -> [Vec<Pair>; 3] {
    let scene = scene(seed, scatter);
    let track = Preset::VTrack.track();
    let selection = Selection::usual(&track.design);
    let points = select(&strike(&scene), &selection).points;
    let fitted = fit(&track, 0.0, &points).unwrap();
    let name = |number: i64, _| format!("SN{number}");
    let record = HammerRecord::new(&fitted, &track.name, selection.range_hz, points.len(), name);
    COMPARED.map(|(parameter, truth)| {
        let pair = |sleeper: usize| {
            let here = record.sleepers.iter().find(|it| (it.x_m - seat_m(sleeper)).abs() < 0.01);
            let found = here.unwrap().estimates[&parameter];
            let truth = truth(&scene.sleepers[sleeper]);
            Pair {
                estimate: found.estimate.ln(),
                truth: truth.ln(),
                is_inside: (found.lower..=found.upper).contains(&truth),
                width: (found.upper / found.lower).ln(),
            }
        };
        STRUCK.map(pair).collect()
    })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn correlation(pairs: &[Pair]) -> f64 {
    let count = pairs.len() as f64;
    let mean = |of: fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (estimate, truth) = (mean(|it| it.estimate), mean(|it| it.truth));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        pairs.iter().map(|it| of(it.estimate - estimate, it.truth - truth)).sum()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}
