//! Compares the quick features with the literal transform and with fewer instants.
//!
//! `cargo run --release -p tracktwin-signal --example feature_accuracy`

#[path = "support/noise.rs"]
mod noise;

use tracktwin_signal::{Extractor, FeatureDefinition};

/// Samples at 100 kHz of one spacing of 0.125 m at 13 km/h, and of the margin on either side.
const WINDOW: usize = 3462;
const MARGIN: usize = 6000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let every_sample =
        FeatureDefinition { instant_rate_hz: 1e5, thinned: false, ..Default::default() };
    let extractor = Extractor::new(&every_sample)?;
    let signal = noise::axle_box(WINDOW + 2 * MARGIN);
    let window = MARGIN..MARGIN + WINDOW;
    let literal = extractor.extract_literally(&signal, window.clone())?;
    let quick = extractor.extract(&signal, window.clone())?;
    println!("change of ln LWPS against the literal transform at every sample");
    report("quick, every sample", &literal.log_power, &quick.log_power);
    for divisor in [1.0, 2.0, 4.0, 8.0] {
        let definition =
            FeatureDefinition { instant_rate_hz: 1e5 / divisor, ..every_sample.clone() };
        let fewer = Extractor::new(&definition)?.extract(&signal, window.clone())?;
        report(&format!("quick, every {divisor}"), &literal.log_power, &fewer.log_power);
        let thinned = FeatureDefinition { thinned: true, ..definition };
        let thinned = Extractor::new(&thinned)?.extract(&signal, window.clone())?;
        report(&format!("quick, every {divisor}, thinned"), &literal.log_power, &thinned.log_power);
    }
    Ok(())
}

fn report(name: &str, a: &[f64], b: &[f64]) {
    let mut changes: Vec<_> = a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect();
    let worst = changes.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map(|(bin, _)| bin);
    changes.sort_by(f64::total_cmp);
    let median = changes[changes.len() / 2];
    let p95 = changes[changes.len() * 95 / 100];
    let largest = changes[changes.len() - 1];
    println!(
        "{name:24} median {median:.1e}  95 % {p95:.1e}  largest {largest:.1e} in bin {worst:?}"
    );
}
