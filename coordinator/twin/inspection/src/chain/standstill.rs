//! The longest constant stretch of a pass.

/// Neighbouring equal samples.
pub(super) struct Standstill {
    /// The first of them.
    pub(super) from: usize,
    /// How many follow it.
    pub(super) samples: usize,
    /// Probability of as long a stretch anywhere in the pass by the recorder's steps alone, in
    /// logarithm.
    pub(super) ln_p: f64,
}

impl Standstill {
    /// The longest of a pass; of a signal that doesn't change, all of it.
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

    /// Whether no sample of the pass lies above it, or below it with a negative sign.
    pub(super) fn is_at_limit(&self, samples: &[f64], sign: f64) -> bool {
        let at = sign * samples[self.from];
        samples.iter().all(|sample| sign * sample <= at)
    }
}
