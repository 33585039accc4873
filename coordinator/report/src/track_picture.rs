//! Parameters along the track with their uncertainty (paper, Fig. 20).

use crate::valid_stretches;
use tracktwin_drawing::{Axis, Chart, Shown, sheet};
use tracktwin_evaluation::{Estimates, Evaluation, SleeperEvaluation};
use tracktwin_parameters::Parameter;

/// Order of the charts, as in the paper. Dampings, which the paper does not show, follow.
const PANELS: [Parameter; 6] = [
    Parameter::IrregularityLevel,
    Parameter::RailpadStiffness,
    Parameter::SleeperBendingStiffness,
    Parameter::BallastStiffness,
    Parameter::RailpadDamping,
    Parameter::BallastDamping,
];
const SIZE: [f64; 2] = [560.0, 250.0];

/// Returns the charts along the track in two columns, as an SVG file.
pub fn evaluation_chart(evaluation: &Evaluation) -> String {
    let charts = track_charts(evaluation);
    let size = [2.0 * SIZE[0], charts.len().div_ceil(2) as f64 * SIZE[1]];
    let place = |index: usize| [(index % 2) as f64 * SIZE[0], (index / 2) as f64 * SIZE[1]];
    let placed = charts.into_iter().enumerate().map(|(index, chart)| (place(index), chart));
    sheet("Parameters along the track", size, &placed.collect::<Vec<_>>())
}

/// One chart per parameter: Gaussian process with a band of two standard deviations, and model selector.
pub(crate) fn track_charts(evaluation: &Evaluation) -> Vec<String> {
    let known = evaluation.parameters();
    let panels = PANELS.into_iter().filter(|parameter| known.contains(parameter));
    panels.map(|parameter| panel(evaluation, parameter)).collect()
}

fn panel(evaluation: &Evaluation, parameter: Parameter) -> String {
    let shown = Shown::of(parameter);
    let estimates = |pick: fn(&SleeperEvaluation) -> &Estimates| -> Vec<ChartEstimate> {
        let value = |sleeper: &SleeperEvaluation| {
            let estimate = pick(sleeper).get(&parameter)?;
            let (mean, two_sd) = (estimate.mean / shown.divisor, 2.0 * estimate.sd / shown.divisor);
            Some(ChartEstimate { x_m: sleeper.x_m, mean, two_sd, valid: sleeper.is_valid() })
        };
        evaluation.sleepers.iter().filter_map(value).collect()
    };
    let known = &evaluation.provenance.parameters[&parameter];
    let range = known.range.map(|end| end / shown.divisor);
    let process = estimates(|sleeper| &sleeper.estimates);
    let selector = estimates(|sleeper| &sleeper.selector.estimates);
    let label = format!("{} in {}", parameter.symbol(), shown.unit);
    let x = Axis::around("position in m", process.iter().map(|estimate| estimate.x_m));
    let y = Axis::around(&label, range);
    let mut label = parameter.label().to_owned();
    label[..1].make_ascii_uppercase();
    if !known.beats_constant() {
        label += " (not resolved)";
    }
    let mut chart = Chart::new(&label, SIZE, x, y);
    draw(&mut chart, &process, &selector, range);
    chart.explain("a", "GP ± 2 sd");
    chart.explain("b", "selector");
    if process.iter().any(|estimate| !estimate.valid) {
        chart.explain("hollow", "not valid");
    }
    chart.into_svg()
}

/// Estimate of one parameter at a sleeper, in the unit of the chart.
struct ChartEstimate {
    x_m: f64,
    mean: f64,
    two_sd: f64,
    valid: bool,
}

/// Draws lines and bands through neighbouring valid estimates, and hollow dots for invalid ones.
fn draw(chart: &mut Chart, process: &[ChartEstimate], selector: &[ChartEstimate], range: [f64; 2]) {
    // The models know nothing beyond the library's range.
    let within = |value: f64| value.clamp(range[0], range[1]);
    let stretches = |of: &[ChartEstimate]| {
        valid_stretches(of, |it| it.valid.then_some((it.x_m, it.mean, it.two_sd)))
    };
    let points = |of: &[(f64, f64, f64)]| of.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>();
    for stretch in stretches(process) {
        let band: Vec<_> = stretch
            .iter()
            .map(|&(x, mean, two)| (x, within(mean - two), within(mean + two)))
            .collect();
        chart.band("a", &band);
    }
    for (class, line, of) in [("b", "thin b", selector), ("a", "a", process)] {
        for stretch in stretches(of) {
            chart.line(line, points(&stretch));
            chart.dots(class, 2.6, &points(&stretch));
        }
        let invalid: Vec<_> =
            of.iter().filter(|it| !it.valid).map(|it| (it.x_m, it.mean)).collect();
        chart.dots("hollow", 2.6, &invalid);
    }
}
