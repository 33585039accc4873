//! Small deviations that every rig has, drawn from the scene's seed.

use crate::random::{Random, Topic};

/// Standard deviation and limit of a rail seat's place in m.
const SEAT_M: [f64; 2] = [1e-3, 2e-3];
/// Standard deviation of a railpad's damping, relative.
const PAD_DAMPING: f64 = 0.1;
/// Largest deviation of wheel mass and contact stiffness, relative.
const VEHICLE: f64 = 0.01;
/// Amplitude in m of the first of the wheel's orders; order `n` has an `n`-th of it.
const ORDER_M: f64 = 4e-6;
/// Largest deviation of the channel's gain: 0.2 dB.
const CHANNEL: f64 = 0.0233;
/// Corner frequencies in Hz of the channel's shelf.
const CORNER_HZ: [f64; 2] = [200.0, 3000.0];

/// What differs from the nominal rig.
#[derive(Clone, Debug)]
pub(crate) struct Nuisances {
    /// Shift of every sleeper's rail seat in m.
    pub(crate) seat_m: Vec<f64>,
    /// Factor on every railpad's damping.
    pub(crate) pad_damping: Vec<f64>,
    /// Factor on the wheel's mass.
    pub(crate) wheel_mass: f64,
    /// Factor on the contact's stiffness.
    pub(crate) contact: f64,
    /// Amplitude in m and phase in rad of the wheel's orders, from 1 up.
    pub(crate) orders: Vec<[f64; 2]>,
    /// Gain of the channel below the corner, less that above, and the corner in Hz.
    pub(crate) shelf: [f64; 2],
}

impl Nuisances {
    /// Of a scene with this seed.
    pub(crate) fn draw(seed: u64, sleepers: usize) -> Self {
        let mut random = Random::new(seed, Topic::Nuisances, 0);
        let [deviation, limit] = SEAT_M;
        let mut seat = || (deviation * random.normal()).clamp(-limit, limit);
        let seat_m = (0..sleepers).map(|_| seat()).collect();
        let mut damping = || (1.0 + PAD_DAMPING * random.normal()).clamp(0.7, 1.3);
        let pad_damping = (0..sleepers).map(|_| damping()).collect();
        let mut factor = || 1.0 + random.between(-VEHICLE, VEHICLE);
        let [wheel_mass, contact] = [factor(), factor()];
        let mut order =
            |n: u32| [ORDER_M / f64::from(n) * random.between(0.3, 1.0), random.angle()];
        let orders = (1..=4).map(&mut order).collect();
        let shelf = [
            random.between(-CHANNEL, CHANNEL),
            random.between(CORNER_HZ[0].ln(), CORNER_HZ[1].ln()).exp(),
        ];
        Self { seat_m, pad_damping, wheel_mass, contact, orders, shelf }
    }
}
