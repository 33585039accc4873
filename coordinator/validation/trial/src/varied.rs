//! Random assumptions and nuisances of the makings `varied` and `second`.
//!
//! Nuisances are small. Every case of these makings has them, including controls. They are not hidden
//! effects.

use crate::effect::Draw;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use tracktwin_reference_simulator::{
    Assumptions, JointDip, Nuisances, Response, Scene, SquatHollow, Void, Waves, WheelOrder,
};

/// Modes of the rail to a span.
const MODES_PER_SPAN: [usize; 2] = [5, 8];
/// Damping of steel over critical damping.
const STEEL_DAMPING_RATIO: [f64; 2] = [4e-4, 3e-3];
/// Drift of a corrugation's wave number, either way, and its second harmonic.
const WAVE_DRIFT: [f64; 2] = [0.02, 0.15];
const WAVE_HARMONIC: [f64; 2] = [0.05, 0.3];

/// Exponent of the railpads by load, their relaxation over their stiffness, and its time in s.
const RAILPAD_EXPONENT: [f64; 2] = [0.0, 0.15];
const RAILPAD_RELAXATION: [f64; 2] = [0.0, 0.15];
const RELAXATION_TIME_S: [f64; 2] = [3e-5, 1e-3];
/// Half length of the contact patch in m.
const PATCH_M: [f64; 2] = [5e-5, 2e-4];
/// Standard deviation of the logarithm of railpad and ballast stiffness, and over how many sleepers
/// its correlation falls to 1/e.
const SCATTER: [f64; 2] = [0.05, 0.2];
const CORRELATED: [f64; 2] = [1.0, 3.0];
/// Amplitude of each of the wheel's first orders in m.
const ORDER_M: [f64; 2] = [2e-7, 2e-6];
/// Largest wander of the odometer in m.
const WANDER_M: [f64; 2] = [1e-3, 5e-3];
/// Ripple of the recorder, 0.3 dB at most, and its period in Hz.
const RIPPLE: f64 = 0.035;
const RIPPLE_PERIOD_HZ: [f64; 2] = [3e3, 2e4];
/// Slow noise of the recorder in m/s2.
const SLOW_NOISE_M_S2: [f64; 2] = [0.02, 0.1];
/// How far true values are from nominal ones.
const OFF_NOMINAL: f64 = 0.02;

/// What a varied case assumes: never the shapes of the catalogue.
pub(crate) fn assumptions(draw: &mut Draw<'_>) -> Assumptions {
    let dips = [JointDip::Parabola, JointDip::V, JointDip::OneSided];
    let sign = if draw.uniform(0, 2) == 0 { 1.0 } else { -1.0 };
    Assumptions {
        modes_per_span: MODES_PER_SPAN[draw.uniform(0, MODES_PER_SPAN.len())],
        steel_damping_ratio: draw.log_within(STEEL_DAMPING_RATIO),
        joint: dips[draw.uniform(0, dips.len())],
        squat: SquatHollow::Gaussian,
        corrugation: Waves {
            drift: sign * draw.within(WAVE_DRIFT),
            harmonic: draw.within(WAVE_HARMONIC),
        },
        void: Void { damping_share: draw.within([0.0, 1.0]), stays_open: draw.uniform(0, 2) == 0 },
        relaxation_branches: 2,
    }
}

/// Adds the nuisances of the reference simulator to a scene.
pub(crate) fn add_nuisances(scene: &mut Scene, draw: &mut Draw<'_>) {
    let factor = [1.0 - OFF_NOMINAL, 1.0 + OFF_NOMINAL];
    scene.nuisances = Nuisances {
        railpad_exponent: draw.within(RAILPAD_EXPONENT),
        railpad_relaxation: draw.within(RAILPAD_RELAXATION),
        railpad_relaxation_time_s: draw.log_within(RELAXATION_TIME_S),
        patch_half_length_m: draw.log_within(PATCH_M),
        wheel_orders: [0; 4].map(|_| WheelOrder {
            amplitude_m: draw.log_within(ORDER_M),
            angle_rad: draw.within([0.0, TAU]),
        }),
        response: Some(Response {
            ripple: draw.within([-RIPPLE, RIPPLE]),
            period_hz: draw.log_within(RIPPLE_PERIOD_HZ),
        }),
        slow_noise_m_s2: draw.log_within(SLOW_NOISE_M_S2),
        wheel_mass_factor: draw.within(factor),
        contact_factor: draw.within(factor),
        sleeper_mass_factor: draw.within(factor),
    };
}

/// Makes the odometer wander and the sleepers differ, as every simulator does it.
pub(crate) fn vary_track(scene: &mut Scene, draw: &mut Draw<'_>) {
    scene.chain.wander_m = draw.log_within(WANDER_M);
    let count = scene.sleepers.len();
    let [railpads, ballast] = [0; 2].map(|_| scatter(count, draw));
    for ((sleeper, railpad), ballast) in scene.sleepers.iter_mut().zip(railpads).zip(ballast) {
        sleeper.railpad_stiffness_n_m *= railpad;
        sleeper.ballast_stiffness_n_m *= ballast;
    }
}

/// A factor for each sleeper, of a logarithm that is a Gaussian process of first order.
fn scatter(sleepers: usize, draw: &mut Draw<'_>) -> Vec<f64> {
    let deviation = draw.within(SCATTER);
    let kept = (-1.0 / draw.within(CORRELATED)).exp();
    let fresh = (1.0 - kept * kept).sqrt();
    let mut normal = || -> f64 { StandardNormal.sample(draw.rng) };
    let mut value = normal();
    let factor = |_| {
        let factor = (deviation * value).exp();
        value = kept * value + fresh * normal();
        factor
    };
    (0..sleepers).map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::Site;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    fn with_draw<T>(seed: u64, make: impl FnOnce(&mut Draw<'_>) -> T) -> T {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        make(&mut Draw { level: 1.0, site: Site::RIG, rng })
    }

    fn is_in([low, high]: [f64; 2], value: f64) -> bool {
        (low..=high).contains(&value)
    }

    #[test]
    fn nuisances_are_within_their_bounds_and_hide_nothing() {
        for seed in 0..100 {
            let mut scene = Scene::typical(seed);
            with_draw(seed, |draw| {
                add_nuisances(&mut scene, draw);
                vary_track(&mut scene, draw);
            });
            scene.check().unwrap();
            assert!(scene.left_out.is_empty());
            let it = scene.nuisances;
            assert!(is_in(RAILPAD_EXPONENT, it.railpad_exponent));
            assert!(is_in(RAILPAD_RELAXATION, it.railpad_relaxation));
            assert!(is_in(PATCH_M, it.patch_half_length_m));
            assert!(it.wheel_orders.iter().all(|order| is_in(ORDER_M, order.amplitude_m)));
            let ripple_db = 20.0 * (1.0 + it.response.unwrap().ripple.abs()).log10();
            assert!(ripple_db <= 0.3, "{ripple_db}");
            assert!(is_in(SLOW_NOISE_M_S2, it.slow_noise_m_s2));
            for factor in [it.wheel_mass_factor, it.contact_factor, it.sleeper_mass_factor] {
                assert!((factor - 1.0).abs() <= OFF_NOMINAL);
            }
            assert!(is_in(WANDER_M, scene.chain.wander_m));
        }
    }

    #[test]
    fn assumptions_can_be_and_are_never_those_of_the_catalogue() {
        let usual = Assumptions::default();
        for seed in 0..100 {
            let made = with_draw(seed, assumptions);
            let scene = Scene { assumptions: made, ..Scene::typical(seed) };
            scene.check().unwrap();
            assert!(made.modes_per_span != usual.modes_per_span && made.joint != usual.joint);
            assert!(made.squat != usual.squat && made.corrugation != usual.corrugation);
            assert_ne!(made.relaxation_branches, usual.relaxation_branches);
        }
    }

    #[test]
    fn neighbours_scatter_alike() {
        // Mean squares and products of neighbours over many tracks.
        let (mut square, mut product, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..300 {
            let factors = with_draw(seed, |draw| scatter(39, draw));
            for pair in factors.windows(2) {
                square += pair[0].ln().powi(2);
                product += pair[0].ln() * pair[1].ln();
                count += 1.0;
            }
        }
        let deviation = (square / count).sqrt();
        assert!(is_in(SCATTER, deviation), "{deviation}");
        // exp(-1) to exp(-1/3).
        assert!(is_in([0.3, 0.75], product / square), "{}", product / square);
    }
}
