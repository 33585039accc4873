//! `tracktwin extend`: adds the physics that a diagnosis found to a campaign.

use super::files::{Force, read, read_text, write_file};
use super::{OrInput, Stop, print_json, println_stdout};
use anyhow::{Context, anyhow};
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::{Diagnosis, Estimate, FORMAT, Hypothesis};
use tracktwin_farm::campaign::Campaign;
use tracktwin_files::Kind as FileKind;
use tracktwin_parameters::TrackDesign;
use tracktwin_track::extension::{Bound, Kind, KindParameter, PlaceKind};

/// Share of the cases with the extension. It is below 1, so that models are also valid without the
/// extension.
const SHARE: f64 = 0.5;

/// Largest value of a share, which is less than one.
const SHARE_MAX: f64 = 0.99;

/// Half width of a parameter's range in standard deviations of the estimate; the range also has a minimum
/// ratio to the estimate.
const DEVIATIONS: f64 = 3.0;
const FACTOR_MIN: f64 = 2.0;

/// Maximum relative difference of two sleeper spacings that count as equal.
const ALIKE: f64 = 0.02;

/// Arguments of `extend`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin extend mine.toml --from diagnosis/diagnosis.json

The campaign must be of the diagnosed track. Faults of the measuring chain are not added.

Next: `tracktwin run mine-extended.toml --library URL --out DIR` simulates the campaign and trains
models. With these, `tracktwin evaluate` gives stiffness without the bias that this physics causes.

Exit codes: 0 done; 2 wrong input, or the diagnosis accepted no physics; 3 failure.")]
pub(super) struct Arguments {
    /// Campaign file (TOML) to extend.
    campaign: PathBuf,
    /// Diagnosis written by `diagnose` (diagnosis.json, or its folder).
    #[arg(long, value_name = "FILE")]
    from: PathBuf,
    /// New campaign file [default: CAMPAIGN-extended.toml beside the old one].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Arguments {
    /// A campaign that is extended by a diagnosis.
    pub(super) const fn of(campaign: PathBuf, from: PathBuf, out: PathBuf, force: Force) -> Self {
        Self { campaign, from, out: Some(out), force, json: false }
    }
}

pub(super) fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { campaign: path, from, out, force, json } = arguments;
    let text = read_text(&path).or_input()?;
    let campaign = Campaign::parse(&text, &path.display().to_string(), None).or_input()?;
    let diagnosis = diagnosis(&from).or_input()?;
    check_spacing(&path, &campaign, &diagnosis).or_input()?;
    let accepted: Vec<_> = physics(&diagnosis).collect();
    if accepted.is_empty() {
        let name = from.display();
        let verdict = format!(
            "{name}: hypotheses: the diagnosis accepted no physics; there is nothing to add"
        );
        return Err(Stop::Input(anyhow!(verdict)));
    }
    let experiment = &campaign.definition.experiment;
    let mut extended = text.trim_end().to_owned() + "\n";
    for (hypothesis, kind) in &accepted {
        let middle = experiment.spans / 2 - 1;
        extended += &table(&diagnosis, hypothesis, kind, middle, &experiment.design);
    }
    let out = out.unwrap_or_else(|| beside(&path));
    Campaign::parse(&extended, &out.display().to_string(), None).or_input()?;
    write_file(&out, FileKind::Campaign, force, extended.as_bytes())?;
    let names: Vec<_> =
        accepted.iter().map(|(hypothesis, _)| hypothesis.physics.as_str()).collect();
    let out = out.display().to_string();
    if json {
        print_json(&serde_json::json!({ "campaign": out, "physics": names, "share": SHARE }));
    } else {
        println_stdout(&format!("{out}: half of the cases contain {}", names.join(" and ")));
    }
    Ok(())
}

/// Accepted hypotheses that can be added to a campaign, with their kinds.
fn physics(diagnosis: &Diagnosis) -> impl Iterator<Item = (&Hypothesis, &'static Kind)> {
    let accepted = diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    let known = accepted.filter_map(|it| Some((it, Kind::from_name(&it.physics)?)));
    known.filter(|(_, kind)| !kind.measuring_chain)
}

/// Whether a hypothesis was accepted that can be added to a campaign.
pub(super) fn has_physics(diagnosis: &Diagnosis) -> bool {
    physics(diagnosis).next().is_some()
}

/// Checks that the campaign has the sleeper spacing of the diagnosed track.
fn check_spacing(path: &Path, campaign: &Campaign, diagnosis: &Diagnosis) -> anyhow::Result<()> {
    let spacing_m = campaign.definition.experiment.design.sleeper.spacing_m;
    let mut distances: Vec<f64> =
        diagnosis.track.windows(2).map(|pair| pair[1].x_m - pair[0].x_m).collect();
    distances.sort_by(f64::total_cmp);
    match distances.get(distances.len() / 2) {
        Some(distance_m) if (distance_m / spacing_m - 1.0).abs() > ALIKE => Err(anyhow!(
            "{}: preset: the campaign's sleepers are {spacing_m} m apart, those of the diagnosis \
             {distance_m:.3} m; extend a campaign of the same track",
            path.display(),
        )),
        _ => Ok(()),
    }
}

/// Reads a diagnosis: its file, or the folder that `diagnose` wrote.
pub(super) fn diagnosis(path: &Path) -> anyhow::Result<Diagnosis> {
    let inside = path.join("diagnosis.json");
    let path = if path.is_dir() { &inside } else { path };
    let name = path.display();
    let diagnosis: Diagnosis = serde_json::from_slice(&read(path)?).with_context(|| {
        format!("{name}: not a diagnosis; give the diagnosis.json of `tracktwin diagnose`")
    })?;
    if diagnosis.format != FORMAT {
        return Err(anyhow!(
            "{name}: format: {:?} is not {FORMAT:?}; repeat the diagnosis with this version",
            diagnosis.format
        ));
    }
    Ok(diagnosis)
}

fn beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-extended.toml"))
}

/// The campaign's table for a hypothesis; a local extension is placed at the evaluated sleeper.
fn table(
    diagnosis: &Diagnosis,
    hypothesis: &Hypothesis,
    kind: &Kind,
    middle: usize,
    design: &TrackDesign,
) -> String {
    let mut table = format!(
        "\n# Found in {} with a probability of {:.0} %.\n[[extension]]\nphysics = \"{}\"\nshare = {SHARE:?}\n",
        // A line break would end the comment.
        diagnosis.recording.replace(char::is_control, " "),
        100.0 * hypothesis.probability,
        kind.physics
    );
    table += &place(diagnosis, hypothesis, kind, middle, design.sleeper.spacing_m);
    table + &values(hypothesis, kind, design.length_ratio())
}

/// Parameters of the extension in TOML: ranges for fitted parameters, values for assumed ones, and typical
/// values of a track with these lengths over V-Track's for all other required ones.
fn values(hypothesis: &Hypothesis, kind: &Kind, length_ratio: f64) -> String {
    let mut lines = String::new();
    for (name, estimate) in &hypothesis.parameters {
        let Some(parameter) = kind.parameters.iter().find(|known| known.name == name) else {
            continue;
        };
        // Writing to a string cannot fail.
        let _ = if !parameter.bound.is_continuous() {
            writeln!(lines, "{name} = {:?}", estimate.mean.round())
        } else if estimate.sd > 0.0 {
            let [low, high] = range(parameter, estimate);
            writeln!(
                lines,
                "{name} = {{ low = {low:e}, high = {high:e}, scale = \"logarithmic\" }}"
            )
        } else {
            writeln!(lines, "{name} = {:?}", estimate.mean)
        };
    }
    for (name, value) in &hypothesis.assumed {
        let _ = writeln!(lines, "{name} = {value:?}");
    }
    for parameter in kind.parameters {
        let given = hypothesis.parameters.contains_key(parameter.name)
            || hypothesis.assumed.contains_key(parameter.name);
        if !given && parameter.default.is_none() {
            let typical = parameter.scaled(parameter.typical, length_ratio);
            let _ = writeln!(lines, "{} = {typical:e}", parameter.name);
        }
    }
    lines
}

/// Location of the extension on the campaign's track.
fn place(
    diagnosis: &Diagnosis,
    hypothesis: &Hypothesis,
    kind: &Kind,
    middle: usize,
    spacing_m: f64,
) -> String {
    let Some(location) = &hypothesis.location else { return String::new() };
    let everywhere = location.sleepers.len() == diagnosis.track.len();
    match kind.place {
        PlaceKind::Nowhere => String::new(),
        PlaceKind::Sleepers if everywhere => String::new(),
        PlaceKind::Sleepers => {
            let place = |id: &String| diagnosis.track.iter().position(|sleeper| sleeper.id == *id);
            let places: Vec<usize> = location.sleepers.iter().filter_map(place).collect();
            let centre = places.get(places.len() / 2).copied().unwrap_or(0);
            let moved = places.iter().filter_map(|place| (middle + place).checked_sub(centre));
            // The campaign's track may be shorter than what was found.
            let moved = moved.filter(|sleeper| *sleeper <= 2 * middle);
            format!("sleepers = {:?}\n", moved.collect::<Vec<_>>())
        }
        PlaceKind::Point => {
            let x_m = 0.5 * (location.x_m[0] + location.x_m[1]);
            let nearest = diagnosis.track.iter().map(|sleeper| x_m - sleeper.x_m);
            let offset = nearest.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
            let x_m = (middle + 1) as f64 * spacing_m + offset;
            format!("x_m = [{x_m:.4}, {x_m:.4}]\n")
        }
        PlaceKind::Stretch => String::new(),
    }
}

/// Range of a parameter around the estimate.
fn range(parameter: &KindParameter, estimate: &Estimate) -> [f64; 2] {
    let factor = (DEVIATIONS * estimate.sd / estimate.mean).exp().clamp(FACTOR_MIN, 10.0);
    let least = parameter.v_track[1].min(parameter.real_scale[1]) * 1e-3;
    let most = if parameter.bound == Bound::Share { SHARE_MAX } else { f64::INFINITY };
    let high = (estimate.mean * factor).max(10.0 * least).min(most);
    [(estimate.mean / factor).max(least).min(0.5 * high), high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_is_within_the_bound_of_its_parameter() {
        let all = Kind::all().flat_map(|kind| kind.parameters);
        for parameter in all.filter(|parameter| parameter.bound.is_continuous()) {
            for mean in [0.3, 0.7, 0.99] {
                let [low, high] = range(parameter, &Estimate { mean, sd: 0.3 });
                assert!(low < high, "{}: {low} to {high}", parameter.name);
                let holds = parameter.bound.holds(low) && parameter.bound.holds(high);
                assert!(holds, "{}: {low} to {high}", parameter.name);
            }
        }
    }

    /// A campaign refuses a range of whole numbers.
    #[test]
    fn an_order_is_one_number() {
        let found = serde_json::json!({
            "physics": "wheel_out_of_round", "probability": 0.97, "accepted": true,
            "parameters": {"order": {"mean": 12.02, "sd": 0.1}},
            "look_alikes": [], "would_separate": "", "detectability": 20.0, "log_evidence": 100.0,
        });
        let found: Hypothesis = serde_json::from_value(found).unwrap();
        let kind = Kind::from_name(&found.physics).unwrap();
        assert!(values(&found, kind, 1.0).starts_with("order = 12.0\n"));
    }

    #[test]
    fn the_folder_of_a_diagnosis_stands_for_its_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("diagnosis.json"), "{}").unwrap();
        let refused = diagnosis(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("diagnosis.json: not a diagnosis"), "{refused}");
    }

    #[test]
    fn what_was_assumed_is_part_of_the_extension() {
        let found = serde_json::json!({
            "physics": "flexible_axle_box", "probability": 0.97, "accepted": true,
            "parameters": {"mass_kg": {"mean": 10.0, "sd": 0.5}},
            "assumed": {"sensor_on_wheel": 1.0},
            "look_alikes": [], "would_separate": "", "detectability": 20.0, "log_evidence": 100.0,
        });
        let found: Hypothesis = serde_json::from_value(found).unwrap();
        let kind = Kind::from_name(&found.physics).unwrap();
        let lines = values(&found, kind, 1.0);
        assert!(lines.contains("sensor_on_wheel = 1.0\n"), "{lines}");
        assert!(lines.contains("mass_kg = { low") && lines.contains("stiffness_N_per_m = 4e8"));
        // What was not fitted is typical of the campaign's track.
        let on_a_line: toml::Table = values(&found, kind, 4.8).parse().unwrap();
        let stiffness = on_a_line["stiffness_N_per_m"].as_float().unwrap();
        let [low, high] = kind.parameter("stiffness_N_per_m").unwrap().real_scale;
        assert!((low..=high).contains(&stiffness), "{stiffness}");
    }
}
