//! The stretch of track that belongs to a sleeper.

use std::ops::Range;

/// Least part of a sleeper's window that a pass must cover to say something about the sleeper.
///
/// The sleepers at a recording's two ends have half a window, give or take the odometer's drift.
const SHARE_MIN: f64 = 0.4;

/// A sleeper's window: the track within half a spacing of it (paper, section 2.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SleeperWindow {
    /// Where it begins along the track in m.
    pub from_m: f64,
    /// Where it ends in m.
    pub to_m: f64,
    spacing_m: f64,
}

impl SleeperWindow {
    /// The window of a sleeper at `x_m` in m, on a track with this sleeper spacing in m.
    pub fn around(x_m: f64, spacing_m: f64) -> Self {
        Self { from_m: x_m - 0.5 * spacing_m, to_m: x_m + 0.5 * spacing_m, spacing_m }
    }

    /// The samples, by their positions in m, at which the wheel is inside; positions do not decrease.
    ///
    /// None where the positions cover less than two fifths of the window.
    pub fn samples(&self, position_m: &[f64]) -> Option<Range<usize>> {
        if self.share(position_m) < SHARE_MIN {
            return None;
        }
        let start = position_m.partition_point(|&position| position < self.from_m);
        let end = position_m.partition_point(|&position| position <= self.to_m);
        (start < end).then_some(start..end)
    }

    /// Which part of the window the positions in m cover, 0 to 1.
    pub fn share(&self, position_m: &[f64]) -> f64 {
        let (Some(first), Some(last)) = (position_m.first(), position_m.last()) else { return 0.0 };
        let covered = self.to_m.min(*last) - self.from_m.max(*first);
        (covered / self.spacing_m).clamp(0.0, 1.0)
    }
}
