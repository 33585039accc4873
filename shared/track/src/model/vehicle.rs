//! The vehicle on the track, and the acceleration that its sensor measures.

use num_complex::Complex64;
use tracktwin_parameters::Wheel;

/// A wheel with the parts that move with it, and further wheels on the same rail.
///
/// Springs connect some parts to the wheel. Some parts of the rail deform under the contact at every place.
/// The model separates the motion of these parts into two: the motion of the wheel as a whole, and
/// oscillators that the contact force drives. These motions are not coupled to anything else. The approach of
/// the contact is `u_wheel - q_1 - q_2 ... - u_rail - z`.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// Mass and load of the wheel, with all parts that it carries.
    pub wheel: Wheel,
    /// Oscillators that the contact force drives, in addition to the mass of the wheel.
    pub oscillators: Vec<ContactOscillator>,
    /// Positions of further identical wheels, in m ahead of the first.
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
    /// Share of `q` in the motion of the sensor, in addition to the motion of the centre of mass of the
    /// vehicle. Positive downwards.
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
    pub fn rigid(wheel: &Wheel) -> Self {
        let further_wheels_m = wheel.further_wheels_m.clone();
        Self { wheel: wheel.clone(), oscillators: Vec::new(), further_wheels_m }
    }

    /// Whether it is one rigid wheel and nothing else.
    pub fn is_rigid_wheel(&self) -> bool {
        self.oscillators.is_empty() && self.further_wheels_m.is_empty()
    }

    /// Upward displacement of the contact point of the wheel per unit contact force, in m/N, at an
    /// angular frequency in rad/s. The value includes the oscillators: `-1 / (m w²) + ...`.
    pub fn receptance(&self, omega: f64) -> Complex64 {
        let wheel = Complex64::from(-1.0 / (self.wheel.mass_kg * omega * omega));
        wheel + self.oscillators.iter().map(|part| part.receptance(omega)).sum::<Complex64>()
    }

    /// Acceleration at the sensor in m/s2 per N of contact force, at an angular frequency in rad/s.
    ///
    /// A positive contact force pushes the wheel upwards: on a rigid wheel this is `-1 / m`.
    pub fn acceleration_per_force(&self, omega: f64) -> Complex64 {
        let parts = self.oscillators.iter().map(|part| part.sensed * part.receptance(omega));
        Complex64::from(-1.0 / self.wheel.mass_kg) - omega * omega * parts.sum::<Complex64>()
    }
}
