//! The page of a recording evaluated by inversion, alone or beside the models of a library.

use crate::evaluation_page::measured_data;
use crate::{UNDER_LOAD, capital, valid_stretches};
use maud::{Markup, html};
use tracktwin_drawing::{Axis, Chart, Shown, figure, page, sheet, significant};
use tracktwin_evaluation::{Estimate, Estimates, Evaluation, SleeperEvaluation};
use tracktwin_inversion::{COMMON, Inversion, PER_SLEEPER, Sleeper, beside};
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;
use tracktwin_signal::Extractor;
use tracktwin_signal::recording::Recording;

const SIZE: [f64; 2] = [1104.0, 240.0];

/// Maximum number of sleeper names that fit below the charts.
const NAMES: usize = 20;

/// Returns the HTML page of an inversion: summary sentence, charts, estimates, provenance.
///
/// `extractor` computes the maps of the signal; `command` is the command line that repeats the evaluation.
pub fn inversion_page(
    inversion: &Inversion,
    recording: &Recording,
    extractor: &Extractor,
    command: &str,
) -> String {
    let middle = inversion.sleepers.get(inversion.sleepers.len() / 2).map(|it| it.x_m);
    let body = html! {
        (banner(inversion))
        h2 { "Along the track" }
        (figure(&charts(inversion, None), "Posterior mean at every sleeper with a band of two standard deviations. Hollow \
             dots: not valid, the track model does not explain the measured data there. Vertical lines, if any: ends of a \
             transition or of a soft or stiff spot."))
        (common(inversion))
        (variation(inversion))
        (measured_data(middle, recording, extractor))
        h2 { "Estimates" }
        p.note { "Mean ± one standard deviation. Rows in italics are not valid. Misfit: mean square of the whitened residual, about 0.7 if the track model is valid; above 2 the track model does not explain the recording there. " (UNDER_LOAD) }
        div.scroll { (table(inversion)) }
        h2 { "Provenance" }
        (provenance(inversion, command))
    };
    page(&format!("Track under {}", inversion.recording), &summary(inversion), &body)
}

/// Returns the charts along the track, one below the other, as an SVG file.
pub fn inversion_chart(inversion: &Inversion) -> String {
    let charts = charts(inversion, None);
    let size = [SIZE[0], charts.len() as f64 * SIZE[1]];
    let placed = charts.into_iter().enumerate().map(|(row, it)| ([0.0, row as f64 * SIZE[1]], it));
    sheet("Parameters along the track", size, &placed.collect::<Vec<_>>())
}

/// Section that shows the inversion beside the Gaussian processes, on the page of an evaluation.
pub(crate) fn section(inversion: &Inversion, models: &Evaluation) -> Markup {
    html! {
        h2 { "Inversion" }
        p { "Inversion fits the track model to all passes and speeds, with separate stiffnesses \
             for every sleeper, and without the library." }
        @for compared in beside(inversion, models) { p { (capital(&compared.sentence())) } }
        @for note in inversion.notes.iter().filter(|note| !models.notes.contains(note)) { p { (note) } }
        (figure(&charts(inversion, Some(models)), "Bold: inversion. Dashed grey: Gaussian processes of the library. Bands are two standard deviations. Vertical lines, if any: ends of a transition or of a soft or stiff spot."))
        (common(inversion))
    }
}

/// Banner on the sleepers whose estimates are not valid, on an unusual value and on misplaced sleepers, and the other notes below it.
fn banner(inversion: &Inversion) -> Markup {
    let alerts = [
        inversion.unexplained_sentence(),
        inversion.unusual_sentence(),
        inversion.misplaced_sentence(),
    ];
    let alerts: Vec<String> = alerts.into_iter().flatten().collect();
    html! {
        @if !alerts.is_empty() {
            div.banner role="alert" { @for alert in &alerts { p { (alert) } } }
        }
        @for note in inversion.notes.iter().filter(|note| !alerts.contains(note)) { p { (note) } }
    }
}

/// Summary in one sentence.
fn summary(inversion: &Inversion) -> String {
    let speeds: Vec<String> =
        inversion.provenance.speeds_km_h.iter().map(|speed| rounded(*speed, 3)).collect();
    let ranges: Vec<String> = PER_SLEEPER.iter().filter_map(|&of| range(inversion, of)).collect();
    let ranges = if ranges.is_empty() { "no valid estimate".to_owned() } else { ranges.join(", ") };
    let passes: usize = inversion.provenance.passes.iter().sum();
    format!(
        "{} sleepers evaluated by inversion from {passes} {} at {} km/h: {ranges}.",
        inversion.sleepers.len(),
        if passes == 1 { "pass" } else { "passes" },
        speeds.join(", "),
    )
}

fn range(inversion: &Inversion, parameter: Parameter) -> Option<String> {
    let valid = inversion.sleepers.iter().filter(|sleeper| sleeper.is_valid());
    let mut means: Vec<f64> = valid.map(|sleeper| sleeper.estimates[&parameter].mean).collect();
    means.sort_by(f64::total_cmp);
    let shown = Shown::of(parameter);
    let text = |value: f64| significant(value / shown.divisor);
    let (low, high) = (text(*means.first()?), text(*means.last()?));
    Some(format!("{} {low} to {high} {}", parameter.label(), shown.unit))
}

/// One chart per parameter, with the estimates of the Gaussian processes behind if available.
fn charts(inversion: &Inversion, models: Option<&Evaluation>) -> Vec<String> {
    PER_SLEEPER.into_iter().map(|parameter| chart(inversion, models, parameter)).collect()
}

fn chart(inversion: &Inversion, models: Option<&Evaluation>, parameter: Parameter) -> String {
    let shown = Shown::of(parameter);
    let point = |x_m: f64, estimates: &Estimates| {
        let Estimate { mean, sd } = *estimates.get(&parameter)?;
        Some((x_m, mean / shown.divisor, 2.0 * sd / shown.divisor))
    };
    let own = |it: &Sleeper| point(it.x_m, &it.estimates);
    let valid = valid_stretches(&inversion.sleepers, |it| own(it).filter(|_| it.is_valid()));
    let invalid = inversion.sleepers.iter().filter(|sleeper| !sleeper.is_valid());
    let invalid: Vec<_> = invalid.filter_map(own).collect();
    let is_evaluated = |id: &str| inversion.sleepers.iter().any(|sleeper| sleeper.id == id);
    let beside = models.map_or(&[][..], |models| &models.sleepers);
    let behind = valid_stretches(beside, |it: &SleeperEvaluation| {
        let is_drawn = it.is_valid() && is_evaluated(&it.id);
        point(it.x_m, &it.estimates).filter(|_| is_drawn)
    });
    let drawn = || valid.iter().chain(&behind).flatten();
    let ends = drawn().flat_map(|&(_, mean, two)| [mean - two, mean + two]);
    let ends = ends.chain(invalid.iter().map(|p| p.1)).map(|end| end.max(0.0));
    let y = Axis::around(&format!("in {}", shown.unit), ends);
    let x = Axis::around("sleeper", inversion.sleepers.iter().map(|sleeper| sleeper.x_m));
    let mut chart = Chart::new(&capital(parameter.label()), SIZE, x, y);
    if !behind.is_empty() {
        for stretch in &behind {
            chart.curve("was", stretch);
        }
        chart.explain("was", "Gaussian processes");
        chart.explain("a", "inversion");
    }
    for stretch in &valid {
        chart.curve("a", stretch);
    }
    if parameter == Parameter::BallastStiffness {
        let is_end = |sleeper: &&Sleeper| {
            inversion.support_changes.iter().any(|change| change.sleepers.contains(&sleeper.id))
        };
        for sleeper in inversion.sleepers.iter().filter(is_end) {
            chart.vertical(sleeper.x_m);
        }
    }
    if !invalid.is_empty() {
        chart.dots("hollow", 2.6, &invalid.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>());
        chart.explain("hollow", "not valid");
    }
    let step = inversion.sleepers.len().div_ceil(NAMES).max(1);
    let names = inversion.sleepers.iter().step_by(step);
    chart.name_x(names.map(|sleeper| (sleeper.x_m, sleeper.id.clone())).collect());
    chart.into_svg()
}

/// Parameters common to all sleepers.
fn common(inversion: &Inversion) -> Markup {
    let Some(sleeper) = inversion.sleepers.get(inversion.sleepers.len() / 2) else {
        return Markup::default();
    };
    let text = |parameter: Parameter| {
        let shown = Shown::of(parameter);
        let Estimate { mean, sd } = sleeper.estimates[&parameter];
        format!("{} {} {}", parameter.label(), shown.estimate(mean, sd), shown.unit)
    };
    let all: Vec<String> = COMMON.iter().map(|&parameter| text(parameter)).collect();
    html! { p { "Common to the sleepers in the middle: " (all.join(", ")) "." } }
}

/// Unevenness estimated from the recording.
fn variation(inversion: &Inversion) -> Markup {
    let text = |parameter: Parameter| {
        let along = inversion.provenance.variation.get(&parameter)?;
        let scatter = 100.0 * along.smooth.hypot(along.independent);
        Some(format!("{} by {} %", parameter.label(), significant(scatter)))
    };
    let all: Vec<String> = PER_SLEEPER.iter().filter_map(|&parameter| text(parameter)).collect();
    html! { @if !all.is_empty() {
        p { "Unevenness along the track estimated from the recording (one standard deviation): " (all.join(", ")) "." }
    } }
}

fn table(inversion: &Inversion) -> Markup {
    let parameters = inversion.parameters();
    html! {
        table {
            thead { tr {
                th { "sleeper" } th { "position" small { "m" } }
                @for &parameter in &parameters {
                    th { (parameter.label()) small { (parameter.symbol()) " in " (Shown::of(parameter).unit) } }
                }
                th { "misfit" } th.words { "flags" }
            } }
            tbody {
                @for sleeper in &inversion.sleepers { (row(sleeper)) }
                @for sleeper in &inversion.unevaluated {
                    tr { td { (sleeper.id) } td { (format!("{:.3}", sleeper.x_m)) } td.words colspan=(parameters.len() + 2) { (sleeper.reason) } }
                }
            }
        }
    }
}

fn row(sleeper: &Sleeper) -> Markup {
    let flags: Vec<_> = sleeper.flags.iter().map(|flag| flag.label()).collect();
    html! {
        tr.invalid[!sleeper.is_valid()] {
            td { (sleeper.id) } td { (format!("{:.3}", sleeper.x_m)) }
            @for (&parameter, estimate) in &sleeper.estimates {
                td { (Shown::of(parameter).estimate(estimate.mean, estimate.sd)) }
            }
            td { (significant(sleeper.misfit)) }
            td.words { (flags.join(", ")) }
        }
    }
}

fn provenance(inversion: &Inversion, command: &str) -> Markup {
    let prior = inversion.provenance.prior.iter().map(|(&parameter, prior)| {
        let shown = Shown::of(parameter);
        let [low, high] = [-1.0, 1.0].map(|way| prior.median * (way * prior.log_sd).exp());
        let [low, high] = [low, high].map(|value| significant(value / shown.divisor));
        format!("{} {low} to {high} {}", parameter.label(), shown.unit)
    });
    html! {
        dl {
            dt { "recording" } dd { (inversion.recording) }
            dt { "method" } dd { "inversion of the frequency-domain track model: Gaussian posterior of the logarithms" }
            dt { "prior" } dd { "log-normal, one standard deviation about the median: " (prior.collect::<Vec<_>>().join(", ")) }
            dt { "program" } dd { "tracktwin " (inversion.provenance.code_version) }
        }
        p { "To reproduce:" }
        pre { (command) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use tracktwin_evaluation::{FORMAT, Flag};
    use tracktwin_inversion::{METHOD, Provenance, Unexplained};

    /// An inversion of one speed; `valid` says of each sleeper whether its estimates are valid.
    fn inversion(valid: &[bool]) -> Inversion {
        let sleeper = |(number, &valid): (u32, &bool)| Sleeper {
            id: format!("SN{number}"),
            x_m: f64::from(number),
            estimates: PER_SLEEPER.map(|of| (of, Estimate { mean: 1e7, sd: 1e6 })).into(),
            misfit: 0.7,
            flags: if valid { Vec::new() } else { vec![Flag::OutsideLibrary] },
        };
        let mut inversion = Inversion {
            format: FORMAT,
            recording: "ride".to_owned(),
            method: METHOD,
            provenance: Provenance {
                code_version: "1",
                speeds_km_h: vec![13.0],
                passes: vec![1],
                prior: BTreeMap::new(),
                variation: BTreeMap::new(),
            },
            sleepers: (1..).zip(valid).map(sleeper).collect(),
            unevaluated: Vec::new(),
            support_changes: Vec::new(),
            outside_library: Unexplained::default(),
            unusual: None,
            sleeper_pattern: None,
            notes: Vec::new(),
        };
        inversion.notes = inversion.sentences();
        inversion
    }

    #[test]
    fn the_banner_holds_the_sentence_on_invalid_estimates_wherever_it_stands_in_the_notes() {
        let mut inversion = inversion(&[true, false]);
        inversion.notes.insert(0, "left out: pass 2".to_owned());
        let text = banner(&inversion).into_string();
        let (alert, notes) = text.split_once("</div>").unwrap();
        assert!(alert.contains("at 1 of 2 sleepers (SN2)"), "{text}");
        assert!(notes.contains("left out: pass 2") && notes.contains("One speed only"), "{text}");
        assert!(!notes.contains("not valid"), "{text}");
    }

    #[test]
    fn without_invalid_estimates_there_is_no_banner() {
        let text = banner(&inversion(&[true; 2])).into_string();
        assert!(!text.contains("role=\"alert\"") && text.contains("One speed only"), "{text}");
    }

    #[test]
    fn no_line_crosses_sleepers_that_are_not_valid() {
        let inversion = inversion(&[true, true, false, true, true]);
        let chart = chart(&inversion, None, Parameter::RailpadStiffness);
        for class in ["line a", "band a"] {
            assert_eq!(chart.matches(&format!("class=\"{class}\"")).count(), 2, "{class}");
        }
        assert_eq!(chart.matches("class=\"dot hollow\"").count(), 1);
    }
}
