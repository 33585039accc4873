//! All passes of a scene, written as a recording; it contains no information on the hidden physics.

use crate::TruthError;
use crate::chain::{measure, turn};
use crate::pass::{self, Drive};
use crate::rough_rail::BAND_M;
use crate::scene::Scene;
use crate::surface::{Irregularity, WAVES_M, WheelAngle};
use crate::track::{Track, seat_m};
use crate::vtrack::{self, SPACING_M};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::f64::consts::TAU;
use std::path::Path;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper};

/// Way in m before the recorded stretch over which the wheel runs in.
const RUN_IN_M: f64 = 3.0 * SPACING_M;
/// Way in m behind it, so that the filter has something to hold on to.
const RUN_OUT_M: f64 = 0.002;

/// Simulates every pass of a scene and writes the folder of the recording: `recording.json` and one
/// Parquet file per pass.
///
/// Passes run in parallel. All results depend only on the scene and its seed.
///
/// # Errors
/// [`TruthError`] if the scene is invalid or the folder cannot be written.
pub fn record(scene: &Scene, folder: &Path) -> Result<(), TruthError> {
    let recording = simulate(scene)?;
    Ok(recording.write(folder)?)
}

/// Simulates every pass of a scene. Returns the recording in memory, without a name.
///
/// # Errors
/// [`TruthError`] if the scene is invalid.
pub fn simulate(scene: &Scene) -> Result<Recording, TruthError> {
    vtrack::check(scene)?;
    let track = Track::new(scene);
    let shared = irregularity(scene, 0);
    let pass = |number: usize| one_pass(scene, &track, &shared, number);
    let passes: Result<Vec<Pass>, TruthError> =
        (0..scene.passes.len()).into_par_iter().map(pass).collect();
    Ok(Recording {
        name: String::new(),
        sample_rate_hz: (0.5 / track.step_s).round(),
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: passes?,
        sleepers: sleepers(scene),
        nominal: nominal(),
        spacing_m: SPACING_M,
        doubts: Vec::new(),
    })
}

fn one_pass(
    scene: &Scene,
    track: &Track,
    shared: &Irregularity,
    number: usize,
) -> Result<Pass, TruthError> {
    let mut random = stream(scene, 2 * number as u64 + 2);
    let deviation: f64 = StandardNormal.sample(&mut random);
    let speed_km_h = scene.passes[number].speed_km_h;
    let [from_m, to_m] = scene.recorded_m;
    let drive = Drive {
        speed_m_s: speed_km_h / 3.6 * (1.0 + scene.chain.speed_deviation * deviation),
        start_m: from_m - RUN_IN_M,
        end_m: to_m + RUN_OUT_M,
        angle: WheelAngle { rolled_m: TAU * vtrack::WHEEL_RADIUS_M * turn(&mut random) },
    };
    let own = irregularity(scene, 2 * number as u64 + 1);
    let surface = shared.blend(&own, scene.chain.unrepeated);
    let driven = pass::run(track, scene, &drive, |x_m| surface.height(x_m))?;
    let measured = measure(scene, number, &driven, &mut random);
    let signal = Signal::new(measured.sample_rate_hz, measured.acceleration_m_s2)
        .expect("a pass whose forces are finite is");
    Ok(Pass {
        file: String::new(),
        speed_km_h,
        axle: None,
        signal,
        position_m: measured.position_m,
        contact_loss_share: None,
    })
}

/// First stream of the rough rails' band; those of passes are far below.
const BAND_STREAMS: u64 = 1 << 32;

/// An irregularity of a scene: 0 for the one that all passes share.
fn irregularity(scene: &Scene, number: u64) -> Irregularity {
    let drawn = |waves_m, stream_number| {
        let random = &mut stream(scene, stream_number);
        let (level, nuisances) = (scene.irregularity_level, &scene.nuisances);
        Irregularity::draw(level, scene.length_m(), waves_m, nuisances, random)
    };
    let everywhere = drawn(WAVES_M, number);
    if scene.rough_rails.is_empty() {
        return everywhere;
    }
    everywhere.roughened(&scene.rough_rails, &drawn(BAND_M, BAND_STREAMS + number))
}

/// Random numbers of a scene: every stream is independent of the others.
fn stream(scene: &Scene, number: u64) -> ChaCha12Rng {
    let mut random = ChaCha12Rng::seed_from_u64(scene.seed);
    random.set_stream(number);
    random
}

/// The sleepers on the recorded stretch.
fn sleepers(scene: &Scene) -> Vec<Sleeper> {
    // Half a millimetre for the rounding of places.
    let [from_m, to_m] = [scene.recorded_m[0] - 5e-4, scene.recorded_m[1] + 5e-4];
    (0..scene.sleepers.len())
        .map(|number| Sleeper { id: format!("SN{number}"), x_m: seat_m(number) })
        .filter(|sleeper| (from_m..=to_m).contains(&sleeper.x_m))
        .collect()
}

/// What is known of rail, sleepers and wheel without measuring.
fn nominal() -> Map<String, Value> {
    let nominal = json!({
        "rail": {
            "profile": "S7", "area_m2": vtrack::RAIL_AREA_M2,
            "second_moment_m4": vtrack::RAIL_SECOND_MOMENT_M4, "youngs_Pa": vtrack::YOUNG_PA,
            "density_kg_m3": vtrack::DENSITY_KG_M3, "poisson": vtrack::POISSON,
            "shear_coefficient": vtrack::RAIL_SHEAR_COEFFICIENT,
        },
        "sleeper": {
            "spacing_m": SPACING_M, "half_length_m": vtrack::SLEEPER_HALF_LENGTH_M,
            "area_m2": vtrack::SLEEPER_AREA_M2, "density_kg_m3": vtrack::DENSITY_KG_M3,
        },
        "railhead_radius_m": vtrack::RAILHEAD_RADIUS_M,
        "wheel": {
            "mass_kg": vtrack::WHEEL_MASS_KG, "load_N": vtrack::WHEEL_LOAD_N,
            "radius_m": vtrack::WHEEL_RADIUS_M,
        },
    });
    match nominal {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::NOMINAL;
    use crate::{Assumptions, Chain, Hidden, Nuisances, PassPlan, Response, WheelOrder};

    fn short() -> Scene {
        let passes = [13.0, 13.0, 10.0].map(|speed_km_h| PassPlan { speed_km_h }).into();
        Scene { passes, chain: Chain::default(), ..Scene::uniform(16, NOMINAL) }
    }

    #[test]
    fn a_recording_can_be_read_and_does_not_tell_what_is_hidden() {
        let bolt = Hidden::SleeperBolt { sleepers: vec![8], stiffness_n_per_m: 3e7 };
        let scene = Scene { left_out: vec![bolt], ..short() };
        let folder = tempfile::tempdir().unwrap();
        record(&scene, folder.path()).unwrap();
        let recording = Recording::open(folder.path()).unwrap();
        assert_eq!(recording.speeds_km_h(), [10.0, 13.0]);
        assert_eq!(recording.sleepers.first().unwrap().id, "SN5");
        assert_eq!(recording.sleepers.last().unwrap().x_m, 1.25);
        let mut names: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let expected = [
            ".tracktwin.json",
            "pass-10kmh-1.parquet",
            "pass-13kmh-1.parquet",
            "pass-13kmh-2.parquet",
            "recording.json",
        ];
        assert_eq!(names, expected);
        let manifest = std::fs::read_to_string(folder.path().join("recording.json")).unwrap();
        assert!(!manifest.contains("bolt") && !manifest.contains("seed"));
    }

    #[test]
    fn nuisances_and_other_assumptions_change_a_recording_little() {
        let mut varied = short();
        varied.assumptions = Assumptions {
            modes_per_span: 8,
            steel_damping_ratio: 2e-3,
            relaxation_branches: 2,
            ..Assumptions::default()
        };
        varied.nuisances = Nuisances {
            railpad_exponent: 0.15,
            railpad_relaxation: 0.15,
            patch_half_length_m: 5e-5,
            wheel_orders: [WheelOrder { amplitude_m: 2e-6, angle_rad: 1.0 }; 4],
            response: Some(Response { ripple: 0.03, period_hz: 8e3 }),
            slow_noise_m_s2: 0.1,
            wheel_mass_factor: 0.98,
            contact_factor: 1.02,
            sleeper_mass_factor: 1.02,
            ..Nuisances::default()
        };
        let rms = |scene: &Scene| {
            let samples = simulate(scene).unwrap().passes.remove(0).signal.samples().to_vec();
            let power: f64 = samples.iter().map(|value| value * value).sum();
            (power / samples.len() as f64).sqrt()
        };
        let [plain, varied] = [short(), varied].map(|scene| rms(&scene));
        assert!(plain != varied && (varied / plain).ln().abs() < 0.15, "{plain} {varied}");
    }

    #[test]
    fn the_same_scene_gives_the_same_recording_and_passes_differ() {
        let [one, two] = [0; 2].map(|_| simulate(&short()).unwrap());
        assert_eq!(one.passes[0].signal, two.passes[0].signal);
        assert_eq!(one.passes[1].position_m, two.passes[1].position_m);
        assert_ne!(one.passes[0].signal, one.passes[1].signal);
        let other = simulate(&Scene { seed: 2, ..short() }).unwrap();
        assert_ne!(one.passes[0].signal, other.passes[0].signal);
    }
}
