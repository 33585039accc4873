//! State of the vehicle during a pass: wheels and their oscillators.

use super::kinematics::Single;
use crate::model::{ContactOscillator, Vehicle};

/// A wheel, and the oscillators that its contact force drives.
pub(super) struct Rolling {
    /// Distance of the wheel ahead of the first wheel in m.
    pub(super) ahead_m: f64,
    load_n: f64,
    wheel: Single,
    oscillators: Vec<(ContactOscillator, Single)>,
    /// Displacements of wheel and oscillators at the end of the step without contact force.
    free: Vec<f64>,
}

impl Rolling {
    /// All wheels of a vehicle, at rest with their contact points at the given displacements.
    pub(super) fn at_rest(vehicle: &Vehicle, contacts_m: &[f64], dt: f64) -> Vec<Self> {
        let ahead = [0.0].into_iter().chain(vehicle.further_wheels_m.iter().copied());
        let oscillators = |first: bool| if first { &vehicle.oscillators[..] } else { &[] };
        ahead
            .zip(contacts_m)
            .enumerate()
            .map(|(index, (ahead_m, &contact_m))| {
                Self::new(vehicle, oscillators(index == 0), ahead_m, contact_m, dt)
            })
            .collect()
    }

    fn new(
        vehicle: &Vehicle,
        oscillators: &[ContactOscillator],
        ahead_m: f64,
        contact_m: f64,
        dt: f64,
    ) -> Self {
        let load_n = vehicle.wheel.load_n;
        let at_rest = |part: &ContactOscillator| {
            let coefficients = [part.mass_kg, part.damping_n_s_m, part.stiffness_n_m];
            (*part, Single::at_rest(coefficients, load_n / part.stiffness_n_m, dt))
        };
        let given: f64 = oscillators.iter().map(|part| load_n / part.stiffness_n_m).sum();
        let wheel = Single::at_rest([vehicle.wheel.mass_kg, 0.0, 0.0], contact_m + given, dt);
        let oscillators: Vec<_> = oscillators.iter().map(at_rest).collect();
        let free = vec![0.0; 1 + oscillators.len()];
        Self { ahead_m, load_n, wheel, oscillators, free }
    }

    /// Displacement of the contact point in one step per unit contact force, in m/N.
    pub(super) fn compliance(&self) -> f64 {
        let oscillators = self.oscillators.iter().map(|(_, state)| state.compliance);
        self.wheel.compliance + oscillators.sum::<f64>()
    }

    /// Displacement of the contact point in m at the end of the step without contact force.
    pub(super) fn lift_off(&mut self, dt: f64) -> f64 {
        self.free[0] = self.wheel.free(self.load_n, dt);
        for (free, (_, state)) in self.free[1..].iter_mut().zip(&self.oscillators) {
            *free = state.free(0.0, dt);
        }
        self.free[0] - self.free[1..].iter().sum::<f64>()
    }

    /// Completes the step that [`Rolling::lift_off`] started, with the contact force in N.
    pub(super) fn advance(&mut self, force_n: f64, dt: f64) {
        self.wheel.advance(self.free[0] - force_n * self.wheel.compliance, dt);
        for (free, (_, state)) in self.free[1..].iter().zip(&mut self.oscillators) {
            state.advance(free + force_n * state.compliance, dt);
        }
    }

    /// Acceleration at the sensor in m/s2.
    pub(super) fn acceleration(&self) -> f64 {
        let parts = self.oscillators.iter().map(|(part, state)| part.sensed * state.acceleration());
        self.wheel.acceleration() + parts.sum::<f64>()
    }
}
