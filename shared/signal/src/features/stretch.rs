//! The stretch of a signal that the transform of a window uses.

use crate::Signal;
use std::{f64::consts::PI, ops::Range};

/// The part of a margin, at its far end, over which the signal fades out.
///
/// Without the fade the signal would end in a step, which has power at every frequency. A fade over the
/// last quarter affects only the lowest voices, and these have less than 8 % of their weight there.
const FADED_PART: f64 = 0.25;

/// A window and the real signal around it, without its mean, faded out at both ends; zero beyond.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) samples: Vec<f64>,
    /// The window among the samples.
    pub(super) window: Range<usize>,
}

impl Stretch {
    /// The window with up to `margin` samples on either side, as far as the signal goes.
    ///
    /// The function subtracts the mean, because the offset of an accelerometer would be a step at both
    /// ends.
    pub(super) fn new(signal: &Signal, window: &Range<usize>, margin: usize) -> Self {
        let start = window.start.saturating_sub(margin);
        let end = (window.end + margin).min(signal.len());
        let mut samples = signal.samples()[start..end].to_vec();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        for sample in &mut samples {
            *sample -= mean;
        }
        fade(samples[..window.start - start].iter_mut());
        fade(samples[window.end - start..].iter_mut().rev());
        Self { samples, window: window.start - start..window.end - start }
    }

    /// Writes the stretch onto a circle of zeros: the window from 0 on, and at most `margin`
    /// samples of either margin, the left one ending at the circle's end.
    pub(super) fn unroll(&self, margin: usize, circle: &mut [f64]) {
        let Range { start, end } = self.window;
        let from = start.saturating_sub(margin);
        let to = (end + margin).min(self.samples.len());
        circle[..to - start].copy_from_slice(&self.samples[start..to]);
        let before = circle.len() - (start - from);
        circle[before..].copy_from_slice(&self.samples[from..start]);
    }
}

/// Fades in over the first part of a margin: half a period of a cosine.
fn fade<'a>(margin: impl ExactSizeIterator<Item = &'a mut f64>) {
    let faded = FADED_PART * margin.len() as f64;
    for (place, sample) in margin.enumerate().take_while(|(place, _)| (*place as f64) < faded) {
        *sample *= 0.5 - 0.5 * (PI * (place as f64 + 0.5) / faded).cos();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_is_real_signal_as_far_as_there_is_any() {
        let signal = Signal::new(1e5, vec![1.0; 100]).unwrap();
        let stretch = Stretch::new(&signal, &(10..50), 20);
        assert_eq!(stretch.samples.len(), 70);
        assert_eq!(stretch.window, 10..50);
    }

    #[test]
    fn an_offset_leaves_nothing_and_the_window_is_not_faded() {
        let ramp: Vec<_> = (0..100).map(|n| f64::from(n) - 44.5).collect();
        let signal = Signal::new(1e5, ramp.iter().map(|x| x + 7.0).collect()).unwrap();
        let stretch = Stretch::new(&signal, &(30..60), 20);
        for (n, sample) in stretch.samples.iter().enumerate().take(65).skip(5) {
            assert!((sample - ramp[n + 10]).abs() < 1e-12);
        }
        assert!(stretch.samples[0].abs() < 0.03 * ramp[10].abs());
        assert!(stretch.samples[69].abs() < 0.03 * ramp[79].abs());
    }
}
