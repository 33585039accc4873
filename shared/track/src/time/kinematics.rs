//! One degree of freedom under the average-acceleration rule.

/// Displacement, velocity and acceleration of one degree of freedom.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Kinematics {
    pub(super) displacement: f64,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
}

impl Kinematics {
    pub(super) fn at_rest(displacement: f64) -> Self {
        Self { displacement, ..Self::default() }
    }

    /// Updates the state to a new displacement under constant average acceleration.
    pub(super) fn advance(&mut self, displacement: f64, dt: f64) {
        let velocity = self.velocity_at(displacement, dt);
        self.acceleration = 2.0 / dt * (velocity - self.velocity) - self.acceleration;
        self.velocity = velocity;
        self.displacement = displacement;
    }

    /// The velocity after a step to a new displacement.
    pub(super) fn velocity_at(&self, displacement: f64, dt: f64) -> f64 {
        2.0 / dt * (displacement - self.displacement) - self.velocity
    }

    /// Force per unit mass from the previous state: `4 u / dt² + 4 v / dt + a`.
    pub(super) fn inertia(&self, dt: f64) -> f64 {
        4.0 / (dt * dt) * self.displacement + 4.0 / dt * self.velocity + self.acceleration
    }

    /// Force per unit damping from the previous state: `2 u / dt + v`.
    pub(super) fn resistance(&self, dt: f64) -> f64 {
        2.0 / dt * self.displacement + self.velocity
    }
}

/// A single degree of freedom with mass, damper and spring, on which one force acts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Single {
    mass: f64,
    damping: f64,
    motion: Kinematics,
    /// Displacement at the end of a step per unit force.
    pub(super) compliance: f64,
}

impl Single {
    /// A mass, damper and spring in a time step of `dt`, at rest at a displacement.
    pub(super) fn at_rest([m, c, k]: [f64; 3], displacement: f64, dt: f64) -> Self {
        let compliance = 1.0 / (4.0 * m / (dt * dt) + 2.0 * c / dt + k);
        Self { mass: m, damping: c, motion: Kinematics::at_rest(displacement), compliance }
    }

    /// Displacement at the end of the step under a constant force alone.
    pub(super) fn free(&self, constant_n: f64, dt: f64) -> f64 {
        let inertia = self.mass * self.motion.inertia(dt);
        let resistance = self.damping * self.motion.resistance(dt);
        self.compliance * (inertia + resistance + constant_n)
    }

    pub(super) fn advance(&mut self, displacement: f64, dt: f64) {
        self.motion.advance(displacement, dt);
    }

    pub(super) fn acceleration(&self) -> f64 {
        self.motion.acceleration
    }
}
