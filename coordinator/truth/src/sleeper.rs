//! Half sleepers: modes of a free Timoshenko beam by Ritz's method, on a continuous bed.
//!
//! Owns one sleeper as a linear system that the railpad pushes; the railpad is `port`'s.

use crate::system::LinearSystem;
use crate::vtrack::{
    DENSITY_KG_M3, SLEEPER_AREA_M2, SLEEPER_HALF_LENGTH_M, SLEEPER_SECOND_MOMENT_M4,
    SLEEPER_SHEAR_COEFFICIENT, YOUNG_PA, shear_modulus_pa,
};
use nalgebra::{DMatrix, DVector};

/// Polynomials of deflection, and of rotation.
const TERMS: usize = 12;
/// Modes kept: rigid motion and bending up to 12 kHz. The others give way statically.
pub(crate) const MODES: usize = 5;
/// Points of Gauss's rule along the half sleeper; exact for products of the polynomials.
const POINTS: usize = 14;
/// Modal damping over critical damping: half of a structural loss factor of 0.2 %, that of steel.
const DAMPING_RATIO: f64 = 1e-3;
/// Length in m that a crack softens.
const CRACK_LENGTH_M: f64 = 0.02;

/// Mass-normalised modes of a free half sleeper, symmetric about the track's symmetry plane.
#[derive(Clone, Debug)]
pub(crate) struct SleeperModes {
    /// Squared angular frequencies in (rad/s)² for the nominal section; they grow in proportion
    /// to the bending stiffness, for the shear stiffness grows with it.
    squares: Vec<f64>,
    /// Deflection at the rail seat and at the free end, in 1/sqrt(kg).
    seat: Vec<f64>,
    tip: Vec<f64>,
    /// Deflection at each of Gauss's points, and the points' shares of the length.
    along: Vec<Vec<f64>>,
    weights: Vec<f64>,
    /// Static flexibility in m/N of the cut modes at seat and tip, for the nominal section.
    seat_residual: f64,
    tip_residual: f64,
}

/// How a sleeper is held, beside its railpad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bed {
    /// Bending stiffness in N m2.
    pub(crate) bending: f64,
    /// Ballast stiffness in N/m and damping in N s/m over the whole half sleeper.
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    /// Spring in N/m between the free end and the ground.
    pub(crate) bolt: f64,
    /// Mass in kg, stiffness in N/m and damping in N s/m of a layer under the ballast.
    pub(crate) layer: Option<[f64; 3]>,
    /// Gap in m below the sleeper.
    pub(crate) gap_m: Option<f64>,
}

impl Bed {
    /// Stiffness and damping of ballast that the sleeper never leaves: none behind a gap.
    fn held(&self) -> [f64; 2] {
        if self.gap_m.is_some() { [0.0; 2] } else { [self.stiffness, self.damping] }
    }
}

/// A sleeper on its bed as a system with the railpad's force as first input; where it may lift
/// off, generalised forces on every mode follow.
#[derive(Clone, Debug)]
pub(crate) struct Sleeper {
    pub(crate) system: LinearSystem,
    /// Deflection of the rail seat by degree of freedom.
    pub(crate) seat: Vec<f64>,
    /// Static flexibility of the rail seat in m/N, that of the modes and the whole.
    pub(crate) flexibility: f64,
    pub(crate) residual: f64,
    /// Displacements at rest under a unit force on the rail seat.
    pub(crate) pressed: Vec<f64>,
    /// Ballast behind a gap.
    pub(crate) gap: Option<Gap>,
}

/// Ballast that a sleeper touches where it is pressed further down than the gap.
#[derive(Clone, Debug)]
pub(crate) struct Gap {
    depth_m: f64,
    stiffness: f64,
    damping: f64,
    along: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

/// Depth in m over which the damping of closing ballast sets in, so that it begins without a jump.
const ONSET_M: f64 = 1e-6;

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

impl SleeperModes {
    /// The modes of a sleeper whose softened middle keeps `bending_factor` of its bending
    /// stiffness, 1 for a sound one.
    ///
    /// Ritz's method (Ritz 1909) with Legendre polynomials for the deflection and `x` times such
    /// for the rotation, which symmetry holds at the rail seat. A crack lets it turn there, by an
    /// angular spring `E I beta / ((1 - beta) l)`.
    pub(crate) fn new(bending_factor: f64) -> Self {
        let (mass, stiffness) = ritz_matrices(bending_factor);
        let factor = mass.cholesky().expect("kinetic energy is positive").l();
        let inverse = factor.clone().try_inverse().expect("a Cholesky factor is regular");
        let eigen = (&inverse * stiffness * inverse.transpose()).symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let vectors = inverse.transpose() * eigen.eigenvectors;
        let (points, weights) = gauss_points();
        let deflections = |xi: f64| -> Vec<f64> {
            let basis = DVector::from_vec(legendre(xi).to_vec());
            let all = vectors.rows(0, TERMS).transpose() * basis;
            order.iter().map(|&mode| all[mode]).collect()
        };
        // Rounding leaves the rigid mode a frequency of a few hertz at most.
        let squares: Vec<f64> =
            order.iter().map(|&mode| eigen.eigenvalues[mode].max(0.0)).collect();
        let residual = |shape: &[f64]| -> f64 {
            shape.iter().zip(&squares).skip(MODES).map(|(a, square)| a * a / square).sum()
        };
        let (seat, tip) = (deflections(0.0), deflections(1.0));
        let kept = |mut shape: Vec<f64>| {
            shape.truncate(MODES);
            shape
        };
        Self {
            seat_residual: residual(&seat),
            tip_residual: residual(&tip),
            seat: kept(seat),
            tip: kept(tip),
            along: points.iter().map(|&xi| kept(deflections(xi))).collect(),
            weights,
            squares: std::iter::once(0.0).chain(squares[1..MODES].iter().copied()).collect(),
        }
    }

    /// The sleeper on a bed, with a time step in s.
    pub(crate) fn on(&self, bed: &Bed, step_s: f64) -> Sleeper {
        let scale = bed.bending / nominal_bending();
        let layers = usize::from(bed.layer.is_some());
        let dofs = MODES + layers;
        let mut matrices = self.matrices(bed, scale, dofs);
        if let Some(layer) = bed.layer {
            self.add_layer(bed, layer, &mut matrices);
        }
        let [mass, damping, stiffness] = matrices;
        let mut seat = self.seat.clone();
        seat.resize(dofs, 0.0);
        let seat_column = DVector::from_vec(seat.clone());
        let forces = if bed.gap_m.is_some() { dofs } else { 0 };
        let mut inputs = DMatrix::zeros(dofs, 1 + forces);
        inputs.set_column(0, &seat_column);
        inputs.view_mut((0, 1), (dofs, forces)).fill_with_identity();
        let residual = self.seat_residual / scale;
        let carried = &stiffness + self.weak_ground(dofs);
        let pressed = carried.cholesky().expect("the sleeper is held").solve(&seat_column);
        Sleeper {
            system: LinearSystem::new(&mass, &damping, &stiffness, &inputs, step_s),
            flexibility: seat_column.dot(&pressed),
            residual,
            pressed: pressed.as_slice().to_vec(),
            seat,
            gap: bed.gap_m.map(|depth_m| Gap {
                depth_m,
                stiffness: bed.stiffness,
                damping: bed.damping,
                along: self.along.iter().map(|shape| on_layer(shape, layers)).collect(),
                weights: self.weights.clone(),
            }),
        }
    }

    /// Mass, damping and stiffness of sleeper, ballast and bolt; room for further ones.
    fn matrices(&self, bed: &Bed, scale: f64, dofs: usize) -> [DMatrix<f64>; 3] {
        let mut damping = DMatrix::zeros(dofs, dofs);
        let mut stiffness = DMatrix::zeros(dofs, dofs);
        // A bolt is a point load: what the cut modes give way there is in series with it.
        let bolt = bed.bolt / (1.0 + bed.bolt * self.tip_residual / scale);
        let [ballast, ballast_damping] = bed.held();
        for a in 0..MODES {
            let omega = (self.squares[a] * scale).sqrt();
            stiffness[(a, a)] += omega * omega;
            damping[(a, a)] += 2.0 * DAMPING_RATIO * omega;
            for b in 0..MODES {
                let shared = self.mean(|shape| shape[a] * shape[b]);
                stiffness[(a, b)] += ballast * shared + bolt * self.tip[a] * self.tip[b];
                damping[(a, b)] += ballast_damping * shared;
            }
        }
        [DMatrix::identity(dofs, dofs), damping, stiffness]
    }

    /// The ballast stands on a mass instead of the ground.
    fn add_layer(&self, bed: &Bed, layer: [f64; 3], matrices: &mut [DMatrix<f64>; 3]) {
        let [mass_kg, stiffness_n_m, damping_n_s_m] = layer;
        let [mass, damping, stiffness] = matrices;
        let [ballast, ballast_damping] = bed.held();
        mass[(MODES, MODES)] = mass_kg;
        for (matrix, ballast, ground) in
            [(damping, ballast_damping, damping_n_s_m), (stiffness, ballast, stiffness_n_m)]
        {
            matrix[(MODES, MODES)] = ballast + ground;
            for mode in 0..MODES {
                let coupling = -ballast * self.mean(|shape| shape[mode]);
                matrix[(mode, MODES)] = coupling;
                matrix[(MODES, mode)] = coupling;
            }
        }
    }

    /// Mean over the half sleeper.
    fn mean(&self, value: impl Fn(&[f64]) -> f64) -> f64 {
        self.along.iter().zip(&self.weights).map(|(shape, weight)| weight * value(shape)).sum()
    }

    /// Stiffness with which a sleeper over a gap is held where a static state is asked for: a
    /// thousandth of soft ballast, so that it lies where the railpad carries it.
    fn weak_ground(&self, dofs: usize) -> DMatrix<f64> {
        let mut ground = DMatrix::zeros(dofs, dofs);
        ground[(0, 0)] = 4e3 * self.seat[0] * self.seat[0];
        ground
    }
}

/// `E I` of the nominal section in N m2.
const fn nominal_bending() -> f64 {
    YOUNG_PA * SLEEPER_SECOND_MOMENT_M4
}

/// What presses the ballast at a place by degree of freedom: the sleeper from above, and from below
/// the layer that it lies on, if there is one.
fn on_layer(shape: &[f64], layers: usize) -> Vec<f64> {
    shape.iter().copied().chain(std::iter::repeat_n(-1.0, layers)).collect()
}

/// Mass and stiffness of the nominal section in the polynomials' coefficients.
fn ritz_matrices(bending_factor: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let length = SLEEPER_HALF_LENGTH_M;
    let shear = SLEEPER_SHEAR_COEFFICIENT * shear_modulus_pa() * SLEEPER_AREA_M2;
    let cracked = bending_factor < 1.0;
    let size = 2 * TERMS + usize::from(cracked);
    let mut mass = DMatrix::zeros(size, size);
    let mut stiffness = DMatrix::zeros(size, size);
    let (points, weights) = gauss_points();
    for (&xi, weight) in points.iter().zip(&weights) {
        let [values, slopes] = [legendre(xi), legendre_slopes(xi)];
        let mut deflection = DVector::zeros(size);
        let mut rotation = DVector::zeros(size);
        let mut strain = DVector::zeros(size);
        let mut curvature = DVector::zeros(size);
        for term in 0..TERMS {
            deflection[term] = values[term];
            strain[term] = slopes[term] / length;
            rotation[TERMS + term] = xi * values[term];
            curvature[TERMS + term] = (values[term] + xi * slopes[term]) / length;
        }
        if cracked {
            rotation[2 * TERMS] = 1.0;
        }
        strain -= &rotation;
        let share = weight * length;
        mass += share * DENSITY_KG_M3 * SLEEPER_AREA_M2 * &deflection * deflection.transpose();
        mass += share * DENSITY_KG_M3 * SLEEPER_SECOND_MOMENT_M4 * &rotation * rotation.transpose();
        stiffness += share * nominal_bending() * &curvature * curvature.transpose();
        stiffness += share * shear * &strain * strain.transpose();
    }
    if cracked {
        // Half of the crack's length lies on this side of the symmetry plane.
        let softened = (1.0 / bending_factor - 1.0) * 0.5 * CRACK_LENGTH_M;
        stiffness[(2 * TERMS, 2 * TERMS)] += nominal_bending() / softened;
    }
    (mass, stiffness)
}

/// Legendre polynomials of `2 xi - 1` for `xi` in 0..1.
fn legendre(xi: f64) -> [f64; TERMS] {
    let x = 2.0 * xi - 1.0;
    let mut values = [1.0; TERMS];
    values[1] = x;
    for n in 1..TERMS - 1 {
        let order = n as f64;
        values[n + 1] =
            ((2.0 * order + 1.0) * x * values[n] - order * values[n - 1]) / (order + 1.0);
    }
    values
}

/// Their derivatives by `xi`: `P'_{n+1} = P'_{n-1} + (2 n + 1) P_n`, twice for the scale of `x`.
fn legendre_slopes(xi: f64) -> [f64; TERMS] {
    let values = legendre(xi);
    let mut slopes = [0.0; TERMS];
    slopes[1] = 2.0;
    for n in 1..TERMS - 1 {
        slopes[n + 1] = slopes[n - 1] + 2.0 * (2.0 * n as f64 + 1.0) * values[n];
    }
    slopes
}

/// Points of Gauss's rule in 0..1 and their weights, whose sum is one.
fn gauss_points() -> (Vec<f64>, Vec<f64>) {
    let count = POINTS as f64;
    (0..POINTS)
        .map(|index| {
            let mut x = (std::f64::consts::PI * (index as f64 + 0.75) / (count + 0.5)).cos();
            let mut slope = 1.0;
            // Newton's method doubles the digits at each step; five are enough for all of them.
            for _ in 0..6 {
                let (mut before, mut value) = (1.0, x);
                for n in 1..POINTS {
                    let order = n as f64;
                    let next = ((2.0 * order + 1.0) * x * value - order * before) / (order + 1.0);
                    (before, value) = (value, next);
                }
                slope = count * (x * value - before) / (x * x - 1.0);
                x -= value / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 5e-6;

    fn bed() -> Bed {
        Bed { bending: 5000.0, stiffness: 1.2e7, damping: 900.0, ..Bed::default() }
    }

    #[test]
    fn gauss_integrates_polynomials_to_degree_27() {
        let (points, weights) = gauss_points();
        let integral: f64 = points.iter().zip(&weights).map(|(x, w)| w * x.powi(27)).sum();
        assert!((28.0 * integral - 1.0).abs() < 1e-13, "{integral}");
    }

    #[test]
    fn frequencies_are_those_of_a_free_beam_less_what_shear_and_rotation_take() {
        let modes = SleeperModes::new(1.0);
        // Symmetric modes of a free slender beam of twice the length (Blevins 1979, table 8-1).
        let roots = [4.730_040_7, 10.995_607_8, 17.278_759_7];
        let inertia = DENSITY_KG_M3 * SLEEPER_AREA_M2;
        let shear = SLEEPER_SHEAR_COEFFICIENT * shear_modulus_pa() * SLEEPER_AREA_M2;
        for (root, square) in roots.iter().zip(&modes.squares[1..]) {
            let k: f64 = root / (2.0 * SLEEPER_HALF_LENGTH_M);
            let slender = nominal_bending() / inertia * k.powi(4);
            let lost =
                (SLEEPER_SECOND_MOMENT_M4 / SLEEPER_AREA_M2 + nominal_bending() / shear) * k * k;
            let ratio = square / slender;
            // Free ends bend more sharply than the wave inside: up to three times the estimate.
            assert!(1.0 - 3.0 * lost < ratio && ratio < 1.0 - 0.5 * lost, "{root}: {ratio}");
        }
    }

    #[test]
    fn the_static_flexibility_of_a_rigid_sleeper_is_that_of_its_ballast() {
        let sleeper = SleeperModes::new(1.0).on(&Bed { bending: 5e8, ..bed() }, STEP_S);
        // A sleeper a hundred thousand times as stiff as steel; beside it stands the weak ground.
        let flexibility = sleeper.flexibility + sleeper.residual;
        assert!((flexibility * 1.2e7 - 1.0).abs() < 1e-3, "{flexibility}");
    }

    #[test]
    fn a_sleeper_on_its_bed_sinks_as_a_beam_on_an_elastic_foundation() {
        // Hetenyi 1946: a force at the middle of a free beam of length l on a foundation k l;
        // shear adds less than a hundredth at this bending stiffness.
        let sleeper = SleeperModes::new(1.0).on(&bed(), STEP_S);
        let per_length = 1.2e7 / SLEEPER_HALF_LENGTH_M;
        let lambda = (per_length / (4.0 * 5000.0)).powf(0.25);
        let l = 2.0 * SLEEPER_HALF_LENGTH_M * lambda;
        let exact = lambda / (2.0 * per_length) * (l.cosh() + l.cos() + 2.0) / (l.sinh() + l.sin());
        // The closed form is for the force on both halves.
        let flexibility = sleeper.flexibility + sleeper.residual;
        assert!((flexibility / (2.0 * exact) - 1.0).abs() < 0.01, "{flexibility} {exact}");
    }

    #[test]
    fn a_bolt_a_layer_and_a_crack_do_what_they_should_to_the_seat() {
        let sound = SleeperModes::new(1.0);
        let flexibility = |sleeper: &Sleeper| sleeper.flexibility + sleeper.residual;
        let plain = flexibility(&sound.on(&bed(), STEP_S));
        // A spring at the tip takes f_st² / (f_tt + 1 / k) from the flexibility of the seat.
        let pressed = sound.on(&bed(), STEP_S).pressed;
        let mutual: f64 = sound.tip.iter().zip(&pressed).map(|(a, b)| a * b).sum();
        let taken = |bolt: f64| plain - flexibility(&sound.on(&Bed { bolt, ..bed() }, STEP_S));
        let difference = mutual * mutual * (1.0 / taken(1e7) - 1.0 / taken(2e7));
        assert!((difference / 5e-8 - 1.0).abs() < 0.01, "{difference}");
        // The layer's spring is in series with all of the ballast.
        let layer = Some([3.0, 6e7, 2e3]);
        let layered = flexibility(&sound.on(&Bed { layer, ..bed() }, STEP_S));
        assert!(((layered - plain) * 6e7 - 1.0).abs() < 0.01, "{layered} {plain}");
        let cracked = flexibility(&SleeperModes::new(0.1).on(&bed(), STEP_S));
        assert!(cracked > 1.02 * plain, "{cracked} {plain}");
    }

    #[test]
    fn ballast_behind_a_gap_pushes_where_the_gap_is_closed_and_never_pulls() {
        let modes = SleeperModes::new(1.0);
        let sleeper = modes.on(&Bed { gap_m: Some(1e-4), ..bed() }, STEP_S);
        let gap = sleeper.gap.unwrap();
        let forces_at = |depth_m: f64, velocity_m_s: f64| {
            let mut state = vec![0.0; 2 * MODES];
            // The rigid mode's deflection is the same everywhere.
            state[0] = depth_m / modes.seat[0];
            state[MODES] = velocity_m_s / modes.seat[0];
            let mut forces = vec![0.0; MODES];
            gap.push(&state, &mut forces);
            -forces[0] / modes.seat[0]
        };
        assert_eq!(forces_at(0.9e-4, 1.0), 0.0);
        assert!((forces_at(1.5e-4, 0.1) - (1.2e7 * 5e-5 + 90.0)).abs() < 1e-6);
        assert_eq!(forces_at(1.5e-4, -10.0), 0.0);
    }

    #[test]
    fn ballast_between_a_gap_and_a_layer_pushes_both() {
        let modes = SleeperModes::new(1.0);
        let bed = Bed { gap_m: Some(1e-4), layer: Some([3.0, 6e7, 2e3]), ..bed() };
        let sleeper = modes.on(&bed, STEP_S);
        // Where it hangs, nothing but the railpad carries it.
        assert!(sleeper.flexibility > 1e-5, "{}", sleeper.flexibility);
        let mut state = vec![0.0; 2 * (MODES + 1)];
        state[0] = 1.5e-4 / modes.seat[0];
        state[MODES] = 2e-5;
        let mut forces = vec![0.0; MODES + 1];
        sleeper.gap.unwrap().push(&state, &mut forces);
        // Less by what the layer has given way.
        assert!((-forces[0] / modes.seat[0] - 1.2e7 * 3e-5).abs() < 1e-6);
        assert!((forces[MODES] - 1.2e7 * 3e-5).abs() < 1e-6);
    }
}
