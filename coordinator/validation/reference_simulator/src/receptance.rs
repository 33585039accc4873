//! Receptances of the track without a wheel, as measured in a hammer test.

use crate::hidden::Hidden;
use crate::rail::RailModes;
use crate::sleeper::SleeperModes;
use crate::track::{STEP_S, bed, railpad, seat_m};
use crate::vtrack;
use crate::{Scene, TruthError};
use nalgebra::{Complex, DMatrix, DVector};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Point receptances in m/N of the rail at some places in m: `[place][frequency]`, in the convention
/// `exp(+i w t)`.
///
/// Modes of rail and sleepers are those of the passes, solved in the frequency domain. No wheel
/// stands on the track: a railpad that stiffens with load has its stiffness under the toe load, and
/// a sleeper above a gap has no ballast.
///
/// # Errors
/// [`TruthError`] if the scene is invalid, if a place is not on the rail, or if an effect acts on the
/// rail outside the rail seats.
pub fn receptance(
    scene: &Scene,
    places_m: &[f64],
    frequencies_hz: &[f64],
) -> Result<Vec<Vec<Complex<f64>>>, TruthError> {
    vtrack::check(scene)?;
    let length_m = scene.length_m();
    if let Some(&x_m) = places_m.iter().find(|x_m| !(0.0..=length_m).contains(*x_m)) {
        return Err(TruthError::OffTrack { x_m, length_m });
    }
    if let Some(hidden) = scene.left_out.iter().find(|hidden| adds_beside_seats(hidden)) {
        return Err(TruthError::NoReceptance { physics: hidden.physics() });
    }
    let track = Struck::new(scene, places_m);
    let mut receptances = vec![Vec::with_capacity(frequencies_hz.len()); places_m.len()];
    for &frequency_hz in frequencies_hz {
        let values = track.at(TAU * frequency_hz);
        for (receptances, value) in receptances.iter_mut().zip(values) {
            receptances.push(value);
        }
    }
    Ok(receptances)
}

/// Whether an effect acts on the rail at other places than the seats, or between two of them.
const fn adds_beside_seats(hidden: &Hidden) -> bool {
    matches!(
        hidden,
        Hidden::RailJoint { .. }
            | Hidden::FasteningClamp { .. }
            | Hidden::RailAbsorber { .. }
            | Hidden::LinkedSleepers { .. }
    )
}

/// A track that a hammer strikes: all of it that no frequency changes.
struct Struck<'a> {
    scene: &'a Scene,
    rail: RailModes,
    /// Modes of sleepers by the bits of what their crack leaves of the bending stiffness.
    modes: BTreeMap<u64, SleeperModes>,
    /// Deflection of every mode of the rail at every seat.
    seats: Vec<Vec<f64>>,
    /// Between two seats, by the difference and by the sum of their numbers:
    /// `sin a sin b = (cos (a - b) - cos (a + b)) / 2`.
    difference: Vec<Wave>,
    sum: Vec<Wave>,
    places: Vec<Place>,
}

/// Half the cosine of every mode of the rail, and what the modes leave out in m/N.
struct Wave {
    halves: Vec<f64>,
    residual: f64,
}

/// A place that is struck.
struct Place {
    /// Deflection of every mode of the rail.
    shape: Vec<f64>,
    /// What the modes leave out of the receptance to every seat, in m/N.
    residuals: Vec<f64>,
}

impl Wave {
    fn new(rail: &RailModes, distance_m: f64, residual: f64) -> Self {
        let halves = rail.wave_numbers.iter().map(|k| 0.5 * (k * distance_m).cos()).collect();
        Self { halves, residual }
    }

    /// Its share of a receptance in m/N.
    fn receptance(&self, gains: &[Complex<f64>]) -> Complex<f64> {
        let modes = self.halves.iter().zip(gains);
        modes.map(|(half, gain)| gain * *half).sum::<Complex<f64>>() + self.residual
    }
}

/// Receptance of the free rail in m/N between two places, by the deflections of its modes there and
/// what they leave out.
fn free(gains: &[Complex<f64>], a: &[f64], b: &[f64], residual: f64) -> Complex<f64> {
    let modes = a.iter().zip(b).zip(gains);
    modes.map(|((a, b), gain)| gain * (a * b)).sum::<Complex<f64>>() + residual
}

impl<'a> Struck<'a> {
    fn new(scene: &'a Scene, places_m: &[f64]) -> Self {
        let rail = RailModes::new(scene.length_m(), scene.assumptions.modes_per_span * scene.spans);
        let mut modes = BTreeMap::new();
        for (index, truth) in scene.sleepers.iter().enumerate() {
            let (_, crack) = bed(scene, index, truth);
            let made = || SleeperModes::new(crack, scene.nuisances.sleeper_mass_factor);
            modes.entry(crack.to_bits()).or_insert_with(made);
        }
        let seats = scene.sleepers.len();
        let apart_m = |seats: usize| seat_m(seats) - seat_m(0);
        let difference = |apart: usize| {
            Wave::new(&rail, apart_m(apart), rail.residual_flexibility(apart_m(apart)))
        };
        let sum = |numbers: usize| Wave::new(&rail, apart_m(numbers) + 2.0 * seat_m(0), 0.0);
        let place = |&x_m: &f64| {
            let residual = |seat: usize| rail.residual_flexibility(x_m - seat_m(seat));
            Place { shape: rail.deflections(x_m), residuals: (0..seats).map(residual).collect() }
        };
        Self {
            scene,
            modes,
            seats: (0..seats).map(|seat| rail.deflections(seat_m(seat))).collect(),
            difference: (0..seats).map(difference).collect(),
            sum: (0..2 * seats).map(sum).collect(),
            places: places_m.iter().map(place).collect(),
            rail,
        }
    }

    /// Point receptances at an angular frequency in rad/s.
    ///
    /// With the receptances `R` of the free rail and the supports' dynamic stiffness `Z`, the
    /// supports push with `p`, `(1 / Z + R) p = r`, where `r` stands between seats and place.
    fn at(&self, omega: f64) -> Vec<Complex<f64>> {
        let seats = self.seats.len();
        let gains = self.gains(omega);
        let of = |waves: &[Wave]| -> Vec<Complex<f64>> {
            waves.iter().map(|wave| wave.receptance(&gains)).collect()
        };
        let (difference, sum) = (of(&self.difference), of(&self.sum));
        let mut matrix =
            DMatrix::from_fn(seats, seats, |a, b| difference[a.abs_diff(b)] - sum[a + b]);
        for seat in 0..seats {
            matrix[(seat, seat)] += self.support(seat, omega);
        }
        let factor = matrix.lu();
        let of = |place: &Place| {
            let Place { shape, residuals } = place;
            let to_seats = DVector::from_fn(seats, |seat, _| {
                free(&gains, shape, &self.seats[seat], residuals[seat])
            });
            let pushed = factor.solve(&to_seats).expect("damped supports push in one way");
            let own = free(&gains, shape, shape, self.rail.residual_flexibility(0.0));
            own - to_seats.dot(&pushed)
        };
        self.places.iter().map(of).collect()
    }

    /// Receptance of each mode of the free rail in m/N.
    fn gains(&self, omega: f64) -> Vec<Complex<f64>> {
        let modes = self.rail.frequencies.iter().zip(&self.rail.masses);
        let gain = |(own, mass): (&f64, &f64)| {
            let damping = 2.0 * self.scene.assumptions.steel_damping_ratio * own * omega;
            (Complex::new(own * own - omega * omega, damping) * *mass).inv()
        };
        modes.map(gain).collect()
    }

    /// Flexibility of a support in m/N: railpad and sleeper in series.
    fn support(&self, seat: usize, omega: f64) -> Complex<f64> {
        let (bed, crack) = bed(self.scene, seat, &self.scene.sleepers[seat]);
        let law = railpad(self.scene, seat, STEP_S);
        let softer = law.power.map_or(1.0, |it| (it.toe_n / it.nominal_n).powf(it.exponent));
        let mut stiffness = Complex::new(softer * law.stiffness, omega * law.damping);
        for branch in &law.branches {
            let turn = Complex::new(0.0, omega * branch.relaxation_time_s);
            stiffness += turn / (turn + 1.0) * branch.stiffness;
        }
        stiffness.inv() + self.modes[&crack.to_bits()].seat_receptance(&bed, omega)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::NOMINAL;
    use crate::vtrack::SPACING_M;

    #[test]
    fn a_static_force_meets_the_stiffness_of_a_beam_on_an_elastic_foundation() {
        // Soft supports are a foundation of stiffness `k` a length. A beam with bending stiffness `B` and
        // shear stiffness `S` gives way by the integral of `(1 + a q^2) / (B q^4 + k a q^2 + k)`,
        // `a = B / S`, over all wave numbers `q`, divided by two pi (Winkler 1867; Timoshenko 1921).
        let soft = crate::SleeperTruth {
            ballast_stiffness_n_m: 2e5,
            // Stiff: the foundation does not bend.
            sleeper_ei_n_m2: 1e8,
            ..NOMINAL
        };
        let scene = Scene::uniform(120, soft);
        let place_m = 60.0 * SPACING_M;
        let found = receptance(&scene, &[place_m], &[0.1]).unwrap()[0][0].re;
        let crate::rail::CrossSection { bending, shear, .. } = crate::rail::cross_section();
        let per_length: f64 = 1.0 / (1.0 / 1.5e8 + 1.0 / 2e5) / SPACING_M;
        let ratio = bending / shear;
        let exact = 0.5 * (per_length.sqrt().recip() + ratio / bending.sqrt())
            / (per_length * ratio + 2.0 * (bending * per_length).sqrt()).sqrt();
        assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
    }

    #[test]
    fn a_railpad_that_stiffens_with_load_is_softer_under_a_hammer() {
        let mut scene = Scene::uniform(40, NOMINAL);
        let frequencies_hz = [200.0, 400.0, 800.0, 1200.0, 1600.0];
        let at = |scene: &Scene| {
            receptance(scene, &[20.0 * SPACING_M], &frequencies_hz).unwrap().remove(0)
        };
        let change = |one: &[Complex<f64>], other: &[Complex<f64>]| {
            let pairs = one.iter().zip(other);
            pairs.map(|(one, other)| (one / other - 1.0).norm()).fold(0.0, f64::max)
        };
        let linear = at(&scene);
        scene.left_out.push(Hidden::LoadDependentRailpad {
            exponent: 0.5,
            reference_load_n: 3000.0,
            toe_load_n: 1000.0,
        });
        let halved = crate::SleeperTruth { railpad_stiffness_n_m: 0.75e8, ..NOMINAL };
        let softer = at(&Scene::uniform(40, halved));
        assert!(change(&at(&scene), &softer) < 1e-9);
        assert!(change(&linear, &softer) > 0.05);
    }

    #[test]
    fn what_receptances_do_not_hold_is_refused() {
        let mut scene = Scene::uniform(40, NOMINAL);
        assert!(receptance(&scene, &[9.0], &[100.0]).unwrap_err().to_string().contains("9 m"));
        scene.left_out.push(Hidden::LinkedSleepers { sleepers: [3, 4], stiffness_n_per_m: 1e7 });
        let refused = receptance(&scene, &[2.0], &[100.0]).unwrap_err().to_string();
        assert!(refused.contains("linked_sleepers"), "{refused}");
    }
}
