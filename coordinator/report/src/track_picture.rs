//! Parameters along the track with their uncertainty (paper, Fig. 20).

use crate::axis::Axis;
use crate::chart::Chart;
use crate::number::Shown;
use tracktwin_evaluation::{Estimates, Evaluation, SleeperEvaluation};
use tracktwin_parameters::Parameter;

/// Order of the panels, as in the paper; dampings, which the paper does not show, follow.
const PANELS: [Parameter; 6] = [
    Parameter::IrregularityLevel,
    Parameter::RailpadStiffness,
    Parameter::SleeperBendingStiffness,
    Parameter::BallastStiffness,
    Parameter::RailpadDamping,
    Parameter::BallastDamping,
];
const SIZE: [f64; 2] = [560.0, 250.0];

/// A chart a parameter: Gaussian process with a band of two standard deviations, and selector.
pub(crate) fn track_charts(evaluation: &Evaluation) -> Vec<String> {
    let known = evaluation.parameters();
    let panels = PANELS.into_iter().filter(|parameter| known.contains(parameter));
    panels.map(|parameter| panel(evaluation, parameter)).collect()
}

fn panel(evaluation: &Evaluation, parameter: Parameter) -> String {
    let shown = Shown::of(parameter);
    let estimates = |pick: fn(&SleeperEvaluation) -> &Estimates| -> Vec<(f64, f64, f64)> {
        let value = |sleeper: &SleeperEvaluation| {
            let estimate = pick(sleeper).get(&parameter)?;
            Some((sleeper.x_m, estimate.mean / shown.divisor, 2.0 * estimate.sd / shown.divisor))
        };
        evaluation.sleepers.iter().filter_map(value).collect()
    };
    let known = &evaluation.provenance.parameters[&parameter];
    let range = known.range.map(|end| end / shown.divisor);
    let process = estimates(|sleeper| &sleeper.estimates);
    let selector = estimates(|sleeper| &sleeper.selector.estimates);
    // The models know nothing beyond the library's range.
    let within = |value: f64| value.clamp(range[0], range[1]);
    let band: Vec<_> =
        process.iter().map(|&(x, mean, two)| (x, within(mean - two), within(mean + two))).collect();
    let label = format!("{} in {}", parameter.symbol(), shown.unit);
    let x = Axis::around("position in m", process.iter().map(|point| point.0));
    let y = Axis::around(&label, range);
    let mut label = parameter.label().to_owned();
    label[..1].make_ascii_uppercase();
    if !known.is_told() {
        label += " (not told)";
    }
    let mut chart = Chart::new(&label, SIZE, x, y);
    chart.band("a", &band);
    let means = |of: &[(f64, f64, f64)]| of.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>();
    chart.line("thin b", means(&selector));
    chart.dots("b", 2.6, &means(&selector));
    chart.line("a", means(&process));
    chart.dots("a", 2.6, &means(&process));
    chart.explain("a", "GP ± 2 sd");
    chart.explain("b", "selector");
    chart.into_svg()
}
