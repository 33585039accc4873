//! Forces of all contacts and force laws on one track at the end of a time step.

use super::kinematics::Kinematics;
use crate::model::{ForceLaw, HertzContact, Reaction};
use nalgebra::{DMatrix, DVector};

/// Change of the motions, relative to the largest of them, at which Newton's iteration has
/// converged: some hundred roundings of a double.
const TOLERANCE: f64 = 1e-13;
/// Largest number of Newton steps. Continuous laws need three to ten; more steps mean that there is no
/// solution.
const STEPS_MAX: usize = 100;
/// Largest number of halvings of a Newton step that does not reduce the residual.
const HALVINGS_MAX: usize = 30;

/// A force that resists a motion.
pub(super) enum Resistance<'a> {
    /// A wheel's contact, at its approach.
    Contact(HertzContact),
    /// A force law on the track, with its state and the time step. `None`: at rest.
    Law(&'a ForceLaw, Kinematics, Option<f64>),
}

impl Resistance<'_> {
    /// The force at a motion in m, and by how much it grows with the motion.
    fn at(&self, motion_m: f64) -> (f64, f64) {
        match self {
            Self::Contact(contact) => {
                let force = contact.force(motion_m);
                let slope = if motion_m > 0.0 { 1.5 * force / motion_m } else { 0.0 };
                (force, slope)
            }
            Self::Law(law, _, None) => {
                let Reaction { force, stiffness, .. } = law.correction(motion_m, 0.0);
                (force, stiffness)
            }
            Self::Law(law, before, Some(dt)) => {
                let velocity = before.velocity_at(motion_m, *dt);
                let Reaction { force, stiffness, damping } = law.correction(motion_m, velocity);
                (force, stiffness + 2.0 / dt * damping)
            }
        }
    }

    /// Whether the force is zero at a motion and near this motion.
    pub(super) fn rests_at(&self, motion_m: f64) -> bool {
        self.at(motion_m) == (0.0, 0.0)
    }
}

/// Motions `y` in m and forces `R(y)` in N with `y + S R(y) = free`, by Newton's method with
/// shortened steps; `S` in m/N, starting from a guess of the motions.
///
/// `None` if the iteration does not converge, for example because an input is NaN.
pub(super) fn solve(
    resistances: &[Resistance],
    compliance: &DMatrix<f64>,
    free: &DVector<f64>,
    guess: DVector<f64>,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let residual = |motions: &DVector<f64>| {
        let forces = forces(resistances, motions);
        motions + compliance * forces - free
    };
    let mut motions = guess;
    let mut error = residual(&motions);
    for _ in 0..STEPS_MAX {
        if error.amax() == 0.0 {
            // Nothing resists, as gaps that stay open.
            let forces = forces(resistances, &motions);
            return Some((motions, forces));
        }
        let step = jacobian(resistances, compliance, &motions).lu().solve(&-&error)?;
        let mut length = 1.0;
        let mut next = &motions + &step;
        let mut next_error = residual(&next);
        for _ in 0..HALVINGS_MAX {
            if next_error.norm() <= error.norm() || step.amax() <= TOLERANCE * next.amax() {
                break;
            }
            length *= 0.5;
            next = &motions + length * &step;
            next_error = residual(&next);
        }
        (motions, error) = (next, next_error);
        if length * step.amax() <= TOLERANCE * motions.amax() {
            let forces = forces(resistances, &motions);
            return Some((motions, forces));
        }
    }
    None
}

fn forces(resistances: &[Resistance], motions: &DVector<f64>) -> DVector<f64> {
    let pairs = resistances.iter().zip(motions.iter());
    DVector::from_iterator(motions.len(), pairs.map(|(law, &motion)| law.at(motion).0))
}

/// `I + S diag(R')`.
fn jacobian(
    resistances: &[Resistance],
    compliance: &DMatrix<f64>,
    motions: &DVector<f64>,
) -> DMatrix<f64> {
    let mut jacobian = compliance.clone();
    for (column, law) in resistances.iter().enumerate() {
        let slope = law.at(motions[column]).1;
        jacobian.column_mut(column).scale_mut(slope);
        jacobian[(column, column)] += 1.0;
    }
    jacobian
}
