//! Stiffness along the track before and after the extension of the model, and the removed bias.

use super::quantity::{Unit, rounded_pair, signed};
use super::words::{accepted, addition, is_chain, numbers, physics};
use crate::UNDER_LOAD;
use maud::{Markup, html};
use tracktwin_diagnosis::{BeforeAfter, Diagnosis, Estimate, SleeperValues};
use tracktwin_drawing::{Axis, Chart, Shown, figure};
use tracktwin_parameters::Parameter;

const SIZE: [f64; 2] = [1104.0, 240.0];

/// Maximum number of sleeper names that fit below a chart.
const NAMES: usize = 20;

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
    let shown = Shown::of(*parameter);
    let points = |side: fn(&BeforeAfter<Estimate>) -> Estimate| -> Vec<(f64, f64, f64)> {
        let point = |sleeper: &SleeperValues| {
            let Estimate { mean, sd } = side(pick(sleeper));
            (sleeper.x_m, mean / shown.divisor, 2.0 * sd / shown.divisor)
        };
        let finite = |(_, mean, two): &(f64, f64, f64)| mean.is_finite() && two.is_finite();
        diagnosis.track.iter().map(point).filter(finite).collect()
    };
    let (before, after) = (points(|both| both.before), points(|both| both.after));
    let both = addition(diagnosis).is_some();
    let drawn = if both { [&before[..], &after] } else { [&before[..], &before] };
    let ends = drawn.iter().flat_map(|side| side.iter()).flat_map(|p| [p.1 - p.2, p.1 + p.2]);
    let y = Axis::around(&format!("in {}", shown.unit), ends.map(|end| end.max(0.0)));
    let x = Axis::around("sleeper", diagnosis.track.iter().map(|sleeper| sleeper.x_m));
    let label = parameter.label();
    let title = format!("{}{}", label[..1].to_uppercase(), &label[1..]);
    let mut chart = Chart::new(&title, SIZE, x, y);
    mark_places(&mut chart, diagnosis);
    if both {
        chart.curve("was", &before);
        chart.explain("was", "before");
        chart.explain("a", "after");
    }
    chart.curve("a", if both { &after } else { &before });
    let step = diagnosis.track.len().div_ceil(NAMES);
    chart.name_x(diagnosis.track.iter().step_by(step).map(|s| (s.x_m, s.id.clone())).collect());
    chart.into_svg()
}

/// Draws thin lines at the positions of accepted physics, unless they cover nearly the whole track.
fn mark_places(chart: &mut Chart, diagnosis: &Diagnosis) {
    for location in accepted(diagnosis).filter_map(|hypothesis| hypothesis.location.as_ref()) {
        let places = numbers(diagnosis, &location.sleepers);
        let [from, to] = location.x_m;
        if to - from < 1e-3 {
            chart.vertical(from);
        } else if 2 * places.len() < diagnosis.track.len() {
            for place in places {
                chart.vertical(diagnosis.track[place].x_m);
            }
        }
    }
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
