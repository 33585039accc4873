//! `tracktwin check`: explains a described track.

use super::track::read;
use super::{OrInput, Stop, print_json, println_stdout};
use crate::pipeline::check::{TrackCheck, check};
use clap::Args;
use std::path::PathBuf;
use tracktwin_number::rounded;

/// Arguments of `check`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin new line --preset 60E1-concrete
  tracktwin check line/track.toml

Exit codes: 0 done, 2 wrong input (the line says which key and what is possible), 3 failure.")]
pub(super) struct Arguments {
    /// Description of track and vehicle, as `tracktwin new` writes it.
    file: PathBuf,
    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let track = read(&arguments.file)?;
    let check = check(&track).or_input()?;
    if arguments.json {
        print_json(&check);
    } else {
        print(&check);
    }
    Ok(())
}

fn print(check: &TrackCheck) {
    let hz = |values: &[f64]| {
        let each = values.iter().map(|value| rounded(*value, 3));
        each.collect::<Vec<_>>().join(", ")
    };
    let row = |label: &str, value: String| println_stdout(&format!("{label:<34} {value}"));
    row("track", check.name.clone());
    row("rail", format!("{} kg/m", rounded(check.rail_mass_kg_m, 3)));
    row("half sleeper", format!("{} kg", rounded(check.half_sleeper_mass_kg, 3)));
    row("stiffness under one wheel", mega(check.point_stiffness_n_m, "MN/m"));
    row("track modulus", mega(check.track_modulus_n_m2, "MN/m2"));
    row("contact stiffness", mega(check.contact_stiffness_n_m, "MN/m"));
    let patch_mm = rounded(1e3 * check.contact_patch_half_length_m, 2);
    row("half length of the contact patch", format!("{patch_mm} mm"));
    row("resonances above a sleeper", format!("{} Hz", hz(&check.resonances_at_sleeper_hz)));
    row("resonances at midspan", format!("{} Hz", hz(&check.resonances_at_midspan_hz)));
    if let Some(p2_hz) = check.p2_hz {
        row("wheel on track (P2)", format!("{} Hz", rounded(p2_hz, 3)));
    }
    row("pinned-pinned", format!("{} Hz", rounded(check.pinned_pinned_hz, 4)));
    println_stdout("\nsurface in one-third octaves, dB re 1 um (limit of ISO 3095:2013)");
    for level in &check.surface {
        let label = format!("  {} m", level.wavelength_m);
        row(&label, format!("{:.1} ({:.1})", level.level_db, level.limit_db));
    }
    println_stdout(
        "\nspeed: sleeper passing, standard deviation of the contact force, time without contact",
    );
    for speed in &check.speeds {
        let label = format!("  {} km/h", speed.speed_km_h);
        let passing_hz = rounded(speed.sleeper_passing_hz, 3);
        let force = 1e2 * speed.force_ratio;
        let without = percent(speed.without_contact);
        row(&label, format!("{passing_hz} Hz, {force:.0} % of the load, {without}"));
    }
    println_stdout("\ngreatest change of the level by a change of 10 %");
    for parameter in &check.parameters {
        let label = format!("  {}", parameter.parameter);
        let at = parameter
            .at_hz
            .map_or("all frequencies".to_owned(), |hz| format!("{} Hz", rounded(hz, 3)));
        row(&label, format!("{:.2} dB at {at}", parameter.change_db.abs()));
    }
    let doubts = check.doubts();
    if !doubts.is_empty() {
        println_stdout("");
    }
    for doubt in &doubts {
        println_stdout(doubt);
    }
}

fn mega(value: f64, unit: &str) -> String {
    format!("{} {unit}", rounded(1e-6 * value, 3))
}

fn percent(share: f64) -> String {
    if share < 1e-5 { "below 0.001 %".to_owned() } else { format!("{:.3} %", 1e2 * share) }
}
