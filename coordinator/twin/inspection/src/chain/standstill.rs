//! The longest constant stretch of a pass.

/// A run of equal neighbouring samples.
pub(super) struct Standstill {
    /// Index of the first sample.
    pub(super) from: usize,
    /// Number of samples after the first.
    pub(super) samples: usize,
    /// Natural logarithm of the probability of a run of this length anywhere in the pass, from the steps of
    /// the recorder alone.
    pub(super) ln_p: f64,
}

impl Standstill {
    /// The longest run of a pass; the whole pass if the signal is constant.
    pub(super) fn longest(samples: &[f64]) -> Self {
        let equal = samples.windows(2).filter(|pair| pair[0] == pair[1]).count();
        let (mut run, mut longest, mut end) = (0, 0, 0);
        for (place, pair) in samples.windows(2).enumerate() {
            run = if pair[0] == pair[1] { run + 1 } else { 0 };
            if run > longest {
                (longest, end) = (run, place + 1);
            }
        }
        // Outside the run: how often two neighbours are alike by the recorder's steps.
        let share = (equal - longest + 1) as f64 / (samples.len() - longest) as f64;
        let ln_p = longest as f64 * share.ln() + (samples.len() as f64).ln();
        Self { from: end - longest, samples: longest, ln_p }
    }

    /// Whether no sample of the pass lies above the run (below it for a negative sign).
    pub(super) fn is_at_limit(&self, samples: &[f64], sign: f64) -> bool {
        let at = sign * samples[self.from];
        samples.iter().all(|sample| sign * sample <= at)
    }
}
