//! Irregularity that is usual on the track that a recording states.
//!
//! The passes show how far a defect or a line is above the surface around it. Its size in metres follows from
//! the size of that surface.

use std::f64::consts::TAU;
use tracktwin_parameters::Parameter;
use tracktwin_signal::recording::Recording;
use tracktwin_track::model::Roughness;

/// Distance between the ends of a uniform distribution, in standard deviations.
const UNIFORM_WIDTH: f64 = 3.464;

/// Surface of the usual irregularity level of a track (eq. B.6).
#[derive(Clone, Copy, Debug)]
pub(crate) struct UsualSurface {
    roughness: Roughness,
    /// Relative standard deviation of heights: half that of the level's logarithm over its usual range.
    pub height_deviation: f64,
}

impl UsualSurface {
    /// The usual surface of the track that a recording states.
    pub(crate) fn of(recording: &Recording) -> Self {
        let track = recording.stated_track().track;
        let [low, high] = track.ranges[Parameter::IrregularityLevel.index()];
        Self {
            roughness: Roughness::new(track.nominal[Parameter::IrregularityLevel]),
            height_deviation: 0.5 * (high / low).ln() / UNIFORM_WIDTH,
        }
    }

    /// One-sided spectral density in m3 at a wave number in cycles/m.
    pub(crate) fn density_m3(&self, wave_number: f64) -> f64 {
        TAU * self.roughness.density(TAU * wave_number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::Rolled;

    #[test]
    fn the_surface_of_a_line_is_smoother_than_that_of_v_track_and_less_known() {
        let recording = Rolled::faultless(1).recording();
        let on_line = Recording { spacing_m: 0.6, ..recording.clone() };
        let [rig, line] = [recording, on_line].map(|recording| UsualSurface::of(&recording));
        // Levels of 3 (1 to 5) and 0.15.
        assert!((rig.density_m3(100.0) / line.density_m3(100.0) - 20.0).abs() < 1e-9);
        assert!((rig.height_deviation - 0.232).abs() < 1e-3, "{rig:?}");
        assert!(line.height_deviation > 2.0 * rig.height_deviation, "{line:?}");
    }
}
