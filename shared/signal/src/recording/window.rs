//! The stretch of track that belongs to a sleeper.

use std::ops::Range;

/// Smallest share of the window of a sleeper that a pass must cover to be evaluated for this sleeper.
///
/// The first and last sleeper of a recording have about half a window; odometer drift changes this share
/// slightly.
const SHARE_MIN: f64 = 0.4;

/// A sleeper's window: the track within half a spacing of it (paper, section 2.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SleeperWindow {
    /// Start of the window along the track in m.
    pub from_m: f64,
    /// End of the window along the track in m.
    pub to_m: f64,
    spacing_m: f64,
}

impl SleeperWindow {
    /// The window of a sleeper at `x_m` in m, on a track with this sleeper spacing in m.
    pub fn around(x_m: f64, spacing_m: f64) -> Self {
        Self { from_m: x_m - 0.5 * spacing_m, to_m: x_m + 0.5 * spacing_m, spacing_m }
    }

    /// Range of the samples at which the wheel is inside the window. `position_m` has one position in m
    /// per sample and must not decrease.
    ///
    /// `None` if the positions cover less than two fifths of the window.
    pub fn samples(&self, position_m: &[f64]) -> Option<Range<usize>> {
        if self.share(position_m) < SHARE_MIN {
            return None;
        }
        let start = position_m.partition_point(|&position| position < self.from_m);
        let end = position_m.partition_point(|&position| position <= self.to_m);
        (start < end).then_some(start..end)
    }

    /// Share of the window that the positions in m cover, 0 to 1.
    pub fn share(&self, position_m: &[f64]) -> f64 {
        let (Some(first), Some(last)) = (position_m.first(), position_m.last()) else { return 0.0 };
        let covered = self.to_m.min(*last) - self.from_m.max(*first);
        (covered / self.spacing_m).clamp(0.0, 1.0)
    }
}
