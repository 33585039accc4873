//! Where on a track effects may be hidden.

use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::Scene;

/// Spans from the ends of what is recorded in which nothing local is hidden.
const MARGIN_SPANS: f64 = 2.0;

/// Stretch and nominal values of a track for its hidden effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Site {
    /// Distance of the sleepers in m.
    pub(crate) spacing_m: f64,
    /// First and last sleeper at which something may be hidden: inside what is recorded by two spans or more.
    pub(crate) sleepers: [usize; 2],
    /// Mean stiffness of the railpads in N/m.
    pub(crate) railpad_n_m: f64,
}

impl Site {
    /// Of a typical track of the test rig.
    pub(crate) const RIG: Self = Self { spacing_m: 0.125, sleepers: [8, 30], railpad_n_m: 1.5e8 };

    /// Of a scene.
    pub(crate) fn of(scene: &Scene) -> Self {
        if scene.preset == Preset::VTrack {
            return Self::RIG;
        }
        let spacing_m = scene.spacing_m();
        let [from, to] = scene.recorded_m.map(|x_m| x_m / spacing_m);
        let first = (from + MARGIN_SPANS).ceil() as usize;
        let last = (to - MARGIN_SPANS).floor() as usize;
        let stiffness = scene.sleepers.iter().map(|sleeper| sleeper.railpad_stiffness_n_m);
        let railpad_n_m = stiffness.sum::<f64>() / scene.sleepers.len() as f64;
        // Sleeper `i` is at `i + 1` spacings.
        Self { spacing_m, sleepers: [first - 1, last - 1], railpad_n_m }
    }

    /// Places in m of the first and the last sleeper at which something may be hidden.
    pub(crate) fn range_m(&self) -> [f64; 2] {
        self.sleepers.map(|sleeper| (sleeper + 1) as f64 * self.spacing_m)
    }
}
