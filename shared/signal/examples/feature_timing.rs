//! Times the features of the three windows of a case.
//!
//! `cargo run --release -p tracktwin-signal --example feature_timing`

#[path = "support/noise.rs"]
mod noise;

use tracktwin_signal::{Extractor, FeatureDefinition};

/// Samples at 100 kHz of one spacing of 0.125 m at 13, 10 and 7 km/h.
const WINDOWS: [usize; 3] = [3462, 4500, 6429];

/// Samples of margin on either side, 0.06 s.
const MARGIN: usize = 6000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let extractor = Extractor::new(&FeatureDefinition::default())?;
    let signals: Vec<_> = WINDOWS.iter().map(|w| noise::axle_box(w + 2 * MARGIN)).collect();
    let mut total = 0.0;
    for (window, signal) in WINDOWS.iter().zip(&signals) {
        let range = MARGIN..MARGIN + window;
        let features = extractor.extract(signal, range.clone())?;
        let repeats = 200;
        let start = cpu_s();
        for _ in 0..repeats {
            assert_eq!(extractor.extract(signal, range.clone())?, features);
        }
        let milliseconds = (cpu_s() - start) * 1e3 / f64::from(repeats);
        total += milliseconds;
        println!("window of {window}: {milliseconds:.2} ms");
    }
    println!("a case: {total:.2} ms");
    Ok(())
}

/// CPU time of this thread in s. Other processes on the machine have little influence on this time.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|count| count.parse::<f64>().ok());
    nanoseconds.unwrap_or_default() * 1e-9
}
