//! Rail seats: parameters of each sleeper, changed by the hidden effects at this sleeper.
//!
//! This module defines the parameters that each hidden effect changes. The module `sleeper` contains the
//! equations.

use crate::nuisance::Nuisances;
use tracktwin_reference_simulator::{Hidden, Scene};

/// Sleepers beyond either end of the scene, where waves die out.
pub(crate) const BEYOND: usize = 3;

/// Power of the share of stiffness by which a lost railpad loses damping: steel on steel still rubs.
const LOST_DAMPING: f64 = 0.75;
/// Shares of the relaxing stiffness, and relaxation times over the nominal one, of a railpad's branches.
const BRANCHES: [[f64; 2]; 2] = [[0.5, 0.577], [0.5, 1.733]];

/// One rail seat.
#[derive(Clone, Debug)]
pub(crate) struct Seat {
    /// Place in m.
    pub(crate) x_m: f64,
    /// Bending stiffness of the sleeper in N m2.
    pub(crate) ei: f64,
    /// Railpad: N/m and N s/m.
    pub(crate) pad: [f64; 2],
    /// Relaxing branches of the railpad: N/m and s.
    pub(crate) branches: Vec<[f64; 2]>,
    /// Exponent, reference load and toe load in N of a railpad that stiffens under load.
    pub(crate) stiffening: Option<[f64; 3]>,
    /// Clamp: N/m and N m/rad.
    pub(crate) clamp: [f64; 2],
    /// Ballast: N/m and N s/m.
    pub(crate) ballast: [f64; 2],
    /// Gap between sleeper and ballast in m.
    pub(crate) gap_m: Option<f64>,
    /// Layer under the ballast: kg, N/m, N s/m.
    pub(crate) layer: Option<[f64; 3]>,
    /// Bolt in N/m.
    pub(crate) bolt: f64,
    /// What is left of the bending stiffness in a crack.
    pub(crate) crack: f64,
}

/// All seats along the track, [`BEYOND`] the ends of the scene too.
pub(crate) fn seats(scene: &Scene, nuisances: &Nuisances) -> Vec<Seat> {
    let last = scene.sleepers.len() - 1;
    let spacing_m = scene.spacing_m();
    let count = scene.spans + 1 + 2 * BEYOND;
    let seat = |index: usize| {
        // The scene's sleeper 0 stands one spacing behind the scene's begin.
        let number = index.checked_sub(BEYOND + 1).filter(|&number| number <= last);
        let nearest = index.saturating_sub(BEYOND + 1).min(last);
        let truth = scene.sleepers[nearest];
        let shift_m = number.map_or(0.0, |number| nuisances.seat_m[number]);
        let damping = number.map_or(1.0, |number| nuisances.pad_damping[number]);
        let mut seat = Seat {
            x_m: (index as f64 - BEYOND as f64) * spacing_m + shift_m,
            ei: truth.sleeper_ei_n_m2,
            pad: [truth.railpad_stiffness_n_m, scene.railpad_damping_n_s_m * damping],
            branches: Vec::new(),
            stiffening: None,
            clamp: [0.0; 2],
            ballast: [truth.ballast_stiffness_n_m, scene.ballast_damping_n_s_m],
            gap_m: None,
            layer: None,
            bolt: 0.0,
            crack: 1.0,
        };
        for hidden in scene.left_out.iter().filter(|hidden| is_at(hidden, number)) {
            seat.hide(hidden);
        }
        seat
    };
    (0..count).map(seat).collect()
}

/// Index among all seats of the scene's sleeper `number`.
pub(crate) const fn index_of(number: usize) -> usize {
    number + BEYOND + 1
}

/// Whether an effect is at a sleeper: where it names none, it is at all.
fn is_at(hidden: &Hidden, number: Option<usize>) -> bool {
    let listed = |sleepers: &[usize]| number.is_some_and(|number| sleepers.contains(&number));
    hidden.sleepers().is_none_or(listed)
}

impl Seat {
    fn hide(&mut self, hidden: &Hidden) {
        match *hidden {
            Hidden::FasteningClamp { vertical_n_per_m, rotational_n_m_per_rad, .. } => {
                self.clamp[0] += vertical_n_per_m;
                self.clamp[1] += rotational_n_m_per_rad;
            }
            Hidden::MissingRailpad { stiffness_n_per_m, .. } => {
                let share = stiffness_n_per_m / self.pad[0];
                self.pad = [stiffness_n_per_m, self.pad[1] * share.powf(LOST_DAMPING)];
            }
            Hidden::SleeperBolt { stiffness_n_per_m, .. } => self.bolt += stiffness_n_per_m,
            Hidden::HangingSleeper { gap_m, .. } => self.gap_m = Some(gap_m),
            Hidden::SubgradeLayer { mass_kg, stiffness_n_per_m, damping_n_s_per_m, .. } => {
                self.layer = Some([mass_kg, stiffness_n_per_m, damping_n_s_per_m]);
            }
            Hidden::FrequencyDependentRailpad { stiffness_ratio, relaxation_time_s } => {
                let stiffness = stiffness_ratio * self.pad[0];
                let branch =
                    |[share, time]: [f64; 2]| [share * stiffness, time * relaxation_time_s];
                self.branches.extend(BRANCHES.map(branch));
            }
            Hidden::LoadDependentRailpad { exponent, reference_load_n, toe_load_n } => {
                self.stiffening = Some([exponent, reference_load_n, toe_load_n]);
            }
            Hidden::CrackedSleeper { bending_factor, .. } => self.crack *= bending_factor,
            _ => {}
        }
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::Seat;

    /// The middle of Table D1.
    pub(crate) fn seat() -> Seat {
        Seat {
            x_m: 0.0,
            ei: 5000.0,
            pad: [1.5e8, 6e3],
            branches: Vec::new(),
            stiffening: None,
            clamp: [0.0; 2],
            ballast: [1.2e7, 900.0],
            gap_m: None,
            layer: None,
            bolt: 0.0,
            crack: 1.0,
        }
    }
}
