//! `tracktwin inspect`: content and quality of a recording.

mod uses;

use self::uses::uses;
use super::files::{Force, check_file, write_file};
use super::recording::RecordingArgument;
use super::{OrInput, Stop, print_json, println_stdout};
use clap::Args;
use std::path::PathBuf;
use tracktwin_files::Kind;
use tracktwin_inspection::{Inspection, Place, inspect};
use tracktwin_number::{chance, rounded, significant};
use tracktwin_report::{Inspected, InspectedCurve, InspectionReport, inspection_page};
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_signal::{PowerSpectrum, Signal};

/// Line spacing of the drawn spectra in Hz.
const LINES_HZ: f64 = 20.0;
/// Number of points of a drawn curve.
const POINTS: usize = 400;

/// Arguments of `inspect`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin inspect ride --out ride.html

Exit codes: 0 done, also if there are defects; 2 wrong input; 3 failure.")]
pub(super) struct Arguments {
    #[command(flatten)]
    recording: RecordingArgument,
    /// Output page (HTML) with plots.
    #[arg(long, value_name = "FILE.html")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let recording = arguments.recording.open().or_input()?;
    if let Some(path) = &arguments.out {
        check_file(path, Kind::Results, arguments.force)?;
    }
    let inspection = inspect(&recording);
    let report = report(&recording, &inspection);
    if arguments.json {
        print_json(&json(&recording, &inspection, &report));
    } else {
        print(&report);
    }
    if let Some(path) = &arguments.out {
        write_file(path, Kind::Results, arguments.force, inspection_page(&report).as_bytes())?;
        if !arguments.json {
            println_stdout(&format!("page: {}", path.display()));
        }
    }
    Ok(())
}

fn print(report: &InspectionReport) {
    println_stdout(&report.summary);
    for row in &report.passes {
        let cells: Vec<String> = row.iter().map(|cell| format!("{cell:<14}")).collect();
        println_stdout(&cells.concat());
    }
    for defect in &report.pass_defects {
        println_stdout(&format!("not usable: {defect}"));
    }
    if let Some(lost) = &report.loss_of_contact {
        println_stdout(&format!("loss_of_contact: {lost}"));
    }
    for found in &report.found {
        println_stdout(&format!(
            "{} ({}; by chance {}): {}",
            found.physics,
            found.place,
            chance(found.p_value),
            found.evidence
        ));
    }
    for text in report.doubts.iter().chain(&report.uses) {
        println_stdout(text);
    }
}

fn json(
    recording: &Recording,
    inspection: &Inspection,
    report: &InspectionReport,
) -> serde_json::Value {
    let finding = |finding: &tracktwin_inspection::Finding| {
        let parameters: serde_json::Map<String, serde_json::Value> = finding
            .parameters
            .iter()
            .map(|(name, (mean, sd))| {
                ((*name).to_owned(), serde_json::json!({"mean": mean, "sd": sd}))
            })
            .collect();
        serde_json::json!({
            "physics": finding.physics,
            "p_value": finding.p_value,
            "x_m": match finding.place {
                Place::Everywhere => None,
                Place::Stretch { from_m, to_m } => Some([from_m, to_m]),
            },
            "parameters": parameters,
            "evidence": finding.evidence,
        })
    };
    serde_json::json!({
        "recording": recording.name,
        "sample_rate_Hz": recording.sample_rate_hz,
        "passes": recording.passes.len(),
        "speeds_km_h": recording.speeds_km_h(),
        "sleepers": recording.sleepers.len(),
        "findings": inspection.findings.iter().map(finding).collect::<Vec<_>>(),
        "loss_of_contact": inspection.loss_of_contact,
        "not_usable": report.pass_defects,
        "doubts": report.doubts,
        "uses": report.uses,
    })
}

fn report(recording: &Recording, inspection: &Inspection) -> InspectionReport {
    let speeds: Vec<String> =
        recording.speeds_km_h().iter().map(|speed| rounded(*speed, 3)).collect();
    let unit = if recording.gain_known() { "m/s²" } else { "unit" };
    let seconds: f64 = recording.passes.iter().map(|pass| pass.signal.duration_s()).sum();
    InspectionReport {
        name: recording.name.clone(),
        summary: format!(
            "{} at {} km/h, {seconds:.1} s at {} Hz in all, {}, {}.",
            pluralize(recording.passes.len(), "pass", "passes"),
            speeds.join(", "),
            rounded(recording.sample_rate_hz, 8),
            pluralize(recording.sleepers.len(), "sleeper", "sleepers"),
            pluralize(
                inspection.findings.len() + usize::from(inspection.loss_of_contact.is_some()),
                "finding",
                "findings"
            )
        ),
        passes: passes(recording, inspection),
        found: inspection.findings.iter().map(found).collect(),
        loss_of_contact: inspection
            .loss_of_contact
            .as_ref()
            .map(|lost| lost.sentence(recording.passes.len())),
        pass_defects: inspection.pass_defects.iter().map(ToString::to_string).collect(),
        doubts: [recording.doubts.clone(), inspection.doubts()].concat(),
        uses: uses(recording, inspection),
        spectra: curves(recording, |pass| spectrum(&pass.signal)),
        levels: curves(recording, levels),
        unit: unit.to_owned(),
    }
}

fn pluralize(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

fn found(finding: &tracktwin_inspection::Finding) -> Inspected {
    let place = match finding.place {
        Place::Everywhere => "everywhere".to_owned(),
        Place::Stretch { from_m, to_m } => format!("{from_m:.3} to {to_m:.3} m"),
    };
    let (physics, evidence) = (finding.physics.to_owned(), finding.evidence.clone());
    Inspected { physics, place, p_value: finding.p_value, evidence }
}

fn passes(recording: &Recording, inspection: &Inspection) -> Vec<Vec<String>> {
    let heads = ["pass", "km/h", "from m", "to m", "s", "rms", "peak", "noise rms", "gain dB"];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for (index, pass) in recording.passes.iter().enumerate() {
        let samples = pass.signal.samples();
        let square = samples.iter().map(|value| value * value).sum::<f64>();
        let peak = samples.iter().map(|value| value.abs()).fold(0.0, f64::max);
        // White noise of this density up to half the sample rate.
        let noise = inspection.noise_floors[index].map_or_else(
            || "–".to_owned(),
            |d| significant((d * 0.5 * recording.sample_rate_hz).sqrt(), 2),
        );
        let gain = inspection.gains.iter().find(|gain| gain.pass == index);
        rows.push(vec![
            (index + 1).to_string(),
            format!("{:.2}", pass.speed_km_h),
            format!("{:.3}", pass.position_m[0]),
            format!("{:.3}", pass.position_m[samples.len() - 1]),
            format!("{:.2}", pass.signal.duration_s()),
            significant((square / samples.len() as f64).sqrt(), 3),
            significant(peak, 3),
            noise,
            gain.map_or_else(|| "–".to_owned(), |gain| format!("{:+.2}", gain.level.mean_db.0)),
        ]);
    }
    rows
}

fn curves(recording: &Recording, points: impl Fn(&Pass) -> Vec<(f64, f64)>) -> Vec<InspectedCurve> {
    let curve = |(index, pass): (usize, &Pass)| InspectedCurve {
        name: format!("{} ({:.0} km/h)", index + 1, pass.speed_km_h),
        points: points(pass),
    };
    recording.passes.iter().enumerate().map(curve).collect()
}

/// Power spectral density in dB, at equal steps of a logarithmic frequency axis.
fn spectrum(signal: &Signal) -> Vec<(f64, f64)> {
    let segment = ((signal.sample_rate_hz() / LINES_HZ) as usize).clamp(2, signal.len());
    let Ok(spectrum) = PowerSpectrum::welch(signal, segment) else { return Vec::new() };
    let (low, high) = (LINES_HZ, 0.5 * signal.sample_rate_hz());
    let edge = |index: usize| low * (high / low).powf(index as f64 / POINTS as f64);
    (0..POINTS)
        .filter_map(|index| {
            let density = spectrum.mean_density(edge(index), edge(index + 1))?;
            (density > 0.0).then(|| (edge(index), 10.0 * density.log10()))
        })
        .collect()
}

/// Mean square of the acceleration in dB, by position along the track.
fn levels(pass: &Pass) -> Vec<(f64, f64)> {
    let samples = pass.signal.samples();
    let length = samples.len().div_ceil(POINTS);
    let level = |(index, part): (usize, &[f64])| {
        let square = part.iter().map(|value| value * value).sum::<f64>() / part.len() as f64;
        (square > 0.0).then(|| (pass.position_m[index * length], 10.0 * square.log10()))
    };
    samples.chunks(length).enumerate().filter_map(level).collect()
}
