//! `tracktwin improve`: finds what the track model lacks in a recording, and evaluates the recording with it.

use super::files::{Force, check, make_folder, read, write_file};
use super::numbers::{cores, count};
use super::recording::RecordingArgument;
use super::track::TrackOption;
use super::{
    OrInput, Stop, diagnose, evaluate, extend, println_stderr, println_stdout, run as campaign,
};
use crate::pipeline::confirm::has_pass_to_withhold;
use crate::pipeline::lack::check_for_training;
use anyhow::{Context, anyhow};
use clap::Args;
use std::io::ErrorKind;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::{Confirmation, Diagnosis};
use tracktwin_farm::campaign::Campaign;
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_parameters::quantity::CASES;
use tracktwin_report::{Improvement, improvement_page};
use tracktwin_signal::recording::Recording;

/// Folders of the evaluations without and with what was found.
const FOLDERS: [&str; 2] = ["before", "after"];

/// Files of the comparison of both evaluations.
const RESULTS: [&str; 2] = ["report.html", "improvement.json"];

/// Number of cases of each of the two campaigns.
const CASES_EACH: &str = "400";

/// Arguments of `improve`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin improve ride --out better

The steps: `diagnose` (with --confirm if a speed was passed twice), a campaign of the recording's
track, `extend`, then `run` for the campaign without and with the physics found. In the output
folder: diagnosis/, campaign/, before/, after/, improvement.json and report.html, a page with the
estimates before and after. Two campaigns of 250 cases took five minutes on two cores. Repeat the
command to continue an interrupted campaign.

Exit codes: 0 done, or nothing was left out; 1 what was found belongs in no campaign, or withheld
passes do not confirm it; 2 wrong input; 3 failure or interruption.")]
pub(super) struct Arguments {
    #[command(flatten)]
    recording: RecordingArgument,
    /// Output folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Library for null simulations and both campaigns, created if missing [default:
    /// sqlite:OUT/library.sqlite].
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    #[command(flatten)]
    track: TrackOption,
    /// Number of cases of each campaign; at least 200.
    #[arg(long, value_name = "N", default_value = CASES_EACH, value_parser = count::<u32>(CASES))]
    cases: u32,
    /// Number of cores for the simulation [default: all].
    #[arg(long, value_name = "N", value_parser = cores)]
    cores: Option<NonZeroUsize>,
    #[command(flatten)]
    force: Force,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { recording: argument, out, library, track, cases, cores, force } = arguments;
    let recording = argument.open().or_input()?;
    check(&out, Kind::Results, force, &RESULTS)?;
    make_folder(&out)?;
    let library = library.unwrap_or_else(|| campaign::default_library(&out));
    // What no campaign can serve is refused before the diagnosis, which takes minutes.
    let plain = write_campaign(&out.join("campaign"), &recording, &track, cases, force)?;
    let checked = Campaign::read(&plain, None).or_input()?;
    check_for_training(&checked).or_input()?;
    campaign::check(&recording, &checked).or_input()?;
    remove_earlier(&out, force)?;

    println_stderr("1 of 4: diagnosis");
    let confirm = has_pass_to_withhold(&recording);
    let folder = out.join("diagnosis");
    let of_recording =
        diagnose::Arguments::of(&argument, &library, &folder, &track, force, confirm);
    match diagnose::run(of_recording).await {
        Ok(()) => return Ok(()),
        Err(Stop::Negative) => {}
        Err(failed) => return Err(failed),
    }
    let diagnosis = extend::diagnosis(&folder.join("diagnosis.json"))?;
    if !extend::has_physics(&diagnosis) {
        println_stdout(
            "What was found belongs in no campaign of the track: nothing is evaluated again.",
        );
        return Err(Stop::Negative);
    }

    println_stderr("2 of 4: campaign of the track without what was found");
    let evaluated = |campaign: PathBuf, out: PathBuf, diagnosis: Option<PathBuf>| {
        campaign::Arguments::of(campaign, &argument, &library, out, cores, force, diagnosis)
    };
    simulate(evaluated(plain.clone(), out.join(FOLDERS[0]), None)).await?;

    println_stderr("3 of 4: campaign with what was found in half of the cases");
    let extended = plain.with_file_name("campaign-extended.toml");
    let found = folder.join("diagnosis.json");
    extend::run(extend::Arguments::of(plain, found.clone(), extended.clone(), force))?;
    simulate(evaluated(extended, out.join(FOLDERS[1]), Some(found))).await?;

    println_stderr("4 of 4: report");
    write(&diagnosis, &out, force)?;
    println_stdout(&format!("report: {}", out.join("report.html").display()));
    match &diagnosis.confirmation {
        Some(Confirmation { is_confirmed: false, .. }) => Err(Stop::Negative),
        _ => Ok(()),
    }
}

/// Runs a campaign. Invalid estimates do not stop the command, because the page reports them.
async fn simulate(arguments: campaign::Arguments) -> Result<(), Stop> {
    match campaign::run(arguments).await {
        Err(Stop::Negative) => Ok(()),
        other => other,
    }
}

/// Removes the results of an earlier run, which would be taken for those of this run if it ends before its
/// own are written, or finds nothing.
fn remove_earlier(out: &Path, force: Force) -> Result<(), Stop> {
    let mut paths: Vec<PathBuf> = RESULTS.iter().map(|name| out.join(name)).collect();
    for folder in FOLDERS.map(|name| out.join(name)) {
        evaluate::check_files(&folder, force)?;
        paths.extend(evaluate::RESULTS.iter().map(|name| folder.join(name)));
    }
    for path in paths {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(anyhow!("{}: {error}", path.display()).into());
            }
            _ => {}
        }
    }
    Ok(())
}

/// Writes a campaign of the recording's track at the recording's speeds, and the description of this track.
fn write_campaign(
    folder: &Path,
    recording: &Recording,
    track: &TrackOption,
    cases: u32,
    force: Force,
) -> Result<PathBuf, Stop> {
    let (track, _) = track.of(recording)?;
    make_folder(folder)?;
    write_file(&folder.join("track.toml"), Kind::Campaign, force, track.to_toml().as_bytes())?;
    let text = format!(
        "# The track of {} at its speeds.\nname = \"{}\"\nseed = 1\ncases = {cases}\ntrack = \"track.toml\"\n\
         speeds_km_h = {:?}\n",
        recording.name.replace(char::is_control, " "),
        track.name,
        recording.speeds_km_h()
    );
    let campaign = folder.join("campaign.toml");
    write_file(&campaign, Kind::Campaign, force, text.as_bytes())?;
    Ok(campaign)
}

/// Writes the page and the document, from the evaluations before and after: those by inversion, or those of
/// models if an inversion failed.
fn write(diagnosis: &Diagnosis, out: &Path, force: Force) -> Result<(), Stop> {
    let is_inverted = FOLDERS.iter().all(|name| out.join(name).join("inversion.json").exists());
    let file = if is_inverted { "inversion.json" } else { "evaluation.json" };
    let evaluation = |name: &str| {
        let path = out.join(name).join(file);
        let text = read(&path)?;
        serde_json::from_slice(&text)
            .with_context(|| format!("{}: not an evaluation", path.display()))
    };
    let [before, after] = FOLDERS.map(evaluation);
    let [before, after] = [before?, after?];
    let improvement = Improvement::new(diagnosis, &before, &after).ok_or_else(|| {
        anyhow!("{}: the two evaluations have no sleepers in common", out.display())
    })?;
    let document = serde_json::to_string_pretty(&improvement).context("it is plain JSON")?;
    let mut output = Output::begin(out, Kind::Results, force.force)?;
    output.add(
        &FileName::new("report.html")?,
        improvement_page(&improvement, diagnosis).as_bytes(),
    )?;
    output.add(&FileName::new("improvement.json")?, document.as_bytes())?;
    output.commit()?;
    Ok(())
}
