//! A signal similar to an axle-box acceleration, from a fixed seed.

use tracktwin_signal::Signal;

/// Two resonances, at 115 Hz and 900 Hz, excited by white noise: similar to an axle-box acceleration.
pub(crate) fn axle_box(samples: usize) -> Signal {
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
