//! Stiffness along the track before and after the extension of the model, and the removed bias.

use super::quantity::{Unit, rounded_pair, signed};
use super::words::{accepted, addition, is_chain, numbers, physics};
use crate::UNDER_LOAD;
use crate::along_track::AlongTrack;
use maud::{Markup, html};
use tracktwin_diagnosis::{BeforeAfter, Diagnosis, Estimate, SleeperValues};
use tracktwin_drawing::figure;
use tracktwin_parameters::Parameter;

/// A parameter, and the access to its values at a sleeper.
type Column = (Parameter, fn(&SleeperValues) -> &BeforeAfter<Estimate>);

const COLUMNS: [Column; 3] = [
    (Parameter::RailpadStiffness, |sleeper| &sleeper.railpad_stiffness),
    (Parameter::BallastStiffness, |sleeper| &sleeper.ballast_stiffness),
    (Parameter::IrregularityLevel, |sleeper| &sleeper.irregularity_level),
];

/// One chart per parameter, and the table of biases.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    if diagnosis.track.is_empty() {
        return Markup::default();
    }
    let charts: Vec<String> = COLUMNS.iter().map(|column| chart(diagnosis, column)).collect();
    let heading =
        if addition(diagnosis).is_some() { "The track without and with it" } else { "The track" };
    html! {
        h2 { (heading) }
        (figure(&charts, &caption(diagnosis)))
        @if !diagnosis.bias_removed.is_empty() { (biases(diagnosis)) }
    }
}

fn chart(diagnosis: &Diagnosis, (parameter, pick): &Column) -> String {
    let estimates = |side: fn(&BeforeAfter<Estimate>) -> Estimate| -> Vec<Estimate> {
        diagnosis.track.iter().map(|sleeper| side(pick(sleeper))).collect()
    };
    AlongTrack {
        parameter: *parameter,
        sleepers: diagnosis.track.iter().map(|it| (it.x_m, it.id.as_str())).collect(),
        before: estimates(|both| both.before),
        after: addition(diagnosis).map(|_| estimates(|both| both.after)),
        places_m: places_m(diagnosis),
    }
    .chart()
}

/// Positions in m of accepted physics, unless it covers nearly the whole track.
fn places_m(diagnosis: &Diagnosis) -> Vec<f64> {
    let mut places_m = Vec::new();
    for location in accepted(diagnosis).filter_map(|hypothesis| hypothesis.location.as_ref()) {
        let places = numbers(diagnosis, &location.sleepers);
        let [from, to] = location.x_m;
        if to - from < 1e-3 {
            places_m.push(from);
        } else if 2 * places.len() < diagnosis.track.len() {
            places_m.extend(places.into_iter().map(|place| diagnosis.track[place].x_m));
        }
    }
    places_m
}

fn caption(diagnosis: &Diagnosis) -> String {
    let band = format!("Bands are two standard deviations. {UNDER_LOAD}");
    match addition(diagnosis) {
        None => format!("Parameters of the re-tuned track model at every sleeper. {band}"),
        Some(with) if accepted(diagnosis).all(|h| is_chain(&h.physics)) => format!(
            "Dashed grey: stiffness of the re-tuned track model, biased by the fault of the \
                 measuring chain. Bold: with the {with} in the model. {band}"
        ),
        Some(with) => format!(
            "Dashed grey: stiffness of the re-tuned track model, biased by the left-out \
                 physics. Bold: with the {with} in the model. Dotted lines mark the place. {band}"
        ),
    }
}

fn biases(diagnosis: &Diagnosis) -> Markup {
    html! {
        p { "Bias of the estimates without it:" }
        div.scroll { table {
            thead { tr { th { "parameter" } th { "without it" } th { "with it" } th { "bias removed" } } }
            tbody {
                @for (name, both) in &diagnosis.bias_removed { (bias(name, *both)) }
            }
        } }
    }
}

fn bias(name: &str, BeforeAfter { before, after }: BeforeAfter<f64>) -> Markup {
    let label = Parameter::from_name(name)
        .map_or_else(|| physics(name), |parameter| parameter.label().to_owned());
    let unit = Unit::of(name, after);
    let [before_text, after_text] = rounded_pair(&unit, [before, after]);
    let share = 100.0 * (before / after - 1.0);
    html! {
        tr {
            td { (label) }
            td { (before_text) } td { (after_text) }
            td { @if share.is_finite() { (signed(share, 0)) " %" } }
        }
    }
}
