//! The vehicle on the track, and the acceleration that its sensor measures.

use rustfft::num_complex::Complex64;
use tracktwin_parameters::Wheel;

/// A wheel, whatever moves with it, and further wheels on the same rail.
///
/// Springs connect some parts to the wheel. Some parts of the rail deform under the contact at every place.
/// The model separates the motion of these parts into two: the motion of the wheel as a whole, and
/// oscillators that the contact force drives. These motions are not coupled to anything else. The approach of
/// the contact is `u_wheel - q_1 - q_2 ... - u_rail - z`.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// Mass and load of the wheel with all that it carries.
    pub wheel: Wheel,
    /// What gives way beside the wheel's mass.
    pub oscillators: Vec<ContactOscillator>,
    /// Places of further wheels of the same kind, in m ahead of the first.
    pub further_wheels_m: Vec<f64>,
}

/// An oscillator driven by the contact force: `m q'' + c q' + k q = F`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactOscillator {
    /// Mass `m` in kg.
    pub mass_kg: f64,
    /// Damping `c` in N s/m.
    pub damping_n_s_m: f64,
    /// Stiffness `k` in N/m.
    pub stiffness_n_m: f64,
    /// How much of `q` the sensor feels, beside the motion of the vehicle's centre of mass;
    /// positive downwards.
    pub sensed: f64,
}

impl ContactOscillator {
    /// Displacement per unit contact force in m/N at an angular frequency in rad/s.
    pub fn receptance(&self, omega: f64) -> Complex64 {
        let elastic = self.stiffness_n_m - self.mass_kg * omega * omega;
        Complex64::new(elastic, omega * self.damping_n_s_m).inv()
    }
}

impl Vehicle {
    /// A rigid wheel and the design's further ones.
    pub(super) fn rigid(wheel: &Wheel) -> Self {
        let further_wheels_m = wheel.further_wheels_m.clone();
        Self { wheel: wheel.clone(), oscillators: Vec::new(), further_wheels_m }
    }

    /// Whether it is one rigid wheel and nothing else.
    pub fn is_rigid_wheel(&self) -> bool {
        self.oscillators.is_empty() && self.further_wheels_m.is_empty()
    }

    /// How far the wheel's contact point gives way upwards, in m/N, under a unit contact force at
    /// an angular frequency in rad/s, oscillators included: `-1 / (m w²) + ...`.
    pub fn receptance(&self, omega: f64) -> Complex64 {
        let wheel = Complex64::from(-1.0 / (self.wheel.mass_kg * omega * omega));
        wheel + self.oscillators.iter().map(|part| part.receptance(omega)).sum::<Complex64>()
    }

    /// What the sensor feels, in m/s2 per N of contact force, at an angular frequency in rad/s.
    ///
    /// A positive contact force pushes the wheel upwards: on a rigid wheel this is `-1 / m`.
    pub fn acceleration_per_force(&self, omega: f64) -> Complex64 {
        let parts = self.oscillators.iter().map(|part| part.sensed * part.receptance(omega));
        Complex64::from(-1.0 / self.wheel.mass_kg) - omega * omega * parts.sum::<Complex64>()
    }
}
