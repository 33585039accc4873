//! Integration in time: the generalised-alpha scheme in accelerations.
//!
//! This module contains the weights and the kinematic relations. Rail, bodies and vehicle contain the
//! equations of motion.
//!
//! Source: Chung and Hulbert, J. Appl. Mech. 60 (1993) 371-375.

/// Time step in s; one sample of the recording.
pub(crate) const STEP_S: f64 = 1e-5;

/// Spectral radius at infinite frequency: what lies far above 20 kHz dies out, 4 kHz loses nothing.
const RADIUS: f64 = 0.8;
const ALPHA_M: f64 = (2.0 * RADIUS - 1.0) / (RADIUS + 1.0);
const ALPHA_F: f64 = RADIUS / (RADIUS + 1.0);
const GAMMA: f64 = 0.5 - ALPHA_M + ALPHA_F;
const BETA: f64 = 0.25 * (1.0 - ALPHA_M + ALPHA_F) * (1.0 - ALPHA_M + ALPHA_F);

/// Displacement at the end of a step per acceleration there, in s2.
pub(crate) const REACH: f64 = BETA * STEP_S * STEP_S;
/// Share of a force at the end of a step; the rest is the force at its begin.
pub(crate) const NEW: f64 = 1.0 - ALPHA_F;

/// Weights of mass, damping and stiffness in the matrix of a system.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    pub(crate) mass: f64,
    pub(crate) damping: f64,
    pub(crate) stiffness: f64,
}

impl Weights {
    /// Of a time step: the matrix multiplies accelerations.
    pub(crate) const STEP: Self =
        Self { mass: 1.0 - ALPHA_M, damping: NEW * GAMMA * STEP_S, stiffness: NEW * REACH };
    /// At rest: the matrix multiplies displacements.
    pub(crate) const REST: Self = Self { mass: 0.0, damping: 0.0, stiffness: 1.0 };
}

/// Displacements, velocities and accelerations of a system.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) displacement: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
}

impl Motion {
    /// Nothing moves.
    pub(crate) fn rest(size: usize) -> Self {
        let zero = vec![0.0; size];
        Self { displacement: zero.clone(), velocity: zero.clone(), acceleration: zero }
    }

    /// Displacement that stiffness sees, but for the new acceleration.
    pub(crate) fn known_displacement(&self, i: usize) -> f64 {
        let drift = self.velocity[i] + STEP_S * (0.5 - BETA) * self.acceleration[i];
        self.displacement[i] + NEW * STEP_S * drift
    }

    /// Velocity that damping sees, but for the new acceleration.
    pub(crate) fn known_velocity(&self, i: usize) -> f64 {
        self.velocity[i] + NEW * STEP_S * (1.0 - GAMMA) * self.acceleration[i]
    }

    /// Inertia that counts already, per mass.
    pub(crate) fn known_acceleration(&self, i: usize) -> f64 {
        ALPHA_M * self.acceleration[i]
    }

    /// Displacement at the end of the step, but for the new acceleration.
    pub(crate) fn predicted(&self, i: usize) -> f64 {
        let drift = self.velocity[i] + STEP_S * (0.5 - BETA) * self.acceleration[i];
        self.displacement[i] + STEP_S * drift
    }

    /// Displacement and velocity at the end of the step with the old acceleration.
    pub(crate) fn extrapolated(&self, i: usize) -> [f64; 2] {
        let (velocity, acceleration) = (self.velocity[i], self.acceleration[i]);
        let displacement = self.displacement[i] + STEP_S * (velocity + 0.5 * STEP_S * acceleration);
        [displacement, velocity + STEP_S * acceleration]
    }

    /// Ends the step with the new acceleration.
    pub(crate) fn advance(&mut self, i: usize, acceleration: f64) {
        self.displacement[i] = self.predicted(i) + REACH * acceleration;
        self.velocity[i] += STEP_S * ((1.0 - GAMMA) * self.acceleration[i] + GAMMA * acceleration);
        self.acceleration[i] = acceleration;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_of_4_khz_keeps_its_frequency_and_its_amplitude() {
        let stiffness = (std::f64::consts::TAU * 4000.0).powi(2);
        let matrix = Weights::STEP.mass + Weights::STEP.stiffness * stiffness;
        let mut motion = Motion::rest(1);
        motion.displacement[0] = 1.0;
        motion.acceleration[0] = -stiffness;
        let (mut crossings, mut peak) = (0, 0.0_f64);
        for step in 0..10_000 {
            let known = stiffness * motion.known_displacement(0) + motion.known_acceleration(0);
            let before = motion.displacement[0];
            motion.advance(0, -known / matrix);
            crossings += usize::from(before < 0.0 && motion.displacement[0] >= 0.0);
            if step > 9000 {
                peak = peak.max(motion.displacement[0]);
            }
        }
        // 0.1 s.
        assert!((crossings as f64 / 400.0 - 1.0).abs() < 0.012, "{crossings}");
        assert!(peak > 0.1, "{peak}");
    }
}
