//! Typical random lines: means within the usual ranges of a preset, scatter as measured on tracks, and
//! sometimes a trend or a step.

use crate::assumptions::Assumptions;
use crate::nuisances::Nuisances;
use crate::scene::{Chain, PassPlan, Scene, SleeperTruth};
use crate::typical::{Run, scattered, within};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use tracktwin_parameters::{Parameter, Preset, Track};

/// Spans of a line, and the spans where its recording begins and ends: 39 sleepers. The run-in and a wheel
/// 2.56 m behind have room before them.
const SPANS: usize = 60;
const RECORDED_SPANS: [f64; 2] = [12.0, 50.0];
/// Share of the usual range, in the logarithm, at either end from which no mean is drawn.
const RARE: f64 = 0.2;
/// Loss factor of the railpads at the frequency in Hz at which rails resonate on them (Thompson, Railway
/// Noise and Vibration, 2009: 0.1 to 0.25 for most pads; models that fit measured decay rates have more).
const RAILPAD_LOSS: [f64; 2] = [0.15, 0.4];
const RAILPAD_LOSS_HZ: f64 = 400.0;
/// Level of eq. B.6 in 1e-4 m2 rad/m. With a spectrum that falls with the cube of the wave number above
/// 8 rad/m, waves of 0.1 m are 3 to 14 dB above the limit of ISO 3095:2013.
const LEVEL: [f64; 2] = [0.05, 0.6];
/// Standard deviation of the logarithm of railpad and ballast stiffness from sleeper to sleeper, and over how
/// many sleepers the ballast's correlation falls to 1/e (scatter of track properties: Oscarsson 2002, Vehicle
/// System Dynamics 37).
const RAILPAD_SCATTER: [f64; 2] = [0.05, 0.15];
const BALLAST_SCATTER: [f64; 2] = [0.1, 0.2];
const CORRELATED: [f64; 2] = [1.0, 6.0];
/// Standard deviation of the logarithm of the bending stiffness.
const BENDING_SCATTER: f64 = 0.03;
/// Noise and resolution of a recorder of 16 bits over some 50 g, in m/s2.
const NOISE_M_S2: f64 = 0.05;
const STEP_M_S2: f64 = 0.02;
/// Largest wander of an odometer between two known places in m.
const WANDER_M: [f64; 2] = [3e-3, 1e-2];
/// Standard deviation of the ratio of true to stated speed.
const SPEED_DEVIATION: f64 = 0.01;

impl Scene {
    /// A random line of a preset, drawn from a seed, without hidden effects: 60 spans, two passes at each of
    /// the preset's speeds from the highest on, and a usual measuring chain.
    ///
    /// Means are inside the preset's usual ranges, but for a fifth of the logarithm at either end. On two
    /// lines of five the ballast stiffness has a trend or a step of up to 30 %.
    pub fn typical_line(preset: Preset, seed: u64) -> Self {
        let track = preset.track();
        let random = &mut ChaCha12Rng::seed_from_u64(seed);
        let mean =
            |parameter, random: &mut ChaCha12Rng| log_within(usual(&track, parameter), random);
        let railpad = mean(Parameter::RailpadStiffness, random);
        let ballast = mean(Parameter::BallastStiffness, random);
        let bending = mean(Parameter::SleeperBendingStiffness, random);
        let loss = within(RAILPAD_LOSS, random);
        let ballast_damping_n_s_m = mean(Parameter::BallastDamping, random);
        let irregularity_level = log_within(LEVEL, random);
        let run = Run::draw(random);
        let railpad_scatter = within(RAILPAD_SCATTER, random);
        let mut ballast_scatter = Correlated::draw(random);
        let sleeper = |number: usize| SleeperTruth {
            railpad_stiffness_n_m: railpad * scattered(railpad_scatter, random),
            ballast_stiffness_n_m: ballast
                * run.factor((number + 1) as f64 / SPANS as f64)
                * ballast_scatter.next(random),
            sleeper_ei_n_m2: bending * scattered(BENDING_SCATTER, random),
        };
        let sleepers = (0..SPANS - 1).map(sleeper).collect();
        let descending = track.speeds_km_h.iter().rev();
        let spacing_m = track.design.sleeper.spacing_m;
        Self {
            preset,
            spans: SPANS,
            seed,
            irregularity_level,
            rough_rails: Vec::new(),
            sleepers,
            railpad_damping_n_s_m: loss * railpad / (TAU * RAILPAD_LOSS_HZ),
            ballast_damping_n_s_m,
            passes: descending.flat_map(|&speed_km_h| [PassPlan { speed_km_h }; 2]).collect(),
            recorded_m: RECORDED_SPANS.map(|span| span * spacing_m),
            left_out: Vec::new(),
            chain: Chain {
                noise_m_s2: NOISE_M_S2,
                step_m_s2: STEP_M_S2,
                wander_m: log_within(WANDER_M, random),
                speed_deviation: SPEED_DEVIATION,
                ..Chain::default()
            },
            assumptions: Assumptions::default(),
            nuisances: Nuisances::default(),
        }
    }
}

/// The usual range of a parameter without its rare ends.
fn usual(track: &Track, parameter: Parameter) -> [f64; 2] {
    let [low, high] = track.ranges[parameter.index()];
    let width = high / low;
    [low * width.powf(RARE), high * width.powf(-RARE)]
}

/// Evenly in the logarithm.
fn log_within([low, high]: [f64; 2], random: &mut ChaCha12Rng) -> f64 {
    within([low.ln(), high.ln()], random).exp()
}

/// Factors of neighbouring sleepers: the logarithm is a Gaussian process of first order.
struct Correlated {
    deviation: f64,
    /// Correlation of neighbours.
    kept: f64,
    value: f64,
}

impl Correlated {
    fn draw(random: &mut ChaCha12Rng) -> Self {
        let deviation = within(BALLAST_SCATTER, random);
        let kept = (-1.0 / log_within(CORRELATED, random)).exp();
        Self { deviation, kept, value: StandardNormal.sample(random) }
    }

    fn next(&mut self, random: &mut ChaCha12Rng) -> f64 {
        let factor = (self.deviation * self.value).exp();
        let fresh: f64 = StandardNormal.sample(random);
        self.value = self.kept * self.value + (1.0 - self.kept * self.kept).sqrt() * fresh;
        factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TruthError;

    const LINES: [Preset; 6] = [
        Preset::Concrete60E1,
        Preset::SoftConcrete60E1,
        Preset::StiffConcrete60E1,
        Preset::Concrete54E1,
        Preset::Wood54E1,
        Preset::BiBlock49E1,
    ];

    #[test]
    fn typical_lines_can_be_driven_over_and_have_means_of_their_preset() {
        for (seed, preset) in (0..60).zip(LINES.into_iter().cycle()) {
            let scene = Scene::typical_line(preset, seed);
            scene.check().unwrap();
            let track = preset.track();
            let count = scene.sleepers.len() as f64;
            let mean =
                |of: fn(&SleeperTruth) -> f64| scene.sleepers.iter().map(of).sum::<f64>() / count;
            for (parameter, mean) in [
                (Parameter::RailpadStiffness, mean(|it| it.railpad_stiffness_n_m)),
                (Parameter::BallastStiffness, mean(|it| it.ballast_stiffness_n_m)),
                (Parameter::SleeperBendingStiffness, mean(|it| it.sleeper_ei_n_m2)),
            ] {
                let [low, high] = track.ranges[parameter.index()];
                assert!((low..high).contains(&mean), "{preset:?} {parameter}: {mean}");
            }
            let last = scene.passes.last().unwrap().speed_km_h;
            assert!(scene.passes.len() == 6 && scene.passes[0].speed_km_h > last);
        }
    }

    #[test]
    fn a_line_survives_its_file_and_the_reference_simulator_refuses_it() {
        let scene = Scene::typical_line(Preset::Concrete60E1, 3);
        let text = serde_json::to_string(&scene).unwrap();
        assert!(text.starts_with(r#"{"preset":"60E1-concrete","#), "{text}");
        assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), scene);
        assert!(
            (scene.recorded_m[0] - 7.2).abs() < 1e-9 && (scene.recorded_m[1] - 30.0).abs() < 1e-9
        );
        let refused = crate::simulate(&scene).unwrap_err();
        assert!(matches!(refused, TruthError::NoTrack { preset: "60E1-concrete" }), "{refused}");
    }
}
