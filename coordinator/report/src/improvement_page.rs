//! The page of an improvement: estimates without and with the left-out physics.

use crate::along_track::AlongTrack;
use crate::diagnosis_page::confirmation;
use maud::{Markup, html};
use serde::Serialize;
use serde_json::Value;
use tracktwin_diagnosis::{BeforeAfter, Confirmation, Diagnosis, Estimate};
use tracktwin_drawing::{figure, page};
use tracktwin_number::significant;
use tracktwin_parameters::Parameter;

/// Name and version of the format.
const FORMAT: &str = "tracktwin-improvement/1";

/// Estimates from a recording, without and with the physics that a diagnosis found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Improvement {
    /// Name and version of the format.
    pub format: &'static str,
    /// Name of the recording.
    pub recording: String,
    /// Kinds of physics that were added.
    pub physics: Vec<String>,
    /// Method of the evaluations, `inversion` or `gp`.
    pub method: String,
    /// Result of the comparison with withheld passes, if a pass was withheld.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirmation: Option<Confirmation>,
    /// The sleepers that are in both evaluations.
    pub sleepers: Vec<ImprovedSleeper>,
}

/// Estimates at a sleeper without and with the added physics, in N/m.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImprovedSleeper {
    /// Id of the sleeper.
    pub id: String,
    /// Position of the sleeper along the track, in m.
    pub x_m: f64,
    /// Whether the sleeper is at the location of the added physics.
    pub is_at_place: bool,
    /// Railpad stiffness in N/m.
    #[serde(rename = "railpad_stiffness_N_m")]
    pub railpad_stiffness: BeforeAfter<Estimate>,
    /// Ballast stiffness in N/m.
    #[serde(rename = "ballast_stiffness_N_m")]
    pub ballast_stiffness: BeforeAfter<Estimate>,
}

impl Improvement {
    /// Creates the comparison from a diagnosis and the documents of two evaluations by one method
    /// (`inversion.json` or `evaluation.json`). Returns `None` if they have no sleeper in common.
    pub fn new(diagnosis: &Diagnosis, before: &Value, after: &Value) -> Option<Self> {
        let accepted = || diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
        let is_at_place = |id: &str| {
            let mut places = accepted().filter_map(|hypothesis| hypothesis.location.as_ref());
            places.any(|place| place.sleepers.iter().any(|sleeper| sleeper == id))
        };
        let others = after["sleepers"].as_array()?;
        let sleeper = |own: &Value| {
            let id = own["id"].as_str()?;
            let other = others.iter().find(|other| other["id"] == own["id"])?;
            let both = |name: &str| {
                Some(BeforeAfter { before: estimate(&own[name])?, after: estimate(&other[name])? })
            };
            Some(ImprovedSleeper {
                id: id.to_owned(),
                x_m: own["x_m"].as_f64()?,
                is_at_place: is_at_place(id),
                railpad_stiffness: both("railpad_stiffness_N_m")?,
                ballast_stiffness: both("ballast_stiffness_N_m")?,
            })
        };
        let method = after["method"].as_str()?.to_owned();
        let sleepers: Vec<_> = before["sleepers"].as_array()?.iter().filter_map(sleeper).collect();
        (!sleepers.is_empty()).then(|| Self {
            format: FORMAT,
            recording: diagnosis.recording.clone(),
            physics: accepted().map(|hypothesis| hypothesis.physics.clone()).collect(),
            method,
            confirmation: diagnosis.confirmation.clone(),
            sleepers,
        })
    }
}

fn estimate(value: &Value) -> Option<Estimate> {
    Some(Estimate { mean: value["mean"].as_f64()?, sd: value["sd"].as_f64()? })
}

/// Returns the HTML page. It links to the folders `diagnosis`, `before` and `after` beside it.
pub fn improvement_page(improvement: &Improvement, diagnosis: &Diagnosis) -> String {
    let body = html! {
        p {
            "Added to the track model: " (improvement.physics.join(", ")) ". See the "
            a href="diagnosis/report.html" { "diagnosis" } ", and the evaluations "
            a href="before/report.html" { "before" } " and " a href="after/report.html" { "after" } "."
        }
        (confirmation::section(diagnosis))
        h2 { "Stiffness before and after" }
        (figure(&charts(&improvement.sleepers), "Dashed grey: before. Bold: after. Bands are two standard \
             deviations; dotted lines mark the place of what was found."))
        p { (estimates(&improvement.method)) " Mean ± standard deviation in MN/m. Sleepers at its place are in bold." }
        div.scroll { (table(&improvement.sleepers)) }
    };
    page(&format!("Improvement of {}", improvement.recording), &diagnosis.sentence, &body)
}

/// Charts of railpad and ballast stiffness along the track.
fn charts(sleepers: &[ImprovedSleeper]) -> [String; 2] {
    let chart = |parameter, pick: fn(&ImprovedSleeper) -> &BeforeAfter<Estimate>| {
        let at_place = sleepers.iter().filter(|sleeper| sleeper.is_at_place);
        AlongTrack {
            parameter,
            sleepers: sleepers.iter().map(|it| (it.x_m, it.id.as_str())).collect(),
            before: sleepers.iter().map(|sleeper| pick(sleeper).before).collect(),
            after: Some(sleepers.iter().map(|sleeper| pick(sleeper).after).collect()),
            places_m: at_place.map(|sleeper| sleeper.x_m).collect(),
        }
        .chart()
    };
    [
        chart(Parameter::RailpadStiffness, |sleeper| &sleeper.railpad_stiffness),
        chart(Parameter::BallastStiffness, |sleeper| &sleeper.ballast_stiffness),
    ]
}

/// Which estimates the table compares.
fn estimates(method: &str) -> &'static str {
    if method == "inversion" {
        "Estimates of the inversion, with the track model without what was found, and with it. Those of \
         Gaussian processes are on the pages before and after."
    } else {
        "Estimates of Gaussian processes, trained on a campaign without what was found, and on one with it \
         in half of the cases."
    }
}

fn table(sleepers: &[ImprovedSleeper]) -> Markup {
    let shown = |Estimate { mean, sd }: Estimate| {
        format!("{} ± {}", significant(1e-6 * mean, 3), significant(1e-6 * sd, 2))
    };
    html! {
        table {
            thead { tr {
                th { "sleeper" } th { "x, m" } th { "railpad before" } th { "railpad after" }
                th { "ballast before" } th { "ballast after" }
            } }
            tbody {
                @for sleeper in sleepers {
                    tr {
                        td { @if sleeper.is_at_place { b { (sleeper.id) } } @else { (sleeper.id) } }
                        td { (format!("{:.2}", sleeper.x_m)) }
                        @for both in [sleeper.railpad_stiffness, sleeper.ballast_stiffness] {
                            td { (shown(both.before)) }
                            td { (shown(both.after)) }
                        }
                    }
                }
            }
        }
    }
}
