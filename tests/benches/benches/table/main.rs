//! Measures the rows of the table in `docs/performance.md` and prints them as tab-separated lines. `cargo
//! bench -p tracktwin-benches --bench table [-- WORD ...]` measures the rows whose name contains one of the
//! words; without words, all rows.

mod evaluation;
mod regression;
mod solver;
mod transform;

use tracktwin_benches::Cost;

type Error = Box<dyn std::error::Error>;

/// Number of training entries: half of a library of the paper's size.
const ENTRIES: usize = 5000;

/// A row: its name, and the function that measures it.
type Row = (&'static str, fn() -> Result<Vec<Line>, Error>);

const ROWS: [Row; 8] = [
    ("time step", solver::time_steps),
    ("case", solver::case),
    ("transform", transform::transforms),
    ("regression", regression::likelihood),
    ("training", regression::training),
    ("prediction", evaluation::predictions),
    ("selector", evaluation::selector),
    ("lap", evaluation::lap),
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
