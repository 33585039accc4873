//! Every row of the table in `docs/performance.md`, as tab-separated lines:
//! `cargo bench -p tracktwin-benches --bench table [-- WORD ...]` measures the rows whose name
//! holds one of the words, or all of them.

use faer::{Mat, MatRef};
use tracktwin_benches::{Cost, Track, axle_box, cases, cost, feature_vectors};
use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
use tracktwin_surrogate::{Factor, Hyperparameters, Selector, distances, distances_within};
use tracktwin_track::time::{Pass, pass, passes};

type Error = Box<dyn std::error::Error>;

/// Entries that models are trained on, half a library of the paper's size.
const ENTRIES: usize = 5000;
/// Bins of one speed.
const BINS: usize = 304;

/// One row: its name and what measures it.
type Row = (&'static str, fn() -> Result<Vec<Line>, Error>);

const ROWS: [Row; 6] = [
    ("time step", time_steps),
    ("case", case),
    ("transform", transforms),
    ("regression", regression),
    ("prediction", prediction),
    ("selector", selector),
];

/// A measured figure.
struct Line {
    name: String,
    cost: Cost,
    accuracy: String,
}

impl Line {
    fn new(name: &str, cost: Cost, accuracy: impl Into<String>) -> Self {
        Self { name: name.to_owned(), cost, accuracy: accuracy.into() }
    }
}

fn main() -> Result<(), Error> {
    // One core, as the peers have it.
    faer::set_global_parallelism(faer::Par::Seq);
    let words: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    println!("work\tleast CPU time in ms\tmedian in ms\taccuracy");
    for (name, row) in ROWS {
        if words.is_empty() || words.iter().any(|word| name.contains(word.as_str())) {
            for Line { name, cost, accuracy } in row()? {
                let [least, median] = [cost.least_s, cost.median_s].map(|s| s * 1e3);
                println!("{name}\t{least:.6}\t{median:.6}\t{accuracy}");
            }
        }
    }
    Ok(())
}

fn time_steps() -> Result<Vec<Line>, Error> {
    let mut lines = Vec::new();
    for (spans, rail_elements) in [(25, 8), (25, 4), (40, 8), (40, 4)] {
        let track = Track { spans, rail_elements, sleeper_elements: 8 };
        let (models, surfaces) = cases(track, 16);
        let way = track.pass(7.0);
        let of_plain = pass(&models[0], &way, &surfaces[0])?;
        let of_lanes = &passes(&models[..1], &way, &surfaces[..1])?[0];
        let difference = relative(&of_lanes.acceleration_m_s2, &of_plain.acceleration_m_s2);
        let steps = way.steps() * models.len();
        let fast = cost(|| passes(&models, &way, &surfaces)).of_each(steps);
        let name = format!("time step, {spans} spans of {rail_elements} elements");
        lines.push(Line::new(&name, fast, format!("{difference:.0e} off the plain solver")));
        if spans == 25 && rail_elements == 8 {
            let plain = cost(|| pass(&models[0], &way, &surfaces[0])).of_each(way.steps());
            lines.push(Line::new("time step of the plain solver", plain, "the reference"));
        }
    }
    Ok(lines)
}

/// Root mean square of the difference over that of the reference.
fn relative(values: &[f64], reference: &[f64]) -> f64 {
    let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let difference = power(&mut values.iter().zip(reference).map(|(a, b)| a - b));
    (difference / power(&mut reference.iter().copied())).sqrt()
}

/// What a worker does for a case of a campaign, in groups of eight: at every speed two spans of
/// run-in, the window and its margins, then the features.
fn case() -> Result<Vec<Line>, Error> {
    let track = Track { spans: 40, rail_elements: 4, sleeper_elements: 8 };
    let extractor = Extractor::new(&FeatureDefinition::default())?;
    let speeds_m_s = [7.0, 10.0, 13.0].map(|speed_km_h| speed_km_h / 3.6);
    let (spacing_m, margin_s) = (0.125, extractor.definition().margin_s);
    let way = |speed_m_s: f64| {
        let (window_m, margin_m) = (19.5 * spacing_m, margin_s * speed_m_s);
        let [start_m, end_m] =
            [window_m - margin_m - 2.0 * spacing_m, window_m + spacing_m + margin_m];
        Pass { speed_m_s, start_m, end_m, ..track.pass(1.0) }
    };
    let (models, surfaces) = cases(track, 8);
    let run = || speeds_m_s.map(|speed_m_s| passes(&models, &way(speed_m_s), &surfaces));
    let mut signals = Vec::new();
    for (records, speed_m_s) in run().into_iter().zip(speeds_m_s) {
        let step_m = speed_m_s * 1e-5;
        let [before, within] = [2.0 * spacing_m, spacing_m].map(|m| (m / step_m).ceil() as usize);
        for record in records? {
            let signal = Signal::new(1e5, record.acceleration_m_s2[before..].to_vec())?;
            signals.push((signal, 6000..6000 + within));
        }
    }
    let features =
        || signals.iter().map(|(signal, window)| extractor.extract(signal, window.clone())).last();
    let count = models.len();
    let how = "40 spans of 4 elements, 7, 10 and 13 km/h";
    Ok(vec![
        Line::new("case: tracks and surfaces", cost(|| cases(track, 8)).of_each(count), how),
        Line::new("case: passes", cost(run).of_each(count), how),
        Line::new("case: features", cost(features).of_each(count), how),
    ])
}

fn transforms() -> Result<Vec<Line>, Error> {
    let (window, margin) = (3485, 6000);
    let signal = axle_box(window + 2 * margin);
    let range = margin..margin + window;
    let every = FeatureDefinition { instant_rate_hz: 1e5, thinned: false, ..Default::default() };
    let literal = Extractor::new(&every)?.extract_literally(&signal, range.clone())?;
    let kinds = [
        ("transform, every instant", every.clone()),
        ("transform, low bins thinned", FeatureDefinition { thinned: true, ..every.clone() }),
        ("transform, every 4th instant", FeatureDefinition { instant_rate_hz: 25e3, ..every }),
        ("transform as features take it", FeatureDefinition::default()),
    ];
    kinds
        .into_iter()
        .map(|(name, definition)| {
            let extractor = Extractor::new(&definition)?;
            let features = extractor.extract(&signal, range.clone())?;
            let mut errors: Vec<f64> = (features.log_power.iter().zip(&literal.log_power))
                .map(|(a, b)| (a - b).abs())
                .collect();
            errors.sort_by(f64::total_cmp);
            let quantile = |share: usize| errors[errors.len() * share / 100];
            let [median, most] = [50, 95].map(quantile);
            let accuracy = format!("ln LWPS {median:.1e} in the median, 95 % below {most:.1e}");
            Ok(Line::new(name, cost(|| extractor.extract(&signal, range.clone())), accuracy))
        })
        .collect()
}

/// Inputs, targets and typical hyper-parameters.
fn training(columns: usize) -> (Mat<f64>, Mat<f64>, Hyperparameters) {
    let features = feature_vectors(ENTRIES, columns);
    let targets = Mat::from_fn(ENTRIES, 1, |i, _| features[(i, columns / 2)] * 0.1);
    let away = distances(features.subrows(0, 100), features.as_ref());
    let length = away.sum() / (100.0 * ENTRIES as f64);
    (features, targets, Hyperparameters { length, noise_ratio: 0.05 })
}

fn regression() -> Result<Vec<Line>, Error> {
    let (features, targets, at) = training(300);
    let (none, away) = (Mat::zeros(ENTRIES, 0), distances_within(features.as_ref()));
    let likelihood = || Factor::new(away.as_ref(), none.as_ref(), at);
    let both = || -> Result<Vec<[f64; 2]>, Error> {
        let factor = Factor::new(away.as_ref(), none.as_ref(), at)?;
        Ok(factor.gradients(away.as_ref(), &factor.weights(targets.as_ref())))
    };
    let exact = "closed form and derivatives: tests of the crate";
    Ok(vec![
        Line::new(
            "regression: distances, 5000 x 300",
            cost(|| distances_within(features.as_ref())),
            "1e-8 of a norm",
        ),
        Line::new("regression: covariance and Cholesky, 5000", cost(likelihood), exact),
        Line::new("regression: likelihood and gradient, 5000", cost(both), exact),
    ])
}

fn prediction() -> Result<Vec<Line>, Error> {
    let (features, _, at) = training(32);
    let none = Mat::zeros(ENTRIES, 0);
    let factor = Factor::new(distances_within(features.as_ref()).as_ref(), none.as_ref(), at)?;
    let observed = feature_vectors(100, 32);
    let of = |observed: MatRef<'_, f64>| {
        let away = distances(features.as_ref(), observed);
        factor.variances(away.as_ref(), Mat::zeros(observed.nrows(), 0).as_ref())
    };
    let exact = "exact, double precision";
    let hundred = cost(|| of(observed.as_ref())).of_each(100);
    Ok(vec![
        Line::new("prediction of one, a factor", cost(|| of(observed.subrows(0, 1))), exact),
        Line::new("prediction in a batch of 100, each, a factor", hundred, exact),
    ])
}

fn selector() -> Result<Vec<Line>, Error> {
    let library = feature_vectors(10_000, BINS);
    let rows: Vec<f64> =
        (0..10_000).flat_map(|i| (0..BINS).map(move |j| (i, j))).map(|at| library[at]).collect();
    let observed: Vec<f64> = rows[..BINS].iter().map(|x| x + 0.1).collect();
    let selector = Selector::new(rows, BINS)?;
    let each = cost(|| (0..100).map(|_| selector.nearest(&observed, 10)).last()).of_each(100);
    Ok(vec![Line::new("selector: ten of 10,000 x 304", each, "exact order")])
}
