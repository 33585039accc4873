//! Ballast under a gap, from which a sleeper can lift off.

/// Depth in m over which the damping of closing ballast sets in, so that it begins without a jump.
const ONSET_M: f64 = 1e-6;

/// Ballast that a sleeper touches where it is pressed further down than the gap.
#[derive(Clone, Debug)]
pub(crate) struct Gap {
    /// Gap below the sleeper in m.
    pub(super) depth_m: f64,
    /// Stiffness in N/m and damping in N s/m of all ballast below the half sleeper.
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    /// What presses the ballast at each of Gauss's points by degree of freedom, and the points' shares
    /// of the length.
    pub(super) along: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
}

impl Gap {
    /// Generalised forces on the modes in a state of the sleeper, added to `forces`.
    pub(crate) fn push(&self, state: &[f64], forces: &mut [f64]) {
        let modes = state.len() / 2;
        for (shape, weight) in self.along.iter().zip(&self.weights) {
            let value = |part: &[f64]| shape.iter().zip(part).map(|(a, b)| a * b).sum::<f64>();
            let pressed_m = value(&state[..modes]) - self.depth_m;
            if pressed_m <= 0.0 {
                continue;
            }
            let onset = (pressed_m / ONSET_M).min(1.0);
            let damper = onset * self.damping * value(&state[modes..]);
            let pressure = (self.stiffness * pressed_m + damper).max(0.0);
            for (force, shape) in forces.iter_mut().zip(shape) {
                *force -= weight * pressure * shape;
            }
        }
    }
}
