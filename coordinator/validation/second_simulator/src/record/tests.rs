use super::*;
use std::fmt::Write;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::{PassPlan, SleeperTruth};
use tracktwin_signal::PowerSpectrum;

/// Surfaces of the comparison.
const SURFACES: u64 = 4;
/// Allowed difference in dB beside the chance of the surfaces: contacts differ by 8 % in stiffness, and waves of
/// 3 m fade here.
const TOLERANCE_DB: f64 = 0.8;

/// A scene of the reference's parameters, and its design.
fn reference(file: &Value, seed: u64) -> (Scene, TrackDesign) {
    let of = |name: &str| file["parameters"][name].as_f64().unwrap();
    let sleeper = SleeperTruth {
        railpad_stiffness_n_m: of("railpad_stiffness_N_m"),
        ballast_stiffness_n_m: of("ballast_stiffness_N_m"),
        sleeper_ei_n_m2: of("sleeper_EI_N_m2"),
    };
    let window = &file["window_m"];
    let scene = Scene {
        preset: Preset::Concrete60E1,
        seed,
        irregularity_level: of("irregularity_level"),
        railpad_damping_n_s_m: of("railpad_damping_N_s_m"),
        ballast_damping_n_s_m: of("ballast_damping_N_s_m"),
        recorded_m: [window[0].as_f64().unwrap(), window[1].as_f64().unwrap()],
        passes: vec![PassPlan { speed_km_h: 80.0 }],
        ..Scene::uniform(70, sleeper)
    };
    let nominal = &file["nominal"];
    let mut design = scene.design();
    design.rail_damping_s = nominal["rail_damping_s"].as_f64().unwrap();
    design.sleeper.rail_seat_m = nominal["sleeper"]["rail_seat_m"].as_f64().unwrap();
    design.sleeper.section.area_m2 = nominal["sleeper"]["area_m2"].as_f64().unwrap();
    design.sleeper.section.density_kg_m3 = nominal["sleeper"]["density_kg_m3"].as_f64().unwrap();
    design.wheel.load_n = nominal["wheel"]["load_N"].as_f64().unwrap();
    design.wheel.further_wheels_m.clear();
    (scene, design)
}

/// Density of the accelerations in one-third octaves, of a rig without any deviation on a surface of eq. B.6.
fn densities(scene: &Scene, design: &TrackDesign, centres_hz: &[f64]) -> Vec<f64> {
    let mut scale = Scale::of(scene);
    scale.rail_damping_s = design.rail_damping_s;
    scale.speed_drift = 0.0;
    let nuisances = Nuisances::none(scene);
    let rig = rig(scene, design, &scale, &nuisances).unwrap();
    let texture = Texture::line(4.0, 0.0, design.wheel.radius_m, scale.grid_m);
    let ground = Ground::new(scene, &scale, &texture);
    let ride = rig.ride(scene, &ground.of_pass(0), 0).unwrap();
    let values = recorded(scene, &scale, &nuisances, &ride, 0).acceleration_m_s2;
    let signal = Signal::new(scale.sample_rate_hz, values).unwrap();
    let spectrum = PowerSpectrum::welch(&signal, 4096).unwrap();
    let sixth = 2.0_f64.powf(1.0 / 6.0);
    let density = |hz: &f64| spectrum.mean_density(hz / sixth, hz * sixth).unwrap();
    centres_hz.iter().map(density).collect()
}

#[test]
fn levels_on_a_line_are_those_of_a_simulator_that_shares_nothing() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/reference/levels/line-A.json");
    let file: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let centres_hz = numbers(&file["centre_Hz"]);
    let expected = numbers(&file["speeds"]["80"]["level_dB"]);
    let errors = numbers(&file["speeds"]["80"]["standard_error_dB"]);
    let surfaces: Vec<Vec<f64>> = (1..=SURFACES)
        .into_par_iter()
        .map(|seed| {
            let (scene, design) = reference(&file, seed);
            densities(&scene, &design, &centres_hz)
        })
        .collect();
    let mut table = String::new();
    let mut is_near = true;
    for (band, hz) in centres_hz.iter().enumerate().filter(|(_, hz)| (39.0..4100.0).contains(*hz)) {
        let levels: Vec<f64> = surfaces.iter().map(|it| 10.0 * it[band].log10()).collect();
        let mean = levels.iter().sum::<f64>() / SURFACES as f64;
        // Ten surfaces there, fewer here.
        let error = errors[band] * (1.0 + 10.0 / SURFACES as f64).sqrt();
        let difference = mean - expected[band];
        is_near &= difference.abs() <= TOLERANCE_DB + 2.0 * error;
        writeln!(table, "{hz:7.1} Hz {mean:7.2} dB, {difference:+5.2}, chance {error:.2}").unwrap();
    }
    assert!(is_near, "\n{table}");
}
