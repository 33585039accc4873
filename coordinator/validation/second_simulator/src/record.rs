//! Simulation of the recording of a scene.

use crate::chain::{Recorded, recorded};
use crate::contact::Contact;
use crate::defect::Tread;
use crate::limits;
use crate::nuisance::Nuisances;
use crate::pass::{Rig, RigWheel};
use crate::scale::Scale;
use crate::seat::seats;
use crate::sleeper::Layout;
use crate::surface::Ground;
use crate::texture::{Texture, patch_half_length_m};
use crate::track::Track;
use crate::vehicle::Vehicle;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::Path;
use tracktwin_parameters::TrackDesign;
use tracktwin_reference_simulator::{Hidden, Scene, TruthError};
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
    let design = scene.design();
    let scale = Scale::of(scene);
    check_wheels(scene, &design, &scale)?;
    let nuisances = Nuisances::draw(scene, &scale, design.wheel.further_wheels_m.len());
    let texture = texture(&design, &scale, &nuisances);
    let rig = rig(scene, &design, &scale, &nuisances)?;
    let ground = Ground::new(scene, &scale, &texture);
    let pass = |index: usize| {
        let ride = rig.ride(scene, &ground.of_pass(index), index)?;
        let Recorded { position_m, acceleration_m_s2 } =
            recorded(scene, &scale, &nuisances, &ride, index);
        let signal = Signal::new(scale.sample_rate_hz, acceleration_m_s2)
            .map_err(|_| TruthError::Diverged { position_m: scene.recorded_m[0] })?;
        let speed_km_h = scene.passes[index].speed_km_h;
        let file = String::new();
        Ok(Pass { file, speed_km_h, axle: None, signal, position_m, contact_loss_share: None })
    };
    let passes: Result<Vec<Pass>, TruthError> =
        (0..scene.passes.len()).into_par_iter().map(pass).collect();
    Ok(Recording {
        name: String::new(),
        sample_rate_hz: scale.sample_rate_hz,
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: passes?,
        sleepers: sleepers(scene, scale.spacing_m),
        nominal: nominal(&design, &scale),
        spacing_m: scale.spacing_m,
        doubts: Vec::new(),
    })
}

/// Checks that all wheels are on the track from the run-in on.
fn check_wheels(scene: &Scene, design: &TrackDesign, scale: &Scale) -> Result<(), TruthError> {
    let [from_m, to_m] = scene.recorded_m;
    let length_m = scene.length_m();
    let ahead = || design.wheel.further_wheels_m.iter().copied();
    let behind_m = scale.run_in_m - ahead().fold(0.0, f64::min);
    let ahead_m = ahead().fold(0.0, f64::max);
    if behind_m <= from_m && to_m + ahead_m <= length_m {
        return Ok(());
    }
    Err(TruthError::Recorded { from_m, to_m, end_m: behind_m.max(ahead_m), length_m })
}

/// Track, wheels and contact of a scene.
fn rig(
    scene: &Scene,
    design: &TrackDesign,
    scale: &Scale,
    nuisances: &Nuisances,
) -> Result<Rig, TruthError> {
    let mut wheel = design.wheel.clone();
    wheel.mass_kg *= nuisances.wheel_mass;
    let layout = Layout::new(&design.sleeper, nuisances.middle_bed);
    let of = |ahead_m: f64, left_out: &[Hidden], orders: &[[f64; 2]]| -> Result<_, TruthError> {
        let vehicle = Vehicle::new(left_out, &wheel)?;
        let tread = Tread::new(left_out, orders, wheel.radius_m);
        Ok(RigWheel { ahead_m, vehicle, tread })
    };
    let mut wheels = vec![of(0.0, &scene.left_out, &nuisances.orders)?];
    for (&ahead_m, orders) in wheel.further_wheels_m.iter().zip(&nuisances.further_orders) {
        // What is hidden in a wheel is in the recorded one.
        wheels.push(of(ahead_m, &[], orders)?);
    }
    wheels.sort_by(|a, b| a.ahead_m.total_cmp(&b.ahead_m));
    Ok(Rig {
        track: Track::new(scene, design, scale, &layout, &seats(scene, nuisances)),
        wheels,
        contact: Contact::new(design, nuisances.contact),
        load_n: wheel.load_n,
        scale: scale.clone(),
    })
}

/// What makes the surface of a line; nothing on the rig.
fn texture(design: &TrackDesign, scale: &Scale, nuisances: &Nuisances) -> Texture {
    if !scale.is_line {
        return Texture::default();
    }
    let patch_m = if design.contact_patch_filter {
        nuisances.patch * patch_half_length_m(design)
    } else {
        0.0
    };
    Texture::line(nuisances.exponent, patch_m, design.wheel.radius_m, scale.grid_m)
}

/// The sleepers of the recorded stretch, at their nominal places.
fn sleepers(scene: &Scene, spacing_m: f64) -> Vec<Sleeper> {
    let [from_m, to_m] = scene.recorded_m;
    let range = from_m - 1e-6..=to_m + 1e-6;
    let all = (0..scene.sleepers.len()).map(|number| (number, (number + 1) as f64 * spacing_m));
    all.filter(|(_, x_m)| range.contains(x_m))
        .map(|(number, x_m)| Sleeper { id: format!("SN{number}"), x_m })
        .collect()
}

/// What is known of track and vehicle.
fn nominal(design: &TrackDesign, scale: &Scale) -> Map<String, Value> {
    let (rail, sleeper, wheel) = (&design.rail, &design.sleeper, &design.wheel);
    let mut nominal = json!({
        "rail": {
            "area_m2": rail.area_m2,
            "second_moment_m4": rail.second_moment_m4,
            "youngs_Pa": rail.youngs_modulus_pa,
            "density_kg_m3": rail.density_kg_m3,
            "poisson": rail.poisson,
            "shear_coefficient": rail.shear_coefficient,
        },
        "sleeper": {
            "spacing_m": sleeper.spacing_m,
            "half_length_m": sleeper.half_length_m,
            "area_m2": sleeper.section.area_m2,
            "density_kg_m3": sleeper.section.density_kg_m3,
        },
        "railhead_radius_m": design.railhead_radius_m,
        "wheel": {
            "mass_kg": wheel.mass_kg,
            "load_N": wheel.load_n,
            "radius_m": wheel.radius_m,
        },
    });
    if scale.is_line {
        nominal["sleeper"]["rail_seat_m"] = json!(sleeper.rail_seat_m);
        nominal["sleeper"]["second_moment_m4"] = json!(sleeper.section.second_moment_m4);
        nominal["sleeper"]["youngs_Pa"] = json!(sleeper.section.youngs_modulus_pa);
        // Null: there is no other wheel near.
        let other_m = wheel.further_wheels_m.first().map(|ahead_m| ahead_m.abs());
        nominal["wheel"]["wheelbase_m"] = json!(other_m);
    } else {
        nominal["rail"]["profile"] = json!("S7");
    }
    match nominal {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests;
