//! Accuracy of trained models (paper, Fig. 14).

use crate::{capital, range_hz};
use maud::{Markup, html};
use tracktwin_drawing::{Axis, Chart, Shown, figure, page, significant};
use tracktwin_parameters::Parameter;
use tracktwin_surrogate::{GroupKey, ModelGroup, ParameterModel, Tested, Trained};

const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// Returns the HTML page of trained models: errors of every model as charts and as a table, and predictions
/// of the best models for cases that they were not trained on.
pub fn models_page(models: &Trained, tested: &[Tested]) -> String {
    let charts: Vec<String> =
        parameters(models).into_iter().map(|parameter| mase_chart(models, parameter)).collect();
    let scatter = |(parameter, pairs): &Tested| {
        let range = models.groups().last().and_then(|group| of(group, *parameter))?.range;
        Some(scatter_chart(*parameter, range, pairs))
    };
    let scatters: Vec<String> = tested.iter().filter_map(scatter).collect();
    let body = html! {
        (figure(&charts, "Mean absolute scaled error on the test half of the library (paper, eq. 11 and Fig. \
             14); one bar per feature set, one group of bars per speed. Lower is better; a \
             constant achieves 25 %."))
        (figure(&scatters, "True and predicted values of test cases (paper, Fig. 14), by the models of most \
             speeds."))
        h2 { "All models" }
        p.note { "Folds: five, within the training half. Coverage: share of the test half inside its \
             90 % interval; bias as a share of the range." }
        div.scroll { (table(models)) }
        h2 { "Provenance" }
        dl {
            dt { "campaign" } dd { (models.campaign()) }
            dt { "library" } dd { code { (models.library_digest()) } }
            dt { "entries" } dd { (models.entries()) " (half to train, half to test; split seed " (models.split_seed()) ")" }
            dt { "features" } dd { (range_hz(models.frequencies_hz())) "; " code { (models.feature_definition()) } }
        }
    };
    page("Models of the track", &summary(models), &body)
}

/// MASE of one parameter's models on the test half (paper, Fig. 14, first row), as an inline SVG element.
/// The bars are grouped by speed, one bar per feature set.
fn mase_chart(models: &Trained, parameter: Parameter) -> String {
    let bars: Vec<(String, &GroupKey, f64)> = models
        .groups()
        .iter()
        .filter_map(|group| {
            let model = of(group, parameter)?;
            Some((speeds(group.key()), group.key(), 100.0 * model.score.mase_test))
        })
        .collect();
    let mut names: Vec<&str> = Vec::new();
    let mut places: Vec<&str> = Vec::new();
    for (speeds, key, _) in &bars {
        if !names.contains(&key.feature.as_str()) {
            names.push(&key.feature);
        }
        if !places.contains(&speeds.as_str()) {
            places.push(speeds);
        }
    }
    let most = bars.iter().map(|bar| bar.2).fold(5.0, f64::max);
    let x = Axis::linear("speed in km/h", -0.5, places.len() as f64 - 0.5);
    let title = format!("{} ({})", capital(parameter.label()), parameter.symbol());
    let mut chart =
        Chart::new(&title, [640.0, 270.0], x, Axis::linear("MASE in %", 0.0, 1.1 * most));
    let width = 0.84 / names.len().max(1) as f64;
    let place = |list: &[&str], name: &str| list.iter().position(|known| *known == name);
    for (speeds, key, mase) in &bars {
        let group = place(&places, speeds).unwrap_or_default() as f64;
        let index = place(&names, &key.feature).unwrap_or_default();
        let left = group - 0.42 + width * index as f64;
        let name = format!("{} at {speeds}: {} %", key.feature, significant(*mase));
        chart.bar(CLASSES[index % 6], [left, left + 0.92 * width], *mase, &name);
    }
    for (name, class) in names.iter().zip(CLASSES.into_iter().cycle()) {
        chart.explain(class, name);
    }
    chart.name_x(places.iter().enumerate().map(|(at, name)| (at as f64, (*name).into())).collect());
    chart.into_svg()
}

/// Predicted against true values of a parameter in SI units (paper, Fig. 14, second row), with the diagonal
/// over its range in the library, as an inline SVG element.
fn scatter_chart(
    parameter: Parameter,
    range: [f64; 2],
    true_and_predicted: &[(f64, f64)],
) -> String {
    let shown = Shown::of(parameter);
    let points: Vec<_> =
        true_and_predicted.iter().map(|(x, y)| (x / shown.divisor, y / shown.divisor)).collect();
    let [low, high] = range.map(|end| end / shown.divisor);
    let values = || points.iter().flat_map(|&(x, y)| [x, y]).chain([low, high]);
    let axis = |what: &str| {
        Axis::around(&format!("{what} {} in {}", parameter.symbol(), shown.unit), values())
    };
    let title = capital(parameter.label());
    let mut chart = Chart::new(&title, [380.0, 380.0], axis("true"), axis("predicted"));
    chart.dots("a pale", 1.6, &points);
    chart.line("ink", [(low, low), (high, high)]);
    chart.into_svg()
}

fn table(models: &Trained) -> Markup {
    let percent = |share: f64| significant(100.0 * share);
    html! {
        table {
            thead { tr {
                th { "parameter" } th.words { "features" } th { "speeds" small { "km/h" } }
                th { "MASE, test" small { "%" } } th { "MASE, folds" small { "%" } }
                th { "held" small { "%" } } th { "bias" small { "%" } }
            } }
            tbody {
                @for parameter in parameters(models) {
                    @for group in models.groups() {
                        @if let Some(model) = of(group, parameter) {
                            tr {
                                td { (parameter.label()) } td.words { (group.key().feature) } td { (speeds(group.key())) }
                                td { (percent(model.score.mase_test)) } td { (percent(model.score.mase_folds)) }
                                td { (percent(model.score.coverage_90_test)) } td { (percent(model.score.bias_test)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn summary(models: &Trained) -> String {
    let best = |parameter: Parameter| {
        let mases = models.groups().iter().filter_map(|group| of(group, parameter));
        let least = mases.map(|model| model.score.mase_test).fold(f64::INFINITY, f64::min);
        format!("{} {} %", parameter.symbol(), significant(100.0 * least))
    };
    let list: Vec<String> = parameters(models).into_iter().map(best).collect();
    format!(
        "Best test error (MASE) of models trained on half of {} library entries: {}.",
        models.entries(),
        list.join(", ")
    )
}

fn parameters(models: &Trained) -> Vec<Parameter> {
    let group = models.groups().first();
    group
        .map(|group| group.models().iter().map(|model| model.parameter).collect())
        .unwrap_or_default()
}

fn of(group: &ModelGroup, parameter: Parameter) -> Option<&ParameterModel> {
    group.models().iter().find(|model| model.parameter == parameter)
}

fn speeds(key: &GroupKey) -> String {
    key.speeds_km_h.iter().map(ToString::to_string).collect::<Vec<_>>().join(" + ")
}
