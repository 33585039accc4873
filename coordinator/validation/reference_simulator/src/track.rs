//! Track and vehicle of a scene, prepared for passes: modes, ports, and the coupling of the port forces.

use crate::assumptions::Void;
use crate::contact::Contact;
use crate::hidden::Hidden;
use crate::nuisances::{REFERENCE_LOAD_N, TOE_LOAD_N};
use crate::port::{BRANCHES, Behind, Branch, Extra, Law, PowerLaw};
use crate::rail::RailModes;
use crate::scene::{Scene, SleeperTruth};
use crate::seats::SeatTransform;
use crate::sleeper::{Bed, Sleeper, SleeperModes};
use crate::system::LinearSystem;
use crate::vehicle::Vehicle;
use crate::vtrack::{SPACING_M, WHEEL_MASS_KG};
use nalgebra::DMatrix;

/// Time step in s; forces are linear in between, everything else is exact.
pub(crate) const STEP_S: f64 = 5e-6;
/// Sum of a sleeper's and its crack's bending that still counts as none: a factor this near to one.
const SOUND: f64 = 1.0;

/// Track and vehicle of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) step_s: f64,
    pub(crate) rail: RailModes,
    pub(crate) steps: Oscillators,
    pub(crate) transform: SeatTransform,
    /// Laws of all ports: the seats in order, then the extra ones.
    pub(crate) laws: Vec<Law>,
    /// What lies behind each port.
    pub(crate) behind: Vec<Behind>,
    pub(crate) extras: Vec<Extra>,
    /// Springs between the rail seats of two sleepers: their numbers and stiffness in N/m.
    pub(crate) links: Vec<([usize; 2], f64)>,
    /// Inverse of what gives every port's force by its free motion, row by row.
    pub(crate) sharing: Vec<f64>,
    pub(crate) vehicle: Vehicle,
    pub(crate) contact: Contact,
    /// Static flexibility in m/N of the rail under a force that its modes leave out.
    pub(crate) local: f64,
}

/// The step of every mode: `q_1 = e_00 q + e_01 v + s_0 f_0 + t_0 f_1`, `v_1` likewise.
#[derive(Clone, Debug, Default)]
pub(crate) struct Oscillators {
    pub(crate) transition: [Vec<f64>; 4],
    pub(crate) start: [Vec<f64>; 2],
    pub(crate) end: [Vec<f64>; 2],
}

impl Oscillators {
    fn new(systems: &[LinearSystem]) -> Self {
        let mut all = Self::default();
        for system in systems {
            let (transition, start, end) = system.single();
            for (column, value) in all.transition.iter_mut().zip(transition) {
                column.push(value);
            }
            for (column, value) in all.start.iter_mut().zip(start) {
                column.push(value);
            }
            for (column, value) in all.end.iter_mut().zip(end) {
                column.push(value);
            }
        }
        all
    }
}

impl Track {
    /// The track of a checked scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let (step_s, assumptions, nuisances) = (STEP_S, &scene.assumptions, &scene.nuisances);
        let rail = RailModes::new(scene.length_m(), assumptions.modes_per_span * scene.spans);
        let sleepers = sleepers(scene, step_s);
        let seat = |(index, sleeper): (usize, &Sleeper)| {
            let residual = rail.residual_flexibility(0.0) + sleeper.residual;
            Law { residual, ..railpad(scene, index, step_s) }
        };
        let mut laws: Vec<Law> = sleepers.iter().enumerate().map(seat).collect();
        let mut behind: Vec<Behind> =
            sleepers.into_iter().map(|sleeper| Behind::Sleeper(Box::new(sleeper))).collect();
        let extras: Vec<Extra> =
            scene.left_out.iter().flat_map(|hidden| extras(scene, &rail, hidden, step_s)).collect();
        laws.extend(extras.iter().map(|extra| extra.law));
        behind.extend(extras.iter().map(|extra| extra.behind.clone()));
        let mut track = Self {
            step_s,
            steps: Oscillators::new(&rail.oscillators(assumptions.steel_damping_ratio, step_s)),
            transform: SeatTransform::new(scene.spans),
            laws,
            behind,
            extras,
            links: scene.left_out.iter().filter_map(link).collect(),
            sharing: Vec::new(),
            vehicle: Vehicle::new(
                &scene.left_out,
                nuisances.wheel_mass_factor * WHEEL_MASS_KG,
                step_s,
            ),
            contact: Contact::new(nuisances.contact_factor),
            local: rail.residual_flexibility(0.0),
            rail,
        };
        track.sharing = track.sharing_matrix();
        track
    }

    /// Number of seats.
    pub(crate) fn seats(&self) -> usize {
        self.transform.seats()
    }

    /// Displacement of every port by mode, seats first.
    pub(crate) fn shapes(&self) -> Vec<Vec<f64>> {
        let seats = (0..self.seats()).map(|seat| self.rail.deflections(seat_m(seat)));
        seats.chain(self.extras.iter().map(|extra| extra.shape.clone())).collect()
    }

    /// Static deflection in m that the modes leave out, at port `port` under a unit contact force
    /// at `x_m`; the same the other way round.
    #[inline]
    pub(crate) fn beside(&self, port: usize, x_m: f64) -> f64 {
        match self.extras.get(port.wrapping_sub(self.seats())) {
            Some(extra) => extra.line.at(x_m),
            None => self.rail.residual_flexibility(x_m - seat_m(port)),
        }
    }

    /// Inverse of the matrix of the port forces `p`. Within a step they satisfy
    /// `p_i + sum_j G_ij p_j = f_i` with the forces `f` from the free motion. `G` contains the law of
    /// each port and the effect of all forces on its compression.
    fn sharing_matrix(&self) -> Vec<f64> {
        let shapes = self.shapes();
        let ports = shapes.len();
        let mut matrix = DMatrix::identity(ports, ports);
        for row in 0..ports {
            let law = self.laws[row];
            let stiffness = law.stiffness + law.gain();
            for column in 0..ports {
                let reach = |gains: &[f64]| -> f64 {
                    let terms = shapes[row].iter().zip(&shapes[column]).zip(gains);
                    terms.map(|((a, b), gain)| a * b * gain).sum()
                };
                matrix[(row, column)] +=
                    stiffness * reach(&self.steps.end[0]) + law.damping * reach(&self.steps.end[1]);
            }
            let [displacement, velocity] = self.gain_behind(row);
            matrix[(row, row)] += stiffness * (law.residual + displacement)
                + law.damping * (law.residual / self.step_s + velocity);
        }
        let inverse = matrix.try_inverse().expect("ports share forces in one way");
        inverse.transpose().as_slice().to_vec()
    }

    /// Displacement and velocity of the system behind a port, per unit force at the end of a step.
    fn gain_behind(&self, port: usize) -> [f64; 2] {
        let Some((system, shape)) = self.behind[port].system() else { return [0.0; 2] };
        let gain = system.gain(0);
        let (displacements, velocities) = gain.split_at(system.dofs());
        [displacements, velocities].map(|part| part.iter().zip(shape).map(|(a, b)| a * b).sum())
    }
}

/// Place of a seat, from 0, in m.
#[inline]
pub(crate) fn seat_m(seat: usize) -> f64 {
    (seat + 1) as f64 * SPACING_M
}

/// All sleepers of a scene.
fn sleepers(scene: &Scene, step_s: f64) -> Vec<Sleeper> {
    let modes = |crack: f64| SleeperModes::new(crack, scene.nuisances.sleeper_mass_factor);
    let sound = modes(SOUND);
    let sleeper = |(index, truth): (usize, &SleeperTruth)| {
        let (bed, crack) = bed(scene, index, truth);
        if crack < SOUND { modes(crack).on(&bed, step_s) } else { sound.on(&bed, step_s) }
    };
    scene.sleepers.iter().enumerate().map(sleeper).collect()
}

/// How a sleeper is held, and what its crack leaves of its bending stiffness.
pub(crate) fn bed(scene: &Scene, index: usize, truth: &SleeperTruth) -> (Bed, f64) {
    let mut bed = Bed {
        bending: truth.sleeper_ei_n_m2,
        steel_damping_ratio: scene.assumptions.steel_damping_ratio,
        stiffness: truth.ballast_stiffness_n_m,
        damping: scene.ballast_damping_n_s_m,
        ..Bed::default()
    };
    let mut crack = SOUND;
    for hidden in scene.left_out.iter().filter(|hidden| concerns(hidden, index)) {
        match hidden {
            Hidden::SleeperBolt { stiffness_n_per_m, .. } => bed.bolt += stiffness_n_per_m,
            Hidden::HangingSleeper { gap_m, .. } => {
                let Void { damping_share, stays_open } = scene.assumptions.void;
                bed.gap_m = Some(if stays_open { f64::INFINITY } else { *gap_m });
                bed.gap_damping_share = damping_share;
            }
            Hidden::SubgradeLayer { mass_kg, stiffness_n_per_m, damping_n_s_per_m, .. } => {
                bed.layer = Some([*mass_kg, *stiffness_n_per_m, *damping_n_s_per_m]);
            }
            Hidden::CrackedSleeper { bending_factor, .. } => crack = *bending_factor,
            _ => {}
        }
    }
    (bed, crack)
}

/// Whether an effect is at a sleeper: named, or everywhere.
fn concerns(hidden: &Hidden, index: usize) -> bool {
    hidden.sleepers().is_none_or(|sleepers| sleepers.contains(&index))
}

/// The railpad over a sleeper.
pub(crate) fn railpad(scene: &Scene, index: usize, step_s: f64) -> Law {
    let mut law = Law {
        stiffness: scene.sleepers[index].railpad_stiffness_n_m,
        damping: scene.railpad_damping_n_s_m,
        ..Law::default()
    };
    for hidden in scene.left_out.iter().filter(|hidden| concerns(hidden, index)) {
        match hidden {
            Hidden::MissingRailpad { stiffness_n_per_m, .. } => {
                law.damping *= stiffness_n_per_m / law.stiffness;
                law.stiffness = *stiffness_n_per_m;
            }
            Hidden::FasteningClamp { vertical_n_per_m, .. } => law.stiffness += vertical_n_per_m,
            Hidden::FrequencyDependentRailpad { stiffness_ratio, relaxation_time_s } => {
                let all = scene.assumptions.branches(*stiffness_ratio, *relaxation_time_s);
                for (branch, [ratio, time_s]) in law.branches.iter_mut().zip(all) {
                    *branch = Branch::new(ratio * law.stiffness, time_s, step_s);
                }
            }
            Hidden::LoadDependentRailpad { exponent, reference_load_n, toe_load_n } => {
                law.power = Some(PowerLaw {
                    stiffness: law.stiffness,
                    exponent: *exponent,
                    toe_n: *toe_load_n,
                    nominal_n: toe_load_n + reference_load_n,
                });
            }
            _ => {}
        }
    }
    let nuisances = &scene.nuisances;
    if nuisances.railpad_relaxation > 0.0 {
        let stiffness = nuisances.railpad_relaxation * law.stiffness;
        let time_s = nuisances.railpad_relaxation_time_s;
        law.branches[BRANCHES - 1] = Branch::new(stiffness, time_s, step_s);
    }
    if law.power.is_none() && nuisances.railpad_exponent > 0.0 {
        law.power = Some(PowerLaw {
            stiffness: law.stiffness,
            exponent: nuisances.railpad_exponent,
            toe_n: TOE_LOAD_N,
            nominal_n: TOE_LOAD_N + REFERENCE_LOAD_N,
        });
    }
    law
}

/// The ports that an effect adds beside the seats.
fn extras(scene: &Scene, rail: &RailModes, hidden: &Hidden, step_s: f64) -> Vec<Extra> {
    let length_m = scene.length_m();
    match hidden {
        Hidden::RailJoint { x_m, bending_factor, bending_length_m, .. }
            if *bending_factor < 1.0 =>
        {
            let centre_m = 0.5 * (x_m[0] + x_m[1]);
            vec![Extra::joint(rail, length_m, centre_m, *bending_length_m, *bending_factor)]
        }
        Hidden::FasteningClamp { sleepers, rotational_n_m_per_rad, .. } => sleepers
            .iter()
            .map(|&sleeper| Extra::clamp(rail, length_m, seat_m(sleeper), *rotational_n_m_per_rad))
            .collect(),
        Hidden::RailAbsorber { x_m, mass_kg, frequency_hz, damping_ratio } => {
            let omega = std::f64::consts::TAU * frequency_hz;
            let centre_m = 0.5 * (x_m[0] + x_m[1]);
            vec![Extra::absorber(rail, centre_m, *mass_kg, omega, *damping_ratio, step_s)]
        }
        _ => Vec::new(),
    }
}

fn link(hidden: &Hidden) -> Option<([usize; 2], f64)> {
    match hidden {
        Hidden::LinkedSleepers { sleepers, stiffness_n_per_m } => {
            Some((*sleepers, *stiffness_n_per_m))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assumptions::Assumptions;
    use crate::nuisances::Nuisances;
    use crate::scene::testing::NOMINAL;

    #[test]
    fn nuisances_of_a_railpad_stand_beside_what_is_hidden_in_it() {
        let hidden =
            Hidden::FrequencyDependentRailpad { stiffness_ratio: 0.8, relaxation_time_s: 1e-4 };
        let nuisances =
            Nuisances { railpad_relaxation: 0.1, railpad_exponent: 0.1, ..Nuisances::default() };
        let two = Assumptions { relaxation_branches: 2, ..Assumptions::default() };
        let plain = Scene { left_out: vec![hidden], ..Scene::uniform(20, NOMINAL) };
        let varied = Scene { assumptions: two, nuisances, ..plain.clone() };
        let branches = |scene: &Scene| railpad(scene, 3, STEP_S).branches.map(|it| it.stiffness);
        assert_eq!(branches(&plain), [0.8 * 1.5e8, 0.0, 0.0]);
        assert_eq!(branches(&varied), [0.4 * 1.5e8, 0.4 * 1.5e8, 0.1 * 1.5e8]);
        let power = |scene: &Scene| railpad(scene, 3, STEP_S).power.map(|it| it.exponent);
        assert_eq!((power(&plain), power(&varied)), (None, Some(0.1)));
    }

    #[test]
    fn a_void_that_stays_open_has_no_ballast_but_its_share_of_the_damping() {
        let hidden = Hidden::HangingSleeper { sleepers: vec![5], gap_m: 1e-4 };
        let void = Void { damping_share: 0.3, stays_open: true };
        let plain = Scene { left_out: vec![hidden], ..Scene::uniform(20, NOMINAL) };
        let open = Assumptions { void, ..Assumptions::default() };
        let open = Scene { assumptions: open, ..plain.clone() };
        let of = |scene: &Scene, index: usize| {
            let (bed, _) = bed(scene, index, &NOMINAL);
            (bed.gap_m, bed.gap_damping_share)
        };
        assert_eq!(of(&plain, 5), (Some(1e-4), 0.0));
        assert_eq!(of(&open, 5), (Some(f64::INFINITY), 0.3));
        assert_eq!(of(&open, 6), (None, 0.0));
    }
}
