//! Axes of charts: position of a value on the axis, and ticks.

/// A linear or logarithmic axis with its label.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Label with the unit.
    pub label: String,
    low: f64,
    high: f64,
    logarithmic: bool,
    /// Distance of the ticks; chosen automatically if `None`.
    step: Option<f64>,
}

impl Axis {
    /// A linear axis that covers these values, with a margin at both ends.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let [low, high] = ends(values);
        let room = 0.05 * (high - low);
        Self::linear(label, low - room, high + room)
    }

    /// A linear axis from `low` to `high`. Equal ends are moved apart, because an axis has a length.
    pub fn linear(label: &str, low: f64, high: f64) -> Self {
        let room = if low == high { 0.5 * high.abs().max(1.0) } else { 0.0 };
        let (low, high) = (low - room, high + room);
        Self { label: label.to_owned(), low, high, logarithmic: false, step: None }
    }

    /// The same axis with a tick at every multiple of `step`.
    #[must_use]
    pub fn every(self, step: f64) -> Self {
        Self { step: Some(step), ..self }
    }

    /// A logarithmic axis from `low` to `high`, which must both be positive.
    pub fn logarithmic(label: &str, low: f64, high: f64) -> Self {
        Self { label: label.to_owned(), low, high, logarithmic: true, step: None }
    }

    /// Lowest and highest value of the axis.
    pub const fn ends(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Relative position of `value` on the axis: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Values of the ticks with their labels; at most about `at_most` ticks.
    pub fn ticks(&self, at_most: usize) -> Vec<(f64, String)> {
        if self.logarithmic { self.decades(at_most) } else { self.round_values(at_most) }
    }

    fn round_values(&self, at_most: usize) -> Vec<(f64, String)> {
        let raw = (self.high - self.low) / at_most as f64;
        let decade = 10f64.powf(raw.log10().floor());
        let ends = |step: f64| ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        let steps = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2].map(|round| round * decade);
        // The finest that leaves room; a finer one where that gives less than two ticks.
        let roomy = steps.iter().rposition(|step| *step >= raw).unwrap_or(0);
        let is_scale = |step: &&f64| ends(**step).1 > ends(**step).0;
        let chosen = steps[roomy..].iter().find(is_scale).unwrap_or(&steps[roomy]);
        let step = self.step.unwrap_or(*chosen);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let (first, last) = ends(step);
        (first..=last)
            .map(|tick| tick as f64 * step)
            .map(|value| (value, format!("{value:.decimals$}")))
            .collect()
    }

    fn decades(&self, at_most: usize) -> Vec<(f64, String)> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let within = |steps: &[f64]| -> Vec<f64> {
            let values = decades.clone().flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
            values.filter(|value| (-1e-9..=1.0 + 1e-9).contains(&self.place(*value))).collect()
        };
        let finest = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]];
        let fit = finest.into_iter().map(within).find(|ticks| ticks.len() <= at_most);
        let ticks = fit.unwrap_or_else(|| within(&[1.0]).into_iter().step_by(2).collect());
        ticks.into_iter().map(|value| (value, power_of_ten(value))).collect()
    }
}

/// Lowest and highest of the values; 0 and 1 if there are no values.
fn ends(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let fold = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
    let [low, high] = values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], fold);
    if low.is_finite() { [low, high] } else { [0.0, 1.0] }
}

/// Formats a value with plain digits between 1e-3 and 1e5, otherwise as a power such as 2·10⁻⁹.
fn power_of_ten(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        return format!("{}", (value * 1e6).round() / 1e6);
    }
    let exponent = (value.log10() + 1e-9).floor();
    let digits = format!("{exponent:.0}");
    let raised: String = digits.chars().map(superscript).collect();
    match (value / 10f64.powf(exponent)).round() {
        1.0 => format!("10{raised}"),
        factor => format!("{factor}·10{raised}"),
    }
}

const fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        _ => '⁹',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, at_most: usize) -> Vec<String> {
        axis.ticks(at_most).into_iter().map(|tick| tick.1).collect()
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(texts(&Axis::linear("", 0.7, 4.3), 5), ["1", "2", "3", "4"]);
        assert_eq!(texts(&Axis::linear("", -0.1, 0.32), 5), ["-0.1", "0.0", "0.1", "0.2", "0.3"]);
        let decades = Axis::logarithmic("", 50.0, 4000.0);
        assert_eq!(texts(&decades, 8), ["50", "100", "200", "500", "1000", "2000"]);
        assert_eq!(texts(&Axis::logarithmic("", 1e-9, 1e-7), 3), ["10⁻⁹", "10⁻⁸", "10⁻⁷"]);
        // One tick alone is no scale.
        assert_eq!(texts(&Axis::linear("", 110.0, 290.0), 2), ["150", "200", "250"]);
    }

    #[test]
    fn the_ends_lie_at_zero_and_one() {
        for axis in [Axis::linear("", 2.0, 3.0), Axis::logarithmic("", 2.0, 3.0)] {
            assert!(axis.place(2.0).abs() < 1e-12 && (axis.place(3.0) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn an_axis_around_one_value_still_has_a_length() {
        assert!(!Axis::around("", [3.0]).ticks(5).is_empty());
        let equal_ends = Axis::linear("", 3.0, 3.0);
        assert_eq!((equal_ends.ends(), equal_ends.place(3.0)), ([1.5, 4.5], 0.5));
        assert!(!equal_ends.ticks(5).is_empty());
    }
}
