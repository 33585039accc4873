//! The page of a hammer test: stiffness along the sleepers, unloaded and under load (paper, Fig. 23).

use crate::{capital, valid_stretches};
use maud::{Markup, html};
use tracktwin_drawing::{Axis, Chart, Shown, figure, page, sheet, significant};
use tracktwin_hammer::{Beside, HammerRecord, Interval, Loaded, LoadedSleeper, Sleeper};
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Parameters of the charts, as in the paper; bending stiffness follows if the test determines it.
const ROWS: [Parameter; 3] =
    [Parameter::RailpadStiffness, Parameter::BallastStiffness, Parameter::SleeperBendingStiffness];
const SIZE: [f64; 2] = [1104.0, 260.0];

/// Maximum number of sleeper names that fit below the charts.
const NAMES: usize = 20;

/// Returns the HTML page of a hammer test. `loaded` is the evaluation of a recording for comparison;
/// `command` is the command line that repeats the evaluation.
pub fn hammer_page(
    record: &HammerRecord,
    loaded: Option<(&Loaded, &[Beside])>,
    command: &str,
) -> String {
    let body = html! {
        @if record.sleepers.iter().any(|sleeper| !sleeper.is_valid()) {
            div.banner role="alert" { (notes(record)) }
        } @else {
            (notes(record))
        }
        @if let Some((_, compared)) = loaded.filter(|(_, compared)| !compared.is_empty()) {
            h2 { "Without load and under the wheel" }
            @for compared in compared { p { (capital(&compared.sentence())) } }
        }
        h2 { "Along the track" }
        (figure(&charts(record, loaded.map(|it| it.0)), "Estimate at every sleeper with its 90 % interval (paper, Fig. 23). Hollow dots: not valid. Dashed grey: evaluation of a recording, under the load of the wheel."))
        h2 { "Estimates" }
        p.note { "Estimate with its 90 % interval. In brackets: the test does not tell the value, the interval is more than half as wide as before the test. Mean of all: the test does not tell this sleeper apart, the value is close to the mean of all sleepers. Rows in italics are not valid. Misfit: mean square of the residuals over its expectation. Railpad stiffness is that without the load of a wheel." }
        div.scroll { (table(record)) }
        h2 { "Provenance" }
        (provenance(record, loaded.map(|it| it.0), command))
    };
    page(&format!("Hammer test on {}", record.track), &summary(record), &body)
}

/// Returns the charts of the page, one below the other, as an SVG file.
pub fn hammer_chart(record: &HammerRecord, loaded: Option<&Loaded>) -> String {
    let charts = charts(record, loaded);
    let size = [SIZE[0], charts.len() as f64 * SIZE[1]];
    let placed = charts.into_iter().enumerate().map(|(row, it)| ([0.0, row as f64 * SIZE[1]], it));
    sheet("Stiffness along the track", size, &placed.collect::<Vec<_>>())
}

fn notes(record: &HammerRecord) -> Markup {
    html! { @for note in &record.notes { p { (note) } } }
}

fn summary(record: &HammerRecord) -> String {
    let range = |parameter: Parameter| {
        let valid = record.sleepers.iter().filter(|sleeper| sleeper.is_valid());
        let mut all: Vec<f64> =
            valid.map(|sleeper| sleeper.estimates[&parameter].estimate).collect();
        all.sort_by(f64::total_cmp);
        let shown = Shown::of(parameter);
        let text = |value: &f64| significant(value / shown.divisor);
        let (low, high) = (text(all.first()?), text(all.last()?));
        Some(format!("{} {low} to {high} {}", parameter.label(), shown.unit))
    };
    let ranges: Vec<String> = ROWS[..2].iter().filter_map(|&of| range(of)).collect();
    let ranges = if ranges.is_empty() { "no valid estimate".to_owned() } else { ranges.join(", ") };
    format!(
        "{} sleepers evaluated from {} receptances: {ranges}.",
        record.sleepers.len(),
        record.receptances
    )
}

/// One chart per parameter; bending stiffness only if the test determines it at some sleeper.
fn charts(record: &HammerRecord, loaded: Option<&Loaded>) -> Vec<String> {
    let is_told = |parameter: &Parameter| {
        ROWS[..2].contains(parameter)
            || record.sleepers.iter().any(|sleeper| sleeper.estimates[parameter].resolved)
    };
    ROWS.into_iter().filter(is_told).map(|parameter| chart(record, loaded, parameter)).collect()
}

fn chart(record: &HammerRecord, loaded: Option<&Loaded>, parameter: Parameter) -> String {
    let shown = Shown::of(parameter);
    let scaled = |it: &Interval| Interval {
        estimate: it.estimate / shown.divisor,
        lower: it.lower / shown.divisor,
        upper: it.upper / shown.divisor,
        ..*it
    };
    let own = |sleeper: &Sleeper| (sleeper.x_m, scaled(&sleeper.estimates[&parameter]));
    let valid = valid_stretches(&record.sleepers, |it| it.is_valid().then(|| own(it)));
    let invalid = record.sleepers.iter().filter(|sleeper| !sleeper.is_valid());
    let invalid: Vec<_> = invalid.map(own).collect();
    let places = || record.sleepers.iter().map(|sleeper| sleeper.x_m);
    let (first, last) = (places().fold(f64::MAX, f64::min), places().fold(f64::MIN, f64::max));
    // Ends of a 90 % interval, as those of the hammer test.
    let under_load = |[mean, sd]: [f64; 2]| (mean / shown.divisor, NORMAL_90 * sd / shown.divisor);
    let beside = |sleeper: &LoadedSleeper| {
        let (mean, half) = under_load(sleeper.estimate(parameter)?);
        (first..=last).contains(&sleeper.x_m).then_some((sleeper.x_m, mean, half))
    };
    let loaded = loaded.map_or(&[][..], |loaded| &loaded.sleepers);
    let behind = valid_stretches(loaded, beside);
    let ends = valid.iter().flatten().flat_map(|(_, it)| [it.lower, it.upper]);
    let compared = behind.iter().flatten();
    let ends = ends.chain(compared.flat_map(|&(_, mean, half)| [mean - half, mean + half]));
    let ends = ends.chain(invalid.iter().map(|(_, it)| it.estimate)).map(|end| end.max(0.0));
    let y = Axis::around(&format!("in {}", shown.unit), ends);
    let x = Axis::around("sleeper", places());
    let mut chart = Chart::new(&capital(parameter.label()), SIZE, x, y);
    if !behind.is_empty() {
        for stretch in &behind {
            chart.curve("was", stretch);
        }
        chart.explain("was", "under the wheel");
        chart.explain("a", "hammer test");
    }
    for stretch in &valid {
        let band: Vec<_> = stretch.iter().map(|(x_m, it)| (*x_m, it.lower, it.upper)).collect();
        let line: Vec<_> = stretch.iter().map(|(x_m, it)| (*x_m, it.estimate)).collect();
        chart.band("a", &band);
        chart.line("a", line.iter().copied());
        chart.dots("a", 2.6, &line);
    }
    if !invalid.is_empty() {
        let points: Vec<_> = invalid.iter().map(|(x_m, it)| (*x_m, it.estimate)).collect();
        chart.dots("hollow", 2.6, &points);
        chart.explain("hollow", "not valid");
    }
    let step = record.sleepers.len().div_ceil(NAMES).max(1);
    let names = record.sleepers.iter().step_by(step);
    chart.name_x(names.map(|sleeper| (sleeper.x_m, sleeper.id.clone())).collect());
    chart.into_svg()
}

fn table(record: &HammerRecord) -> Markup {
    let parameters: Vec<Parameter> = record.prior.keys().copied().collect();
    html! {
        table {
            thead { tr {
                th { "sleeper" } th { "position" small { "m" } }
                @for &parameter in &parameters {
                    th { (parameter.label()) small { (parameter.symbol()) " in " (Shown::of(parameter).unit) } }
                }
                th { "misfit" } th.words { "flags" }
            } }
            tbody { @for sleeper in &record.sleepers { (row(sleeper, &parameters)) } }
        }
    }
}

fn row(sleeper: &Sleeper, parameters: &[Parameter]) -> Markup {
    let text = |parameter: &Parameter| {
        let (shown, it) = (Shown::of(*parameter), &sleeper.estimates[parameter]);
        let [estimate, lower, upper] =
            [it.estimate, it.lower, it.upper].map(|value| significant(value / shown.divisor));
        let text = format!("{estimate} ({lower} to {upper})");
        let text = if it.resolved { text } else { format!("[{text}]") };
        if it.own { text } else { format!("{text}, mean of all") }
    };
    let flags: Vec<String> =
        sleeper.flags.iter().map(|flag| flag.name().replace('_', " ")).collect();
    html! {
        tr.invalid[!sleeper.is_valid()] {
            td { (sleeper.id) } td { (format!("{:.3}", sleeper.x_m)) }
            @for parameter in parameters { td { (text(parameter)) } }
            td { (sleeper.misfit.map_or_else(|| "–".to_owned(), significant)) }
            td.words { (flags.join(", ")) }
        }
    }
}

fn provenance(record: &HammerRecord, loaded: Option<&Loaded>, command: &str) -> Markup {
    let prior = record.prior.iter().map(|(&parameter, &[median, deviation])| {
        let shown = Shown::of(parameter);
        let [low, high] = [-1.0, 1.0]
            .map(|way: f64| significant(median * (way * deviation).exp() / shown.divisor));
        format!("{} {low} to {high} {}", parameter.label(), shown.unit)
    });
    let unevenness = record.unevenness.iter().map(|(parameter, deviation)| {
        format!("{} {} %", parameter.label(), significant(100.0 * deviation))
    });
    let [low, high] = record.range_hz;
    html! {
        dl {
            dt { "track" } dd { (record.track) }
            @if let Some(loaded) = loaded { dt { "evaluation beside it" } dd { (loaded.recording) } }
            dt { "method" } dd { "fit of the frequency-domain track model to the logarithms of the receptances: Gaussian posterior of the logarithms" }
            dt { "frequencies" } dd { (significant(low)) " to " (significant(high)) " Hz" }
            dt { "model error" } dd { (significant(record.model_error_db)) " dB, estimated from the residuals" }
            dt { "unevenness" } dd { (unevenness.collect::<Vec<_>>().join(", ")) ", estimated from the receptances" }
            dt { "prior" } dd { "log-normal, one standard deviation about the median: " (prior.collect::<Vec<_>>().join(", ")) }
            dt { "program" } dd { "tracktwin " (record.code_version) }
        }
        p { "To reproduce:" }
        pre { (command) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use tracktwin_hammer::{Gain, SleeperFlag};

    fn sleeper(number: u32, own: bool, flags: Vec<SleeperFlag>) -> Sleeper {
        let interval = Interval { estimate: 8e7, lower: 7e7, upper: 9e7, resolved: true, own };
        Sleeper {
            id: format!("SN{number}"),
            x_m: f64::from(number),
            estimates: ROWS.map(|of| (of, interval)).into(),
            misfit: Some(1.0),
            flags,
        }
    }

    #[test]
    fn a_value_that_is_the_mean_of_all_sleepers_is_marked() {
        let cell = |own: bool| {
            row(&sleeper(1, own, Vec::new()), &[Parameter::RailpadStiffness]).into_string()
        };
        assert!(cell(false).contains("90.0), mean of all</td>"), "{}", cell(false));
        assert!(!cell(true).contains("mean of all"), "{}", cell(true));
    }

    #[test]
    fn no_line_crosses_sleepers_that_are_not_valid() {
        let flags =
            |number: u32| if number == 3 { vec![SleeperFlag::Unexplained] } else { Vec::new() };
        let record = HammerRecord {
            format: tracktwin_hammer::FORMAT,
            code_version: "1",
            track: "V-Track".to_owned(),
            receptances: 5,
            range_hz: [100.0, 4000.0],
            gain: Gain { estimate: 1.0, lower: 0.9, upper: 1.1, is_far: false },
            model_error_db: 0.4,
            unevenness: BTreeMap::new(),
            prior: BTreeMap::new(),
            sleepers: (1..=5).map(|number| sleeper(number, true, flags(number))).collect(),
            notes: Vec::new(),
        };
        let chart = chart(&record, None, Parameter::RailpadStiffness);
        for class in ["line a", "band a"] {
            assert_eq!(chart.matches(&format!("class=\"{class}\"")).count(), 2, "{class}");
        }
        assert_eq!(chart.matches("class=\"dot hollow\"").count(), 1);
    }
}
