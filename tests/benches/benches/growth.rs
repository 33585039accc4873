//! Growth of costs with size, as figures: `cargo bench -p tracktwin-benches --bench growth` writes them to
//! `docs/figures`.

use faer::Mat;
use std::path::Path;
use tracktwin_benches::{Curve, Track, cases, cost, feature_vectors, figure};
use tracktwin_surrogate::{Factor, Hyperparameters, Selector, distances_within};
use tracktwin_track::time::passes;

type Error = Box<dyn std::error::Error>;

/// Number of microseconds and of milliseconds in a second.
const US: f64 = 1e6;
const MS: f64 = 1e3;

fn main() -> Result<(), Error> {
    faer::set_global_parallelism(faer::Par::Seq);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/figures");
    std::fs::create_dir_all(&folder)?;
    let save = |name: &str, title: &str, x: &str, y: &str, curves: &[Curve]| {
        for Curve { name, points } in curves {
            println!("{title}, {name}: {points:.4?}");
        }
        std::fs::write(folder.join(name), figure(title, x, y, curves))
    };
    let step = "us a step and case";
    save("spans.svg", "A time step by spans", "spans", step, &[by_spans(4), by_spans(8)])?;
    save(
        "elements.svg",
        "A time step by rail elements",
        "elements a span",
        step,
        &[by_elements()],
    )?;
    save("cases.svg", "A time step by cases at once", "cases", step, &[by_cases()])?;
    save("library.svg", "Ten nearest by library size", "entries", "ms", &[by_library()?])?;
    save(
        "regression.svg",
        "A covariance and its factor by entries",
        "entries",
        "ms",
        &[by_entries()?],
    )?;
    Ok(())
}

fn step_us(track: Track, count: u32) -> f64 {
    let (models, surfaces) = cases(track, count);
    let way = track.pass(3.0);
    let steps = way.steps() * models.len();
    cost(|| passes(&models, &way, &surfaces)).of_each(steps).least_s * US
}

fn by_spans(rail_elements: usize) -> Curve {
    let point =
        |spans| (spans as f64, step_us(Track { spans, rail_elements, sleeper_elements: 8 }, 8));
    let points = [10, 20, 40, 80, 160].map(point).to_vec();
    Curve { name: format!("{rail_elements} elements a span"), points }
}

fn by_elements() -> Curve {
    let point = |rail_elements| {
        let track = Track { spans: 25, rail_elements, sleeper_elements: 8 };
        (rail_elements as f64, step_us(track, 8))
    };
    Curve { name: "25 spans".to_owned(), points: [1, 2, 4, 8, 16, 32].map(point).to_vec() }
}

fn by_cases() -> Curve {
    let track = Track { spans: 40, rail_elements: 4, sleeper_elements: 8 };
    let point = |count: u32| (f64::from(count), step_us(track, count));
    Curve { name: "40 spans".to_owned(), points: [1, 2, 4, 8, 16, 32].map(point).to_vec() }
}

fn by_library() -> Result<Curve, Error> {
    let point = |entries: usize| -> Result<(f64, f64), Error> {
        let library = feature_vectors(entries, 304);
        let rows: Vec<f64> = (0..entries)
            .flat_map(|i| (0..304).map(move |j| (i, j)))
            .map(|at| library[at])
            .collect();
        let observed: Vec<f64> = rows[..304].iter().map(|x| x + 0.1).collect();
        let selector = Selector::new(rows, 304)?;
        let each = cost(|| (0..20).map(|_| selector.nearest(&observed, 10)).collect::<Vec<_>>())
            .of_each(20);
        Ok((entries as f64, each.least_s * MS))
    };
    let points = [1000, 3000, 10_000, 30_000].into_iter().map(point).collect::<Result<_, _>>()?;
    Ok(Curve { name: "304 bins".to_owned(), points })
}

fn by_entries() -> Result<Curve, Error> {
    let point = |entries: usize| -> Result<(f64, f64), Error> {
        let away = distances_within(feature_vectors(entries, 32).as_ref());
        let (none, at) =
            (Mat::zeros(entries, 0), Hyperparameters { length: 10.0, noise_ratio: 0.05 });
        let factorised = || Factor::new(away.as_ref(), none.as_ref(), at);
        Ok((entries as f64, cost(factorised).least_s * MS))
    };
    let points = [500, 1000, 2000, 4000].into_iter().map(point).collect::<Result<_, _>>()?;
    Ok(Curve { name: "one core".to_owned(), points })
}
