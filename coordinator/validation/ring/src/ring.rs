//! The ring as the paper describes it (sections 2.1 and 5), with assumed numbers where the paper states
//! none.

use crate::plan::{Plan, SLEEPERS, Stretch};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_parameters::{Parameter, Preset};
use tracktwin_reference_simulator::{
    Assumptions, Chain, Hidden, Nuisances, PassPlan, RoughRail, SPACING_M, Scene,
    SleeperTruth as SceneSleeper, TruthError, simulate,
};
use tracktwin_signal::recording::Recording;

/// Sleepers of the track beyond the stretch on either side, which continue the ring.
const BESIDE: usize = 8;
/// Spans recorded beyond the stretch on either side, so that the windows of its ends are complete.
const MARGIN_SPANS: usize = 3;

/// Railpad stiffness without clamp in N/m, inside Table D1.
const RAILPAD_N_M: f64 = 8e7;
/// Additional vertical stiffness of a clamp in N/m, and its stiffness against rotation in N m/rad.
const CLAMP_N_M: f64 = 7e7;
const CLAMP_N_M_RAD: f64 = 5e4;
/// Remaining stiffness at a missing railpad in N/m: the lower bound of Table D1.
const MISSING_N_M: f64 = 1e7;
/// Bending stiffness of a sleeper without bolts in N m2: 1.125e-8 m4 of steel (paper: 2300 N m2).
const BENDING_N_M2: f64 = 2362.5;
/// Stiffness of the bolt at a sleeper's end in N/m.
const BOLT_N_M: f64 = 3e7;
/// Damping of railpad and ballast in N s/m, the middle of Table D1.
const RAILPAD_DAMPING_N_S_M: f64 = 6e3;
const BALLAST_DAMPING_N_S_M: f64 = 900.0;
/// Standard deviation of the logarithm of railpad and ballast stiffness from sleeper to sleeper.
const SCATTER: f64 = 0.05;

/// Irregularity level of rails 2 and 4 in 1e-4 m2 rad/m; level and band of rails 1 and 3 over it.
const LEVEL: f64 = 2.0;
const ROUGH_LEVEL: f64 = 1.5;
const ROUGH_BAND: f64 = 3.0;

/// Sleepers with clamps, every third or fourth; the paper names 76, 92, 96 and 4.
const CLAMPS: [usize; 28] = [
    4, 8, 11, 15, 18, 22, 25, 29, 32, 36, 40, 43, 47, 50, 54, 57, 61, 65, 68, 72, 76, 79, 82, 85,
    89, 92, 96, 100,
];
/// Sleeper without railpad, and sleeper without bolts (paper, Fig. 1).
const MISSING_RAILPAD: usize = 91;
const UNBOLTED: usize = 94;

/// Last sleeper of each board of plywood, and ballast stiffness on it in N/m; the last board reaches
/// over the ring's end. The paper names the gap behind SN94.
const BOARDS: [(usize, f64); 6] =
    [(18, 9e6), (32, 1.35e7), (46, 1e7), (56, 1.5e7), (78, 9.5e6), (94, 1.4e7)];

/// A rail joint, midway between two sleepers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Joint {
    /// `J1` to `J4`.
    pub name: &'static str,
    /// Number of the sleeper before the joint.
    pub after: usize,
    /// Depth of the dip in m.
    pub dip_m: f64,
    /// Length in m over which the dip falls to 1/e.
    pub length_m: f64,
    /// Ratio of the bending stiffness at the joint to that of the rail.
    pub bending_factor: f64,
}

/// The joints; J3 and J4 are in a worse condition (paper, section 5.1).
const JOINTS: [Joint; 4] = [
    Joint { name: "J1", after: 12, dip_m: 3e-5, length_m: 0.015, bending_factor: 0.5 },
    Joint { name: "J2", after: 37, dip_m: 4e-5, length_m: 0.015, bending_factor: 0.5 },
    Joint { name: "J3", after: 62, dip_m: 1e-4, length_m: 0.02, bending_factor: 0.3 },
    Joint { name: "J4", after: 87, dip_m: 1.2e-4, length_m: 0.02, bending_factor: 0.25 },
];

/// Softened length of the rail at a joint in m.
const JOINT_LENGTH_M: f64 = 0.025;

/// Truth of one sleeper of the ring.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SleeperTruth {
    /// `SN1` to `SN100`.
    pub id: String,
    /// Number of the sleeper, from 1.
    pub number: usize,
    /// Position of the sleeper in m, with SN1 at 0 (paper, section 2.2).
    pub x_m: f64,
    /// Number of the rail above the sleeper, 1 to 4.
    pub rail: usize,
    /// Name of the joint next to the sleeper, if there is one.
    pub joint: Option<&'static str>,
    /// Whether the sleeper has a clamp.
    pub clamp: bool,
    /// Whether the railpad is missing.
    pub missing_railpad: bool,
    /// Whether the sleeper has bolts.
    pub bolt: bool,
    /// True values of the parameters. The railpad stiffness includes the clamp. The irregularity level
    /// of rails 1 and 3 is that outside their rough band.
    #[serde(flatten)]
    pub values: BTreeMap<Parameter, f64>,
}

/// The truth of a stretch of the ring.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Truth {
    /// The sleepers.
    pub sleepers: Vec<SleeperTruth>,
    /// The joints between these sleepers.
    pub joints: Vec<Joint>,
    /// Numbers of the sleepers before the plywood gaps.
    pub gaps: Vec<usize>,
    /// Ratio of the power of waves from 0.9 to 5.2 mm on rails 1 and 3 to that of eq. B.6.
    pub rough_band_factor: f64,
}

/// The ring of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Ring {
    plan: Plan,
    /// Stiffness of railpad (without clamp) and ballast of all sleepers of the ring.
    stiffness: Vec<[f64; 2]>,
}

/// Number of the rail above a sleeper: rail 1 reaches over the ring's end.
const fn rail(number: usize) -> usize {
    let mut joint = 0;
    while joint < JOINTS.len() && JOINTS[joint].after < number {
        joint += 1;
    }
    joint % JOINTS.len() + 1
}

/// Whether a rail is one of the rough ones.
const fn is_rough(rail: usize) -> bool {
    rail % 2 == 1
}

/// Ballast stiffness of the board under a sleeper.
fn board(number: usize) -> f64 {
    let board = BOARDS.iter().find(|(last, _)| number <= *last).unwrap_or(&BOARDS[0]);
    board.1
}

fn position_m(number: usize) -> f64 {
    (number - 1) as f64 * SPACING_M
}

impl Ring {
    /// The ring of a plan. The values of the sleepers depend only on the seed.
    pub fn new(plan: Plan) -> Self {
        let mut random = ChaCha12Rng::seed_from_u64(plan.seed);
        let mut scattered = |value: f64| {
            let draw: f64 = StandardNormal.sample(&mut random);
            value * (SCATTER * draw).exp()
        };
        let stiffness =
            (1..=SLEEPERS).map(|number| [scattered(RAILPAD_N_M), scattered(board(number))]);
        Self { stiffness: stiffness.collect(), plan }
    }

    /// The plan.
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The truth of the stretch.
    pub fn truth(&self) -> Truth {
        let Stretch { first, last } = self.plan.stretch;
        let inside = |after: usize| first <= after && after < last;
        Truth {
            sleepers: (first..=last).map(|number| self.sleeper(number)).collect(),
            joints: JOINTS.into_iter().filter(|joint| inside(joint.after)).collect(),
            gaps: BOARDS.iter().map(|board| board.0).filter(|&after| inside(after)).collect(),
            rough_band_factor: ROUGH_BAND,
        }
    }

    fn sleeper(&self, number: usize) -> SleeperTruth {
        let [railpad, ballast] = self.stiffness[number - 1];
        let (clamp, missing_railpad) = (CLAMPS.contains(&number), number == MISSING_RAILPAD);
        let rail = rail(number);
        let level = if is_rough(rail) { ROUGH_LEVEL * LEVEL } else { LEVEL };
        // The simulator scales the damping with the stiffness that remains of a missing railpad.
        let (railpad, railpad_damping) = match (clamp, missing_railpad) {
            (_, true) => (MISSING_N_M, RAILPAD_DAMPING_N_S_M * MISSING_N_M / railpad),
            (true, false) => (railpad + CLAMP_N_M, RAILPAD_DAMPING_N_S_M),
            (false, false) => (railpad, RAILPAD_DAMPING_N_S_M),
        };
        let beside = |joint: &&Joint| joint.after == number || joint.after + 1 == number;
        SleeperTruth {
            id: format!("SN{number}"),
            number,
            x_m: position_m(number),
            rail,
            joint: JOINTS.iter().find(beside).map(|joint| joint.name),
            clamp,
            missing_railpad,
            bolt: number != UNBOLTED,
            values: BTreeMap::from([
                (Parameter::RailpadStiffness, railpad),
                (Parameter::RailpadDamping, railpad_damping),
                (Parameter::BallastStiffness, ballast),
                (Parameter::BallastDamping, BALLAST_DAMPING_N_S_M),
                (Parameter::SleeperBendingStiffness, BENDING_N_M2),
                (Parameter::IrregularityLevel, level),
            ]),
        }
    }

    /// Simulates the passes: lap by lap, in each a pass at every speed.
    ///
    /// The simulated track is straight. Beyond the stretch it continues with the next sleepers of the
    /// ring. Positions are those of the ring, with SN1 at 0.
    ///
    /// # Errors
    /// The errors of [`simulate`].
    pub fn record(&self) -> Result<Recording, TruthError> {
        let mut recording = simulate(&self.scene())?;
        let origin_m = self.origin_m();
        for pass in &mut recording.passes {
            pass.position_m.iter_mut().for_each(|x_m| *x_m += origin_m);
        }
        let Stretch { first, last } = self.plan.stretch;
        for sleeper in &mut recording.sleepers {
            sleeper.x_m += origin_m;
        }
        let from_m = position_m(first) - 0.5 * SPACING_M;
        recording.sleepers.retain(|it| from_m < it.x_m);
        recording.sleepers.truncate(last + 1 - first);
        for (number, sleeper) in (first..).zip(&mut recording.sleepers) {
            sleeper.id = format!("SN{number}");
            sleeper.x_m = position_m(number);
        }
        Ok(recording)
    }

    /// Ring position of the origin of the scene in m.
    fn origin_m(&self) -> f64 {
        position_m(self.plan.stretch.first) - (BESIDE + 1) as f64 * SPACING_M
    }

    /// Numbers of all sleepers of the scene.
    fn numbers(&self) -> Vec<usize> {
        let Stretch { first, last } = self.plan.stretch;
        let from = first + SLEEPERS - BESIDE;
        (from..=last + SLEEPERS + BESIDE).map(|number| (number - 1) % SLEEPERS + 1).collect()
    }

    fn scene(&self) -> Scene {
        let numbers = self.numbers();
        let of = |index: usize| self.sleeper(numbers[index]);
        let with = |wanted: &dyn Fn(&SleeperTruth) -> bool| -> Vec<usize> {
            (0..numbers.len()).filter(|&index| wanted(&of(index))).collect()
        };
        let passes = (0..self.plan.laps).flat_map(|_| &self.plan.speeds_km_h);
        let spans = numbers.len() + 1;
        let ends = [BESIDE + 1 - MARGIN_SPANS, spans - BESIDE - 1 + MARGIN_SPANS];
        let mut left_out: Vec<Hidden> = joints(&numbers).collect();
        left_out.push(Hidden::FasteningClamp {
            sleepers: with(&|it| it.clamp),
            vertical_n_per_m: CLAMP_N_M,
            rotational_n_m_per_rad: CLAMP_N_M_RAD,
        });
        let sleepers = with(&|it| it.missing_railpad);
        left_out.push(Hidden::MissingRailpad { sleepers, stiffness_n_per_m: MISSING_N_M });
        let sleepers = with(&|it| it.bolt);
        left_out.push(Hidden::SleeperBolt { sleepers, stiffness_n_per_m: BOLT_N_M });
        left_out.retain(|hidden| hidden.sleepers().is_none_or(|sleepers| !sleepers.is_empty()));
        Scene {
            preset: Preset::VTrack,
            spans,
            seed: self.plan.seed,
            irregularity_level: LEVEL,
            rough_rails: rough_rails(&numbers),
            sleepers: numbers.iter().map(|number| self.under(*number)).collect(),
            railpad_damping_n_s_m: RAILPAD_DAMPING_N_S_M,
            ballast_damping_n_s_m: BALLAST_DAMPING_N_S_M,
            passes: passes.map(|&speed_km_h| PassPlan { speed_km_h }).collect(),
            recorded_m: ends.map(|span| span as f64 * SPACING_M),
            left_out,
            chain: Chain::default(),
            assumptions: Assumptions::default(),
            nuisances: Nuisances::default(),
        }
    }

    /// A sleeper of the scene, without what is added to it.
    fn under(&self, number: usize) -> SceneSleeper {
        let [railpad_stiffness_n_m, ballast_stiffness_n_m] = self.stiffness[number - 1];
        SceneSleeper { railpad_stiffness_n_m, ballast_stiffness_n_m, sleeper_ei_n_m2: BENDING_N_M2 }
    }
}

/// Place of a sleeper of the scene in m, by its index.
fn scene_m(index: usize) -> f64 {
    (index + 1) as f64 * SPACING_M
}

fn joints(numbers: &[usize]) -> impl Iterator<Item = Hidden> + '_ {
    numbers.iter().enumerate().filter_map(|(index, number)| {
        let joint = JOINTS.iter().find(|joint| joint.after == *number)?;
        Some(Hidden::RailJoint {
            x_m: [scene_m(index) + 0.5 * SPACING_M; 2],
            dip_m: joint.dip_m,
            length_m: joint.length_m,
            bending_factor: joint.bending_factor,
            bending_length_m: JOINT_LENGTH_M,
        })
    })
}

/// Stretches of the scene under rails 1 and 3; the outer ones end half a span before the track's ends.
fn rough_rails(numbers: &[usize]) -> Vec<RoughRail> {
    let mut rails = Vec::new();
    let mut first = 0;
    for alike in numbers.chunk_by(|a, b| rail(*a) == rail(*b)) {
        let after = first + alike.len();
        if is_rough(rail(alike[0])) {
            let x_m = [scene_m(first) - 0.5 * SPACING_M, scene_m(after) - 0.5 * SPACING_M];
            rails.push(RoughRail { x_m, level_factor: ROUGH_LEVEL, band_factor: ROUGH_BAND });
        }
        first = after;
    }
    rails
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(first: usize, last: usize) -> Ring {
        let stretch = Stretch { first, last };
        Ring::new(Plan { seed: 1, laps: 2, speeds_km_h: vec![10.0, 13.0], stretch })
    }

    #[test]
    fn the_ring_is_that_of_the_paper() {
        let truth = ring(1, 100).truth();
        assert_eq!((truth.sleepers.len(), truth.joints.len(), truth.gaps.len()), (100, 4, 6));
        let clamped: Vec<usize> =
            truth.sleepers.iter().filter(|it| it.clamp).map(|it| it.number).collect();
        assert!([76, 92, 96, 4].iter().all(|number| clamped.contains(number)));
        let gaps = clamped.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(gaps.chain([clamped[0] + SLEEPERS - 100]).all(|gap| gap == 3 || gap == 4));
        let special = |wanted: fn(&SleeperTruth) -> bool| -> Vec<&str> {
            truth.sleepers.iter().filter(|it| wanted(it)).map(|it| it.id.as_str()).collect()
        };
        assert_eq!(special(|it| it.missing_railpad), ["SN91"]);
        assert_eq!(special(|it| !it.bolt), ["SN94"]);
        assert!(truth.gaps.contains(&94));
        let damping = |index: usize| truth.sleepers[index].values[&Parameter::RailpadDamping];
        assert!((500.0..1000.0).contains(&damping(90)) && damping(89) == RAILPAD_DAMPING_N_S_M);
        // The irregularity of rail 1 was measured between SN91 and SN96.
        assert!(truth.sleepers[90..96].iter().all(|it| it.rail == 1) && rail(12) == 1);
        assert_eq!([rail(13), rail(38), rail(63), rail(87), rail(88)], [2, 3, 4, 4, 1]);
    }

    #[test]
    fn a_stretch_has_the_sleepers_of_the_whole_ring_and_continues_it_beyond() {
        let (part, whole) = (ring(86, 98), ring(1, 100));
        assert_eq!(part.truth().sleepers, whole.truth().sleepers[85..98]);
        let scene = part.scene();
        scene.check().unwrap();
        assert_eq!(scene.sleepers.len(), 13 + 2 * BESIDE);
        assert_eq!(scene.sleepers[BESIDE + 20], whole.under(6));
        let missing = scene.left_out.iter().find(|it| it.physics() == "missing_railpad").unwrap();
        assert_eq!(missing.sleepers(), Some(&[BESIDE + 5][..]));
        whole.scene().check().unwrap();
        assert_eq!(whole.scene().rough_rails.len(), 3);
    }

    #[test]
    fn a_recording_has_the_names_and_places_of_the_ring() {
        let recording = ring(86, 92).record().unwrap();
        let ids: Vec<_> = recording.sleepers.iter().map(|it| it.id.as_str()).collect();
        assert_eq!(ids, ["SN86", "SN87", "SN88", "SN89", "SN90", "SN91", "SN92"]);
        assert_eq!(recording.sleepers[0].x_m, 85.0 * SPACING_M);
        assert_eq!(recording.passes.len(), 4);
        let positions = &recording.passes[0].position_m;
        assert!((positions[0] - (85.0 - 3.0) * SPACING_M).abs() < 0.01, "{}", positions[0]);
    }
}
