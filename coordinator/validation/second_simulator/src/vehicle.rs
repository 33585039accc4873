//! The vehicle: wheel and axle box, with what vibrates in the wheel and in the rail's section.
//!
//! This module computes the motion of contact and sensor under the contact force. The rail cross-section
//! is part of the vehicle, because it is also an oscillator on the contact.

use crate::scheme::{REACH, Weights};
use crate::system::{Matrices, System};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use tracktwin_parameters::Wheel;
use tracktwin_reference_simulator::{Hidden, TruthError};

/// Frequencies of the rail's section over the first, and their shares of its compliance.
const SECTION_MODES: [[f64; 2]; 2] = [[1.0, 0.85], [1.7, 0.15]];

/// Wheel, axle box and oscillators in motion.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    system: System,
    /// Displacement of the contact, per coordinate.
    contact: DVector<f64>,
    /// Displacement of the sensor, per coordinate.
    sensor: DVector<f64>,
    /// Load in N on each coordinate.
    load: DVector<f64>,
    /// Where coordinates stand over the wheel at rest in m, and whether they follow it.
    rest: Vec<(f64, bool)>,
    inverse: DMatrix<f64>,
    /// Accelerations per contact force in 1/kg, upwards.
    per_force: DVector<f64>,
    free: DVector<f64>,
}

/// A coordinate beside the wheel's.
struct Coordinate {
    mass: f64,
    stiffness: f64,
    damping: f64,
    /// It moves with the wheel, on a spring; otherwise it adds to the contact.
    is_axle_box: bool,
    contact: f64,
    sensor: f64,
}

impl Vehicle {
    /// A wheel with what is hidden in it.
    ///
    /// # Errors
    /// [`TruthError`] if the wheel has no remaining mass, or if there are two axle boxes.
    pub(crate) fn new(left_out: &[Hidden], wheel: &Wheel) -> Result<Self, TruthError> {
        let whole = wheel.mass_kg;
        let parts: Vec<Coordinate> =
            left_out.iter().flat_map(|hidden| coordinates(hidden, whole)).collect();
        let boxes = || parts.iter().filter(|part| part.is_axle_box);
        if boxes().count() > 1 {
            let (field, form) = ("flexible_axle_box", "one axle box at most");
            return Err(TruthError::Value { field, value: boxes().count() as f64, form });
        }
        let mass = whole - boxes().map(|part| part.mass).sum::<f64>();
        if mass < 0.1 * whole {
            let (field, value, most) = ("flexible_axle_box.mass_kg", whole - mass, 0.9 * whole);
            return Err(TruthError::TooLarge { field, value, most });
        }
        let mut matrices = Matrices::zero(1 + parts.len());
        let mut contact = DVector::zeros(1 + parts.len());
        let [mut sensor, mut load] = [contact.clone(), contact.clone()];
        let mut rest = vec![(0.0, true)];
        matrices.mass[(0, 0)] = mass;
        contact[0] = 1.0;
        sensor[0] = 1.0;
        load[0] = wheel.load_n;
        for (i, part) in (1..).zip(&parts) {
            matrices.mass[(i, i)] = part.mass;
            let other = part.is_axle_box.then_some(0);
            matrices.connect(i, other, part.stiffness, part.damping);
            contact[i] = part.contact;
            sensor[i] = part.sensor;
            if part.is_axle_box {
                // Sensor and suspension sit on the box.
                sensor[0] = 0.0;
                load[0] = 0.0;
                load[i] = wheel.load_n;
                rest.push((wheel.load_n / part.stiffness, true));
            } else {
                rest.push((-part.contact * wheel.load_n / part.stiffness, false));
            }
        }
        let inverse = matrices.combined(Weights::STEP).try_inverse();
        let inverse = inverse.expect("every coordinate has mass");
        let per_force = &inverse * &contact;
        let (system, free) = (System::new(&matrices), DVector::zeros(contact.len()));
        Ok(Self { system, contact, sensor, load, rest, inverse, per_force, free })
    }

    /// Moves to rest with the contact at this displacement in m.
    pub(crate) fn rest_at(&mut self, contact_m: f64) {
        let offset = |(i, (rest, _)): (usize, &(f64, bool))| self.contact[i] * rest;
        let wheel = contact_m - self.rest.iter().enumerate().map(offset).sum::<f64>();
        for (i, &(rest, follows)) in self.rest.iter().enumerate() {
            self.system.motion.displacement[i] = if follows { wheel + rest } else { rest };
        }
    }

    /// Begins a step: displacement of the contact in m at its end without contact force, and how far in m/N
    /// the force of the step lifts it.
    pub(crate) fn begin(&mut self) -> [f64; 2] {
        self.system.begin();
        self.free = &self.inverse * (DVector::from_column_slice(&self.system.force) + &self.load);
        let predicted = |i| self.system.motion.predicted(i) + REACH * self.free[i];
        let free: f64 = (0..self.contact.len()).map(|i| self.contact[i] * predicted(i)).sum();
        [free, REACH * self.contact.dot(&self.per_force)]
    }

    /// Ends the step under its contact force in N; returns the sensor's acceleration in m/s2, downwards.
    pub(crate) fn end(&mut self, force_n: f64) -> f64 {
        let mut heard = 0.0;
        for i in 0..self.contact.len() {
            let acceleration = self.free[i] - self.per_force[i] * force_n;
            self.system.motion.advance(i, acceleration);
            heard += self.sensor[i] * acceleration;
        }
        heard
    }
}

/// What an effect adds to a vehicle of this mass in kg.
fn coordinates(hidden: &Hidden, whole: f64) -> Vec<Coordinate> {
    match *hidden {
        Hidden::FlexibleAxleBox { mass_kg, stiffness_n_per_m, damping_n_s_per_m } => {
            vec![Coordinate {
                mass: mass_kg,
                stiffness: stiffness_n_per_m,
                damping: damping_n_s_per_m,
                is_axle_box: true,
                contact: 0.0,
                sensor: 1.0,
            }]
        }
        // A mode of the free wheel: rim and hub move against each other.
        Hidden::WheelMode { frequency_hz, mass_kg, damping_ratio } => {
            let omega = TAU * frequency_hz;
            vec![Coordinate {
                mass: mass_kg,
                stiffness: mass_kg * omega * omega,
                damping: 2.0 * damping_ratio * mass_kg * omega,
                is_axle_box: false,
                contact: 1.0,
                sensor: -mass_kg / whole,
            }]
        }
        Hidden::RailCrossSection { frequency_hz, stiffness_n_per_m, loss_factor } => {
            let mode = |[ratio, share]: [f64; 2]| {
                let stiffness = stiffness_n_per_m / share;
                let omega = TAU * frequency_hz * ratio;
                Coordinate {
                    mass: stiffness / (omega * omega),
                    stiffness,
                    damping: loss_factor * stiffness / omega,
                    is_axle_box: false,
                    contact: -1.0,
                    sensor: 0.0,
                }
            };
            SECTION_MODES.map(mode).into()
        }
        _ => Vec::new(),
    }
}
