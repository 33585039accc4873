//! A scene's track and vehicle, ready to be driven over: modes, ports and how ports share forces.

use crate::hidden::Hidden;
use crate::port::{Behind, Branch, Extra, Law, PowerLaw};
use crate::rail::RailModes;
use crate::scene::{Scene, SleeperTruth};
use crate::seats::SeatTransform;
use crate::sleeper::{Bed, Sleeper, SleeperModes};
use crate::system::LinearSystem;
use crate::vehicle::Vehicle;
use crate::vtrack::SPACING_M;
use nalgebra::DMatrix;

/// Time step in s; forces are linear in between, everything else is exact.
pub(crate) const STEP_S: f64 = 5e-6;
/// Modes of the rail to a span: the shortest wave is 42 mm long, its frequency some 40 kHz.
pub(crate) const MODES_PER_SPAN: usize = 6;
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
        Self::refined(scene, STEP_S, MODES_PER_SPAN)
    }

    /// The same with another time step in s and number of modes to a span.
    pub(crate) fn refined(scene: &Scene, step_s: f64, modes_per_span: usize) -> Self {
        let rail = RailModes::new(scene.length_m(), modes_per_span * scene.spans);
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
            steps: Oscillators::new(&rail.oscillators(step_s)),
            transform: SeatTransform::new(scene.spans),
            laws,
            behind,
            extras,
            links: scene.left_out.iter().filter_map(link).collect(),
            sharing: Vec::new(),
            vehicle: Vehicle::new(&scene.left_out, step_s),
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

    /// Every port's force `p` follows from its law and from what all forces do to its compression
    /// within a step: `p_i + sum_j G_ij p_j = what the free motion asks for`. The inverse.
    fn sharing_matrix(&self) -> Vec<f64> {
        let shapes = self.shapes();
        let ports = shapes.len();
        let mut matrix = DMatrix::identity(ports, ports);
        for row in 0..ports {
            let law = self.laws[row];
            let stiffness = law.stiffness + law.branch.map_or(0.0, |branch| branch.gain);
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

    /// Displacement and velocity of what is behind a port, under a unit force at a step's end.
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
    let sound = SleeperModes::new(SOUND);
    let sleeper = |(index, truth): (usize, &SleeperTruth)| {
        let (bed, crack) = bed(scene, index, truth);
        if crack < SOUND {
            SleeperModes::new(crack).on(&bed, step_s)
        } else {
            sound.on(&bed, step_s)
        }
    };
    scene.sleepers.iter().enumerate().map(sleeper).collect()
}

/// How a sleeper is held, and what its crack leaves of its bending stiffness.
pub(crate) fn bed(scene: &Scene, index: usize, truth: &SleeperTruth) -> (Bed, f64) {
    let mut bed = Bed {
        bending: truth.sleeper_ei_n_m2,
        stiffness: truth.ballast_stiffness_n_m,
        damping: scene.ballast_damping_n_s_m,
        ..Bed::default()
    };
    let mut crack = SOUND;
    for hidden in scene.left_out.iter().filter(|hidden| concerns(hidden, index)) {
        match hidden {
            Hidden::SleeperBolt { stiffness_n_per_m, .. } => bed.bolt += stiffness_n_per_m,
            Hidden::HangingSleeper { gap_m, .. } => bed.gap_m = Some(*gap_m),
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
pub(crate) fn concerns(hidden: &Hidden, index: usize) -> bool {
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
                let stiffness = stiffness_ratio * law.stiffness;
                law.branch = Some(Branch::new(stiffness, *relaxation_time_s, step_s));
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
