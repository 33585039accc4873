//! Chart of a parameter along the track, without and with left-out physics.

use tracktwin_diagnosis::Estimate;
use tracktwin_drawing::{Axis, Chart, Shown};
use tracktwin_parameters::Parameter;

const SIZE: [f64; 2] = [1104.0, 240.0];

/// Largest number of sleeper names that fit below a chart.
const NAMES: usize = 20;

/// Values of a parameter at every sleeper.
pub(crate) struct AlongTrack<'a> {
    pub(crate) parameter: Parameter,
    /// Position in m and id of each sleeper.
    pub(crate) sleepers: Vec<(f64, &'a str)>,
    /// Estimates without the physics, in SI units.
    pub(crate) before: Vec<Estimate>,
    /// Estimates with it; `None` if there is none.
    pub(crate) after: Option<Vec<Estimate>>,
    /// Positions in m that a line marks.
    pub(crate) places_m: Vec<f64>,
}

impl AlongTrack<'_> {
    /// The chart, with bands of two standard deviations.
    pub(crate) fn chart(&self) -> String {
        let shown = Shown::of(self.parameter);
        let points = |estimates: &[Estimate]| -> Vec<(f64, f64, f64)> {
            let point = |(&(x_m, _), &Estimate { mean, sd }): (&(f64, &str), &Estimate)| {
                (x_m, mean / shown.divisor, 2.0 * sd / shown.divisor)
            };
            let finite = |(_, mean, two): &(f64, f64, f64)| mean.is_finite() && two.is_finite();
            self.sleepers.iter().zip(estimates).map(point).filter(finite).collect()
        };
        let before = points(&self.before);
        let after = self.after.as_deref().map(points);
        let drawn = before.iter().chain(after.iter().flatten());
        let ends = drawn.flat_map(|p| [p.1 - p.2, p.1 + p.2]);
        let y = Axis::around(&format!("in {}", shown.unit), ends.map(|end| end.max(0.0)));
        let x = Axis::around("sleeper", self.sleepers.iter().map(|(x_m, _)| *x_m));
        let label = self.parameter.label();
        let title = format!("{}{}", label[..1].to_uppercase(), &label[1..]);
        let mut chart = Chart::new(&title, SIZE, x, y);
        self.places_m.iter().for_each(|&x_m| chart.vertical(x_m));
        if after.is_some() {
            chart.curve("was", &before);
            chart.explain("was", "before");
            chart.explain("a", "after");
        }
        chart.curve("a", after.as_ref().unwrap_or(&before));
        let named = self.sleepers.iter().step_by(self.sleepers.len().div_ceil(NAMES));
        chart.name_x(named.map(|&(x_m, id)| (x_m, id.to_owned())).collect());
        chart.into_svg()
    }
}
