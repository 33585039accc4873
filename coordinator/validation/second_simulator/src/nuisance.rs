//! Small deviations that every rig has, drawn from the scene's seed.

use crate::random::{Random, Topic};
use crate::scale::Scale;
use tracktwin_reference_simulator::Scene;

/// Standard deviation of a railpad's damping, relative.
const PAD_DAMPING: f64 = 0.1;
/// Largest deviation of the channel's gain: 0.2 dB.
const CHANNEL: f64 = 0.0233;
/// Corner frequencies in Hz of the channel's shelf.
const CORNER_HZ: [f64; 2] = [200.0, 3000.0];
/// Power of the wave number by which the surface of a line falls. The limit of ISO 3095:2013 falls with the
/// third power above 25 mm; measured spectra have 2.5 to 3.5 (Thompson 2009, Railway Noise and Vibration).
const EXPONENT: [f64; 2] = [2.6, 3.4];
/// Share of the ballast's stiffness that is left under the middle of a line's sleeper: tamping tines reach
/// only the ballast beside the rails.
const MIDDLE_BED: [f64; 2] = [0.5, 1.0];
/// Largest deviation of the contact patch's half length, relative.
const PATCH: f64 = 0.1;

/// Sizes of deviations on a kind of track.
struct Sizes {
    /// Standard deviation and limit of a rail seat's place in m.
    seat_m: [f64; 2],
    /// Largest deviation of wheel mass and contact stiffness, relative.
    vehicle: [f64; 2],
    /// Amplitude in m of the first of the wheel's orders, and the power of the order by which others are
    /// smaller.
    order: (f64, i32),
}

/// Of the test rig.
const RIG: Sizes = Sizes { seat_m: [1e-3, 2e-3], vehicle: [0.01, 0.01], order: (4e-6, 1) };
/// Of a line: sleepers within some 10 mm; wheelsets that wear; eccentric wheels (Nielsen and Johansson 2000,
/// Proc. `IMechE` F 214: some 0.1 mm in the first order).
const LINE: Sizes = Sizes { seat_m: [5e-3, 1.2e-2], vehicle: [0.02, 0.05], order: (8e-5, 2) };

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
    /// The same of further wheels.
    pub(crate) further_orders: Vec<Vec<[f64; 2]>>,
    /// Power of the wave number by which the surface of a line falls.
    pub(crate) exponent: f64,
    /// Factor on the half length of the contact patch.
    pub(crate) patch: f64,
    /// Stiffness of the ballast under the middle of a sleeper over that beside the rails.
    pub(crate) middle_bed: f64,
    /// Gain of the channel below the corner, less that above, and the corner in Hz.
    pub(crate) shelf: [f64; 2],
}

impl Nuisances {
    /// Of a scene.
    pub(crate) fn draw(scene: &Scene, scale: &Scale, further_wheels: usize) -> Self {
        let Sizes { seat_m: [deviation, limit], vehicle: [of_mass, of_contact], order } =
            if scale.is_line { LINE } else { RIG };
        let sleepers = scene.sleepers.len();
        let mut random = Random::new(scene.seed, Topic::Nuisances, 0);
        let mut seat = || (deviation * random.normal()).clamp(-limit, limit);
        let seat_m = (0..sleepers).map(|_| seat()).collect();
        let mut damping = || (1.0 + PAD_DAMPING * random.normal()).clamp(0.7, 1.3);
        let pad_damping = (0..sleepers).map(|_| damping()).collect();
        let mut factor = |deviation: f64| 1.0 + random.between(-deviation, deviation);
        let [wheel_mass, contact] = [factor(of_mass), factor(of_contact)];
        let orders = orders(order, &mut random);
        let shelf = [
            random.between(-CHANNEL, CHANNEL),
            random.between(CORNER_HZ[0].ln(), CORNER_HZ[1].ln()).exp(),
        ];
        let [exponent, middle_bed] =
            [EXPONENT, MIDDLE_BED].map(|[low, high]| random.between(low, high));
        let patch = 1.0 + random.between(-PATCH, PATCH);
        let further_orders =
            (0..further_wheels).map(|_| self::orders(order, &mut random)).collect();
        Self {
            seat_m,
            pad_damping,
            wheel_mass,
            contact,
            orders,
            further_orders,
            exponent,
            patch,
            middle_bed,
            shelf,
        }
    }
}

/// Amplitude and phase of the orders 1 to 4 of a wheel.
fn orders((first_m, power): (f64, i32), random: &mut Random) -> Vec<[f64; 2]> {
    let mut order =
        |n: u32| [first_m / f64::from(n).powi(power) * random.between(0.3, 1.0), random.angle()];
    (1..=4).map(&mut order).collect()
}

#[cfg(test)]
impl Nuisances {
    /// No deviation at all.
    pub(crate) fn none(scene: &Scene) -> Self {
        Self {
            seat_m: vec![0.0; scene.sleepers.len()],
            pad_damping: vec![1.0; scene.sleepers.len()],
            wheel_mass: 1.0,
            contact: 1.0,
            orders: Vec::new(),
            further_orders: Vec::new(),
            exponent: 4.0,
            patch: 1.0,
            middle_bed: 1.0,
            shelf: [0.0, 1000.0],
        }
    }
}
