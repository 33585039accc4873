//! Without hidden effects, this simulator and the track model give the same levels over the same
//! surface.
//!
//! Both use the same irregularity, so levels have no random difference.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use tracktwin_parameters::TrackDesign;
use tracktwin_reference_simulator::{Drive, Scene, WheelAngle, drive};
use tracktwin_signal::{PowerSpectrum, Signal};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::{Pass, passes};

/// Where the wheel starts, and from where to where levels are taken, in m.
const START_M: f64 = 0.5;
const WINDOW_M: [f64; 2] = [1.25, 4.0];
/// Time in s of a segment of Welch's analysis at either rate.
const SEGMENT_S: f64 = 0.16384;

/// One-third octave levels over the window in dB, of samples so far apart in s.
fn levels(samples: &[f64], step_s: f64, speed_m_s: f64, centres: &[f64]) -> Vec<f64> {
    let index = |x_m: f64| ((x_m - START_M) / (speed_m_s * step_s)) as usize;
    let kept = samples[index(WINDOW_M[0])..index(WINDOW_M[1])].to_vec();
    let signal = Signal::new((1.0 / step_s).round(), kept).unwrap();
    let segment = (SEGMENT_S / step_s).round() as usize;
    let spectrum = PowerSpectrum::welch(&signal, segment).unwrap();
    centres.iter().map(|&centre| spectrum.third_octave_level(centre).unwrap()).collect()
}

/// Their levels less ours, by band.
fn differences(scene: &Scene, speed_km_h: f64, seed: u64, centres: &[f64]) -> Vec<f64> {
    let surface = Surface::rough(seed, scene.irregularity_level, scene.length_m());
    let speed_m_s = speed_km_h / 3.6;
    let way = Drive {
        speed_m_s,
        start_m: START_M,
        end_m: WINDOW_M[1] + 0.01,
        angle: WheelAngle::default(),
    };
    let ours = drive(scene, &way, |x_m| surface.height(x_m)).unwrap();
    let support = |sleeper: &tracktwin_reference_simulator::SleeperTruth| Support {
        railpad_stiffness: sleeper.railpad_stiffness_n_m,
        railpad_damping: scene.railpad_damping_n_s_m,
        ballast_stiffness: sleeper.ballast_stiffness_n_m,
        ballast_damping: scene.ballast_damping_n_s_m,
        sleeper_bending_stiffness: sleeper.sleeper_ei_n_m2,
    };
    let supports: Vec<Support> = scene.sleepers.iter().map(support).collect();
    let mesh = Mesh::uniform(scene.spans, 8, 8);
    let model = TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[]).unwrap();
    let pass = Pass {
        speed_m_s,
        start_m: START_M,
        end_m: way.end_m,
        time_step_s: 1e-5,
        local_flexibility: true,
    };
    let theirs = passes(&[model], &pass, &[surface]).unwrap().remove(0);
    let ours = levels(&ours.acceleration_m_s2, ours.time_step_s, speed_m_s, centres);
    let theirs = levels(&theirs.acceleration_m_s2, 1e-5, speed_m_s, centres);
    ours.iter().zip(&theirs).map(|(a, b)| b - a).collect()
}

#[test]
fn levels_of_one_surface_agree_with_the_twins() {
    let centres: Vec<f64> =
        (0..17).map(|band| 100.0 * 10_f64.powf(f64::from(band) / 10.0)).collect();
    for seed in [3, 4] {
        let scene = Scene::typical(seed);
        for speed_km_h in [13.0, 7.0] {
            let off = differences(&scene, speed_km_h, seed, &centres);
            let table: Vec<String> =
                centres.iter().zip(&off).map(|(f, d)| format!("{f:.0}:{d:+.2}")).collect();
            println!("track {seed}, {speed_km_h} km/h: {}", table.join(" "));
            // Two discretisations of one track; docs/reference-simulator.md explains the rest.
            assert!(off.iter().all(|difference| difference.abs() < 1.0), "{off:?}");
        }
    }
}
