//! Typical random test rigs: means inside the ranges of Table D1, unevenness, and sometimes a trend or a
//! step.

use crate::assumptions::Assumptions;
use crate::nuisances::Nuisances;
use crate::scene::{Chain, PassPlan, Scene, SleeperTruth};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use tracktwin_parameters::Preset;

/// Spans of a typical track, and what is recorded of it in m.
const SPANS: usize = 40;
const RECORDED_M: [f64; 2] = [0.75, 4.25];
/// Speeds in km/h, each twice.
const SPEEDS_KM_H: [f64; 3] = [13.0, 10.0, 7.0];
/// Means: railpad and ballast stiffness in N/m, bending stiffness in N m2, dampings in N s/m.
const RAILPAD_N_M: [f64; 2] = [0.8e8, 2.4e8];
const BALLAST_N_M: [f64; 2] = [0.7e7, 1.8e7];
const BENDING_N_M2: [f64; 2] = [4200.0, 6300.0];
const RAILPAD_DAMPING: [f64; 2] = [4.5e3, 8e3];
const BALLAST_DAMPING: [f64; 2] = [500.0, 1200.0];
/// Level of the irregularity in 1e-4 m2 rad/m.
const LEVEL: [f64; 2] = [1.5, 5.0];
/// Scatter of the stiffnesses from sleeper to sleeper, and of the bending stiffness.
const SCATTER: f64 = 0.05;
const BENDING_SCATTER: f64 = 0.02;
/// Largest trend or step of the ballast stiffness over the track, of its mean.
const VARIATION: f64 = 0.3;

/// How the ballast stiffness runs along the track.
#[derive(Clone, Copy)]
pub(crate) enum Run {
    Level,
    Trend(f64),
    Step { change: f64, at: f64 },
}

impl Run {
    pub(crate) fn draw(random: &mut ChaCha12Rng) -> Self {
        let change = VARIATION * within([-1.0, 1.0], random);
        match within([0.0, 5.0], random) {
            draw if draw < 3.0 => Self::Level,
            draw if draw < 4.0 => Self::Trend(change),
            _ => Self::Step { change, at: within([0.35, 0.65], random) },
        }
    }

    /// Factor on the mean at a share of the way, 0 to 1.
    pub(crate) fn factor(self, way: f64) -> f64 {
        match self {
            Self::Level => 1.0,
            Self::Trend(change) => 1.0 + change * (way - 0.5),
            Self::Step { change, at } => 1.0 + 0.5 * if way < at { -change } else { change },
        }
    }
}

impl Scene {
    /// A random V-Track without hidden effects, drawn from a seed: 40 spans, two passes at each of 13, 10
    /// and 7 km/h, and a usual measuring chain.
    ///
    /// Means are inside the ranges of Table D1 (Shen et al. 2023). The unevenness of the stiffnesses is
    /// 5 %. On two tracks of five the ballast stiffness has a trend or a step of up to 30 %. The track
    /// model of the diagnosis includes these variations, so they are not left-out physics.
    pub fn typical(seed: u64) -> Self {
        let random = &mut ChaCha12Rng::seed_from_u64(seed);
        let [railpad, ballast, bending] =
            [RAILPAD_N_M, BALLAST_N_M, BENDING_N_M2].map(|range| within(range, random));
        let run = Run::draw(random);
        let sleeper = |number: usize| SleeperTruth {
            railpad_stiffness_n_m: railpad * scattered(SCATTER, random),
            ballast_stiffness_n_m: ballast
                * run.factor((number + 1) as f64 / SPANS as f64)
                * scattered(SCATTER, random),
            sleeper_ei_n_m2: bending * scattered(BENDING_SCATTER, random),
        };
        let sleepers = (0..SPANS - 1).map(sleeper).collect();
        Self {
            preset: Preset::VTrack,
            spans: SPANS,
            seed,
            irregularity_level: within(LEVEL, random),
            rough_rails: Vec::new(),
            sleepers,
            railpad_damping_n_s_m: within(RAILPAD_DAMPING, random),
            ballast_damping_n_s_m: within(BALLAST_DAMPING, random),
            passes: SPEEDS_KM_H
                .iter()
                .flat_map(|&speed_km_h| [PassPlan { speed_km_h }; 2])
                .collect(),
            recorded_m: RECORDED_M,
            left_out: Vec::new(),
            chain: Chain::default(),
            assumptions: Assumptions::default(),
            nuisances: Nuisances::default(),
        }
    }
}

impl Scene {
    /// A typical track whose railpad and ballast stiffness differ from sleeper to sleeper by a
    /// `scatter` (standard deviation of the logarithm) and have no trend.
    pub fn uneven(seed: u64, scatter: f64) -> Self {
        let mut scene = Self::typical(seed);
        let random = &mut ChaCha12Rng::seed_from_u64(seed ^ scatter.to_bits());
        let [railpad, ballast] = [RAILPAD_N_M, BALLAST_N_M].map(|range| within(range, random));
        for sleeper in &mut scene.sleepers {
            sleeper.railpad_stiffness_n_m = railpad * scattered(scatter, random);
            sleeper.ballast_stiffness_n_m = ballast * scattered(scatter, random);
        }
        scene
    }
}

pub(crate) fn within([low, high]: [f64; 2], random: &mut ChaCha12Rng) -> f64 {
    Uniform::new(low, high).expect("low is below high").sample(random)
}

/// A factor about one that stays positive.
pub(crate) fn scattered(deviation: f64, random: &mut ChaCha12Rng) -> f64 {
    let draw: f64 = StandardNormal.sample(random);
    (deviation * draw).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typical_tracks_can_be_driven_over_and_lie_inside_table_d1() {
        for seed in 0..200 {
            let scene = Scene::typical(seed);
            scene.check().unwrap();
            for sleeper in &scene.sleepers {
                assert!((10e6..300e6).contains(&sleeper.railpad_stiffness_n_m));
                assert!((4e6..22e6 * 1.1).contains(&sleeper.ballast_stiffness_n_m));
                assert!((3543.0..7086.0).contains(&sleeper.sleeper_ei_n_m2));
            }
        }
    }

    #[test]
    fn uneven_tracks_scatter_by_what_was_asked_for() {
        for scatter in [0.05, 0.3] {
            let scene = Scene::uneven(3, scatter);
            scene.check().unwrap();
            let logarithms: Vec<f64> =
                scene.sleepers.iter().map(|it| it.ballast_stiffness_n_m.ln()).collect();
            let count = logarithms.len() as f64;
            let mean = logarithms.iter().sum::<f64>() / count;
            let square: f64 = logarithms.iter().map(|value| (value - mean).powi(2)).sum();
            // Thirty-nine sleepers know a deviation to 11 %.
            assert!(((square / count).sqrt() / scatter - 1.0).abs() < 0.35);
        }
    }

    #[test]
    fn a_seed_is_a_track() {
        assert_eq!(Scene::typical(5), Scene::typical(5));
        assert_ne!(Scene::typical(5).sleepers, Scene::typical(6).sleepers);
    }
}
