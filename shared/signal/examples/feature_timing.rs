//! Times the features of the three windows of a case and compares them with the literal transform.
//!
//! `cargo run --release -p tracktwin-signal --example feature_timing`

use std::time::Instant;
use tracktwin_signal::{Extractor, FeatureDefinition, Signal};

/// Samples at 100 kHz of one spacing of 0.125 m at 13, 10 and 7 km/h.
const WINDOWS: [usize; 3] = [3462, 4500, 6429];

/// Samples of margin on either side, 0.06 s.
const MARGIN: usize = 6000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let extractor = Extractor::new(&FeatureDefinition::default())?;
    let signals: Vec<_> = WINDOWS.iter().map(|w| noise(w + 2 * MARGIN)).collect();
    let mut total = 0.0;
    for (window, signal) in WINDOWS.iter().zip(&signals) {
        let range = MARGIN..MARGIN + window;
        let features = extractor.extract(signal, range.clone())?;
        let repeats = 200;
        let start = Instant::now();
        for _ in 0..repeats {
            assert_eq!(extractor.extract(signal, range.clone())?, features);
        }
        let milliseconds = start.elapsed().as_secs_f64() * 1e3 / f64::from(repeats);
        total += milliseconds;
        println!("window of {window}: {milliseconds:.2} ms");
    }
    println!("a case: {total:.2} ms");
    Ok(())
}

/// A resonance at 115 Hz and another at 900 Hz under white noise, about as an axle box sounds.
fn noise(samples: usize) -> Signal {
    let mut state = 1_u64;
    let mut resonators =
        [(115.0, 0.02), (900.0, 0.1)].map(|(hz, damping)| Resonator::new(hz, damping));
    let sample = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let white = (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        white * 0.3 + resonators.iter_mut().map(|r| r.next(white)).sum::<f64>()
    };
    Signal::new(1e5, std::iter::repeat_with(sample).take(samples).collect()).expect("finite")
}

/// Two poles.
struct Resonator {
    feedback: [f64; 2],
    past: [f64; 2],
}

impl Resonator {
    fn new(frequency_hz: f64, damping: f64) -> Self {
        let angle = std::f64::consts::TAU * frequency_hz / 1e5;
        let radius = (-damping * angle).exp();
        Self { feedback: [2.0 * radius * angle.cos(), -radius * radius], past: [0.0; 2] }
    }

    fn next(&mut self, input: f64) -> f64 {
        let [a, b] = self.feedback;
        let output = input * 0.02 + a * self.past[0] + b * self.past[1];
        self.past = [output, self.past[0]];
        output
    }
}
