//! Half sleepers: modes of a free Timoshenko beam by Ritz's method, on a continuous bed.
//!
//! This module describes one sleeper as a linear system driven by the force of the railpad. The module
//! `port` contains the railpad.

mod gap;
mod ritz;

use self::gap::Gap;
use self::ritz::{TERMS, energies, gauss_points, legendre, nominal_bending};
use crate::system::LinearSystem;
use nalgebra::{Complex, DMatrix, DVector};

/// Modes kept: rigid motion and bending up to 12 kHz. The others give way statically.
pub(crate) const MODES: usize = 5;

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
    /// Damping of steel over critical damping.
    pub(crate) steel_damping_ratio: f64,
    /// Ballast stiffness in N/m and damping in N s/m over the whole half sleeper.
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    /// Spring in N/m between the free end and the ground.
    pub(crate) bolt: f64,
    /// Mass in kg, stiffness in N/m and damping in N s/m of a layer under the ballast.
    pub(crate) layer: Option<[f64; 3]>,
    /// Gap in m below the sleeper, and what share of the ballast's damping acts over it.
    pub(crate) gap_m: Option<f64>,
    pub(crate) gap_damping_share: f64,
}

impl Bed {
    /// Stiffness and damping of ballast that the sleeper never leaves: a share of the damping over a
    /// gap.
    fn held(&self) -> [f64; 2] {
        match self.gap_m {
            Some(_) => [0.0, self.gap_damping_share * self.damping],
            None => [self.stiffness, self.damping],
        }
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

impl SleeperModes {
    /// The modes of a sleeper whose softened middle keeps `bending_factor` of its bending
    /// stiffness, 1 for a sound one, and whose mass is the nominal one times a factor.
    ///
    /// Ritz's method (Ritz 1909) with Legendre polynomials for the deflection and `x` times such
    /// for the rotation, which symmetry holds at the rail seat. A crack lets it turn there, by an
    /// angular spring `E I beta / ((1 - beta) l)`.
    pub(crate) fn new(bending_factor: f64, mass_factor: f64) -> Self {
        let (mass, stiffness) = energies(bending_factor, mass_factor);
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
        let [mass, damping, stiffness] = self.held(bed);
        let dofs = mass.nrows();
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
                damping: (1.0 - bed.gap_damping_share) * bed.damping,
                along: self.along.iter().map(|shape| on_layer(shape, layers)).collect(),
                weights: self.weights.clone(),
            }),
        }
    }

    /// Displacement of the rail seat in m per unit harmonic force on it at an angular frequency in
    /// rad/s, in the convention `exp(+i w t)`, of a sleeper that carries no wheel.
    pub(crate) fn seat_receptance(&self, bed: &Bed, omega: f64) -> Complex<f64> {
        let [mass, damping, stiffness] = self.held(bed);
        let elastic = stiffness - mass * (omega * omega);
        let matrix = elastic.zip_map(&damping, |k, c| Complex::new(k, omega * c));
        let mut force = DVector::zeros(matrix.nrows());
        for (force, seat) in force.iter_mut().zip(&self.seat) {
            *force = Complex::from(*seat);
        }
        let moved = matrix.lu().solve(&force).expect("a damped sleeper has a receptance");
        moved.dot(&force) + self.seat_residual / (bed.bending / nominal_bending())
    }

    /// Mass, damping and stiffness of a sleeper on its bed.
    fn held(&self, bed: &Bed) -> [DMatrix<f64>; 3] {
        let scale = bed.bending / nominal_bending();
        let mut matrices = self.matrices(bed, scale, MODES + usize::from(bed.layer.is_some()));
        if let Some(layer) = bed.layer {
            self.add_layer(bed, layer, &mut matrices);
        }
        matrices
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
            damping[(a, a)] += 2.0 * bed.steel_damping_ratio * omega;
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

    /// Small stiffness that supports a sleeper over a gap in a static state: a thousandth of that of
    /// soft ballast, so that the railpad determines the position of the sleeper.
    fn weak_ground(&self, dofs: usize) -> DMatrix<f64> {
        let mut ground = DMatrix::zeros(dofs, dofs);
        ground[(0, 0)] = 4e3 * self.seat[0] * self.seat[0];
        ground
    }
}

/// What presses the ballast at a place by degree of freedom: the sleeper from above, and from below
/// the layer that it lies on, if there is one.
fn on_layer(shape: &[f64], layers: usize) -> Vec<f64> {
    shape.iter().copied().chain(std::iter::repeat_n(-1.0, layers)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assumptions::STEEL_DAMPING_RATIO;
    use crate::vtrack::{
        DENSITY_KG_M3, SLEEPER_AREA_M2, SLEEPER_HALF_LENGTH_M, SLEEPER_SECOND_MOMENT_M4,
        SLEEPER_SHEAR_COEFFICIENT, shear_modulus_pa,
    };

    const STEP_S: f64 = 5e-6;

    fn bed() -> Bed {
        Bed {
            bending: 5000.0,
            steel_damping_ratio: STEEL_DAMPING_RATIO,
            stiffness: 1.2e7,
            damping: 900.0,
            ..Bed::default()
        }
    }

    #[test]
    fn frequencies_are_those_of_a_free_beam_less_what_shear_and_rotation_take() {
        let modes = SleeperModes::new(1.0, 1.0);
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
        let sleeper = SleeperModes::new(1.0, 1.0).on(&Bed { bending: 5e8, ..bed() }, STEP_S);
        // A sleeper a hundred thousand times as stiff as steel; beside it stands the weak ground.
        let flexibility = sleeper.flexibility + sleeper.residual;
        assert!((flexibility * 1.2e7 - 1.0).abs() < 1e-3, "{flexibility}");
    }

    #[test]
    fn a_sleeper_on_its_bed_sinks_as_a_beam_on_an_elastic_foundation() {
        // Hetenyi 1946: a force at the middle of a free beam of length l on a foundation k l;
        // shear adds less than a hundredth at this bending stiffness.
        let sleeper = SleeperModes::new(1.0, 1.0).on(&bed(), STEP_S);
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
        let sound = SleeperModes::new(1.0, 1.0);
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
        let cracked = flexibility(&SleeperModes::new(0.1, 1.0).on(&bed(), STEP_S));
        assert!(cracked > 1.02 * plain, "{cracked} {plain}");
    }

    #[test]
    fn ballast_behind_a_gap_pushes_where_the_gap_is_closed_and_never_pulls() {
        let modes = SleeperModes::new(1.0, 1.0);
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
    fn ballast_over_a_gap_keeps_its_share_of_the_damping_and_no_more() {
        let modes = SleeperModes::new(1.0, 1.0);
        let damping = |bed: &Bed| modes.held(bed)[1][(0, 0)] / modes.seat[0].powi(2);
        let hanging = Bed { gap_m: Some(1e-4), ..bed() };
        let shared = Bed { gap_damping_share: 0.4, ..hanging };
        assert!(damping(&hanging).abs() < 1e-9 && (damping(&shared) - 360.0).abs() < 1e-6);
        assert_eq!(modes.on(&shared, STEP_S).gap.unwrap().damping, 540.0);
        assert_eq!(modes.held(&shared)[2], modes.held(&hanging)[2]);
    }

    #[test]
    fn a_heavier_sleeper_moves_less_as_a_whole_and_bends_more_slowly() {
        let [usual, heavy] = [1.0, 1.02].map(|factor| SleeperModes::new(1.0, factor));
        assert!(((usual.seat[0] / heavy.seat[0]).powi(2) / 1.02 - 1.0).abs() < 1e-9);
        assert!((usual.squares[1] / heavy.squares[1] / 1.02 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn ballast_between_a_gap_and_a_layer_pushes_both() {
        let modes = SleeperModes::new(1.0, 1.0);
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
