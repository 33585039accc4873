//! Simulation of the recording of a scene.

use crate::chain::{Recorded, recorded};
use crate::contact::Contact;
use crate::defect::Tread;
use crate::limits;
use crate::nuisance::Nuisances;
use crate::pass::Rig;
use crate::scheme::STEP_S;
use crate::seat::seats;
use crate::surface::{Surface, shared};
use crate::track::Track;
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::Path;
use tracktwin_parameters::TrackDesign;
use tracktwin_reference_simulator::{SPACING_M, Scene, TruthError};
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper};

/// Simulates every pass of a scene and writes the folder of the recording: `recording.json` and one
/// Parquet file per pass.
///
/// Passes run in parallel. All results depend only on the scene and its seed.
///
/// # Errors
/// [`TruthError`] if the scene is invalid or the folder cannot be written.
pub fn record(scene: &Scene, folder: &Path) -> Result<(), TruthError> {
    Ok(simulate(scene)?.write(folder)?)
}

/// Simulates every pass of a scene. Returns the recording in memory, without a name.
///
/// # Errors
/// [`TruthError`] if the scene is invalid.
pub fn simulate(scene: &Scene) -> Result<Recording, TruthError> {
    scene.check()?;
    limits::check(scene)?;
    let design = TrackDesign::v_track();
    let nuisances = Nuisances::draw(scene.seed, scene.sleepers.len());
    let mut wheel = design.wheel.clone();
    wheel.mass_kg *= nuisances.wheel_mass;
    let rig = Rig {
        track: Track::new(scene, &design, &seats(scene, &nuisances)),
        vehicle: Vehicle::new(scene, &wheel)?,
        contact: Contact::new(&design, nuisances.contact),
        tread: Tread::new(scene, &nuisances, wheel.radius_m),
        load_n: wheel.load_n,
    };
    let shared = shared(scene);
    let pass = |index: usize| {
        let surface = Surface::of_pass(scene, &shared, index);
        let ride = rig.ride(scene, &surface, index)?;
        let Recorded { position_m, acceleration_m_s2 } = recorded(scene, &nuisances, &ride, index);
        let signal = Signal::new(SAMPLE_RATE_HZ, acceleration_m_s2)
            .map_err(|_| TruthError::Diverged { position_m: scene.recorded_m[0] })?;
        let speed_km_h = scene.passes[index].speed_km_h;
        let file = String::new();
        Ok(Pass { file, speed_km_h, signal, position_m, contact_loss_share: None })
    };
    let passes: Result<Vec<Pass>, TruthError> =
        (0..scene.passes.len()).into_par_iter().map(pass).collect();
    Ok(Recording {
        name: String::new(),
        sample_rate_hz: SAMPLE_RATE_HZ,
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: passes?,
        sleepers: sleepers(scene),
        nominal: nominal(&design),
        spacing_m: SPACING_M,
        doubts: Vec::new(),
    })
}

/// Samples per second.
const SAMPLE_RATE_HZ: f64 = 100_000.0;
const _: () = assert!(SAMPLE_RATE_HZ * STEP_S == 1.0);

/// The sleepers of the recorded stretch, at their nominal places.
fn sleepers(scene: &Scene) -> Vec<Sleeper> {
    let [from_m, to_m] = scene.recorded_m;
    let range = from_m - 1e-6..=to_m + 1e-6;
    let all = (0..scene.sleepers.len()).map(|number| (number, (number + 1) as f64 * SPACING_M));
    all.filter(|(_, x_m)| range.contains(x_m))
        .map(|(number, x_m)| Sleeper { id: format!("SN{number}"), x_m })
        .collect()
}

/// What is known of the rig.
fn nominal(design: &TrackDesign) -> Map<String, Value> {
    let (rail, sleeper, wheel) = (&design.rail, &design.sleeper, &design.wheel);
    let parts = [
        (
            "rail",
            json!({
                "profile": "S7",
                "area_m2": rail.area_m2,
                "second_moment_m4": rail.second_moment_m4,
                "youngs_Pa": rail.youngs_modulus_pa,
                "density_kg_m3": rail.density_kg_m3,
                "poisson": rail.poisson,
                "shear_coefficient": rail.shear_coefficient,
            }),
        ),
        (
            "sleeper",
            json!({
                "spacing_m": sleeper.spacing_m,
                "half_length_m": sleeper.half_length_m,
                "area_m2": sleeper.section.area_m2,
                "density_kg_m3": sleeper.section.density_kg_m3,
            }),
        ),
        ("railhead_radius_m", json!(design.railhead_radius_m)),
        (
            "wheel",
            json!({
                "mass_kg": wheel.mass_kg,
                "load_N": wheel.load_n,
                "radius_m": wheel.radius_m,
            }),
        ),
    ];
    parts.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
