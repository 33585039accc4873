//! The page of an evaluation of a recording.

use crate::inversion_page;
use crate::map_picture::map_charts;
use crate::spectrum_picture::{chosen, spectrum_chart};
use crate::track_picture::track_charts;
use crate::{UNDER_LOAD, range_hz};
use maud::{Markup, html};
use tracktwin_drawing::{Shown, figure, page, significant};
use tracktwin_evaluation::{Estimate, Evaluation, Flag, SleeperEvaluation};
use tracktwin_inversion::Inversion;
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;
use tracktwin_signal::Extractor;
use tracktwin_signal::recording::Recording;

/// Number of sleepers with a chart of their LWPS.
const SLEEPERS_SHOWN: usize = 4;

/// Returns the HTML page of an evaluation: summary sentence, charts, estimates, provenance.
///
/// `inversion` is the inversion of the same recording, if available. `recording` and `extractor` are those
/// of the evaluation; signal and maps are computed from them. `command` is the command line that repeats
/// the evaluation.
pub fn evaluation_page(
    evaluation: &Evaluation,
    inversion: Option<&Inversion>,
    recording: &Recording,
    extractor: &Extractor,
    command: &str,
) -> String {
    let middle = evaluation.sleepers.get(evaluation.sleepers.len() / 2).map(|it| it.x_m);
    let body = html! {
        (banner(evaluation))
        @for note in notes(evaluation) { p { (note) } }
        p { (evaluation.unevenness.sentence()) }
        h2 { "Along the track" }
        (figure(&track_charts(evaluation), "Estimates at every sleeper (paper, Fig. 20): mean of the Gaussian processes with a \
             band of two standard deviations inside the library's range, and the average over \
             the ten best-matching library entries. Hollow dots: not valid, the track is \
             outside the library. Not resolved: on the library's test half the models are \
             hardly better than a constant."))
        @if let Some(inversion) = inversion { (inversion_page::section(inversion, evaluation)) }
        (measured_data(middle, recording, extractor))
        h2 { "Measured and matched spectra" }
        (figure(&spectra(evaluation), "Local wavelet power spectra (LWPS) of some sleepers, mean over the passes of one \
             speed, and those of the library entries nearest to them (paper, Fig. 11). At a \
             sleeper marked \"not valid\" a small distance has no meaning."))
        h2 { "Estimates" }
        p.note { "Mean ± one standard deviation. Rows in italics and their matches are not valid. \
             Match: mean distance of the best library entry, in dB and as mean absolute \
             percentage error of the levels above 1 µm/s² (paper, eq. 10). " (UNDER_LOAD) }
        div.scroll { (table(evaluation)) }
        h2 { "Provenance" }
        (provenance(evaluation, command))
    };
    page(&format!("Track under {}", evaluation.recording), &summary(evaluation, recording), &body)
}

/// The notes that are not already in the banner.
fn notes(evaluation: &Evaluation) -> impl Iterator<Item = &String> {
    let said = evaluation.outside_library.sentences();
    evaluation.notes.iter().filter(move |note| !said.contains(note))
}

/// Banner that lists invalid estimates and the required ranges of a new library.
fn banner(evaluation: &Evaluation) -> Markup {
    let sentences = evaluation.outside_library.sentences();
    html! {
        @if !sentences.is_empty() {
            div.banner role="alert" { @for sentence in &sentences { p { (sentence) } } }
        }
    }
}

/// Summary in one sentence.
fn summary(evaluation: &Evaluation, recording: &Recording) -> String {
    let speeds: Vec<String> =
        evaluation.provenance.speeds_km_h.iter().map(|speed| rounded(*speed, 4)).collect();
    let ranges: Vec<String> = evaluation
        .parameters()
        .into_iter()
        .filter(|parameter| {
            !matches!(parameter, Parameter::RailpadDamping | Parameter::BallastDamping)
        })
        .filter_map(|parameter| range(evaluation, parameter))
        .collect();
    let left_out = evaluation.sleepers.iter().filter(|sleeper| !is_whole(sleeper)).count();
    let remark = match left_out {
        0 => String::new(),
        all if all == evaluation.sleepers.len() => "; all are flagged (see the table)".to_owned(),
        1 => "; 1 sleeper is flagged (see the table) and left out of these ranges".to_owned(),
        _ => {
            format!(
                "; {left_out} sleepers are flagged (see the table) and left out of these ranges"
            )
        }
    };
    let at_edge = |sleeper: &&SleeperEvaluation| sleeper.flags.contains(&Flag::AtEdgeOfRange);
    let edge = match evaluation.sleepers.iter().filter(at_edge).count() {
        0 => String::new(),
        1 => "; 1 has a mean at an end of the models' range".to_owned(),
        count => format!("; {count} have a mean at an end of the models' range"),
    };
    let ranges = if ranges.is_empty() { "no valid estimate".to_owned() } else { ranges.join(", ") };
    format!(
        "{} sleepers evaluated from {} at {} km/h: {ranges}{remark}{edge}.",
        evaluation.sleepers.len(),
        if recording.passes.len() == 1 {
            "one pass".to_owned()
        } else {
            format!("{} passes", recording.passes.len())
        },
        speeds.join(", "),
    )
}

/// Whether all windows of a sleeper are complete at all speeds.
fn is_whole(sleeper: &SleeperEvaluation) -> bool {
    sleeper.flags.iter().all(|&flag| flag == Flag::AtEdgeOfRange)
}

/// Lowest and highest mean of a parameter over the sleepers with complete windows, or over all sleepers if
/// there are none.
fn range(evaluation: &Evaluation, parameter: Parameter) -> Option<String> {
    let valid = || evaluation.sleepers.iter().filter(|sleeper| sleeper.is_valid());
    let none = !valid().any(is_whole);
    let told = valid().filter(|sleeper| none || is_whole(sleeper));
    let mut means: Vec<f64> =
        told.filter_map(|sleeper| Some(sleeper.estimates.get(&parameter)?.mean)).collect();
    means.sort_by(f64::total_cmp);
    let shown = Shown::of(parameter);
    let text = |value: f64| significant(value / shown.divisor);
    let (low, high) = (text(*means.first()?), text(*means.last()?));
    Some(format!("{} {low} to {high} {}", parameter.label(), shown.unit))
}

/// Section with signal and maps around a position in m. It is left out if no pass covers the position.
pub(crate) fn measured_data(
    x_m: Option<f64>,
    recording: &Recording,
    extractor: &Extractor,
) -> Markup {
    let charts = x_m.map_or_else(Vec::new, |x_m| maps_at(x_m, recording, extractor));
    html! {
        @if !charts.is_empty() {
            h2 { "Measured data" }
            (figure(&charts, "Five spans in the middle of the recording (paper, Fig. 2); dashed lines are \
                 sleepers. The synchrosqueezed transform (SSWT) shows the same power as the wavelet \
                 transform (CWT), sharpened in frequency."))
        }
    }
}

/// Signal and maps around a position in m, in the pass at the highest speed of those that cover it.
fn maps_at(x_m: f64, recording: &Recording, extractor: &Extractor) -> Vec<String> {
    let covers = |pass: &usize| {
        let positions = &recording.passes[*pass].position_m;
        positions.first().is_some_and(|&first| first < x_m)
            && positions.last().is_some_and(|&last| x_m < last)
    };
    let fastest = (0..recording.passes.len())
        .filter(covers)
        .max_by(|&a, &b| recording.passes[a].speed_km_h.total_cmp(&recording.passes[b].speed_km_h));
    fastest.map_or_else(Vec::new, |pass| map_charts(recording, extractor, pass, x_m))
}

fn spectra(evaluation: &Evaluation) -> Vec<String> {
    let fastest = |sleeper: &&SleeperEvaluation| !sleeper.measured.is_empty();
    chosen(&evaluation.sleepers, SLEEPERS_SHOWN)
        .into_iter()
        .filter(fastest)
        .filter_map(|sleeper| {
            let measured = sleeper.measured.last()?;
            Some(spectrum_chart(sleeper, measured, &evaluation.frequencies_hz))
        })
        .collect()
}

/// Mean absolute difference between the measured level and the best match, in dB.
fn match_db(sleeper: &SleeperEvaluation) -> Option<f64> {
    let differences: Vec<f64> = sleeper
        .measured
        .iter()
        .filter_map(|measured| Some((measured, measured.matches.first()?)))
        .flat_map(|(measured, best)| measured.log_power.iter().zip(best))
        .map(|(measured, best)| (measured - best).abs() * 10.0 / std::f64::consts::LN_10)
        .collect();
    let count = differences.len() as f64;
    (count > 0.0).then(|| differences.iter().sum::<f64>() / count)
}

fn table(evaluation: &Evaluation) -> Markup {
    let parameters = evaluation.parameters();
    let cell = |parameter: Parameter, estimate: Option<&Estimate>| {
        estimate.map(|it| Shown::of(parameter).estimate(it.mean, it.sd)).unwrap_or_default()
    };
    html! {
        table {
            thead { tr {
                th { "sleeper" } th { "position" small { "m" } }
                @for &parameter in &parameters {
                    th { (parameter.label()) small { (parameter.symbol()) " in " (Shown::of(parameter).unit) } }
                }
                th { "match" small { "dB" } } th { "match" small { "%" } } th.words { "flags" }
            } }
            tbody {
                @for sleeper in &evaluation.sleepers {
                    tr.invalid[!sleeper.is_valid()] {
                        td { (sleeper.id) } td { (format!("{:.3}", sleeper.x_m)) }
                        @for &parameter in &parameters { td { (cell(parameter, sleeper.estimates.get(&parameter))) } }
                        td { @if let Some(best) = match_db(sleeper) { (significant(best)) } }
                        td { @if let Some(best) = sleeper.selector.mape.first() { (significant(100.0 * best)) } }
                        td.words { (sleeper.flags.iter().map(|flag| flag.label()).collect::<Vec<_>>().join(", ")) }
                    }
                }
                @for sleeper in &evaluation.unevaluated {
                    tr { td { (sleeper.id) } td { (format!("{:.3}", sleeper.x_m)) } td.words colspan=(parameters.len() + 3) { (sleeper.reason) } }
                }
            }
        }
    }
}

fn provenance(evaluation: &Evaluation, command: &str) -> Markup {
    let of = &evaluation.provenance;
    html! {
        dl {
            dt { "recording" } dd { (evaluation.recording) }
            dt { "method" } dd { "Gaussian processes on " (of.feature) "; " (of.combination) }
            dt { "campaign" } dd { (of.campaign) }
            dt { "library" } dd { code { (of.library_digest) } ", " (of.library_entries) " entries" }
            dt { "features" } dd { (range_hz(&evaluation.frequencies_hz)) "; " code { (of.feature_definition) } }
            dt { "program" } dd { "tracktwin " (of.code_version) }
        }
        p { "To reproduce, with the library of that digest and the models trained on it up to the highest of these frequencies:" }
        pre { (command) }
    }
}
