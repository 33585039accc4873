//! A figure with logarithmic axes, as SVG.

use std::fmt::Write as _;

const SIZE: [f64; 2] = [480.0, 320.0];
const LEFT: f64 = 70.0;
const BOTTOM: f64 = 50.0;
const MARGIN: f64 = 24.0;
const COLOURS: [&str; 3] = ["#1f6feb", "#c2410c", "#4d7c0f"];

/// A named curve.
pub struct Curve {
    /// Text in the legend.
    pub name: String,
    /// Points of the curve; both coordinates are positive.
    pub points: Vec<(f64, f64)>,
}

/// Returns an SVG figure with all curves in one frame.
pub fn figure(title: &str, x_name: &str, y_name: &str, curves: &[Curve]) -> String {
    let all = || curves.iter().flat_map(|curve| curve.points.iter().copied());
    let axes = [range(all().map(|point| point.0)), range(all().map(|point| point.1))];
    let at = |(x, y): (f64, f64)| {
        let share = |value: f64, [low, high]: [f64; 2]| (value / low).ln() / (high / low).ln();
        [
            LEFT + share(x, axes[0]) * (SIZE[0] - LEFT - MARGIN),
            SIZE[1] - BOTTOM - share(y, axes[1]) * (SIZE[1] - BOTTOM - MARGIN),
        ]
    };
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {} {}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/><text x="{LEFT}" y="15" font-weight="bold">{title}</text><text x="{}" y="{}">{x_name}</text><text transform="translate(14 {}) rotate(-90)">{y_name}</text>"#,
        SIZE[0],
        SIZE[1],
        SIZE[0] / 2.0 - 30.0,
        SIZE[1] - 8.0,
        SIZE[1] / 2.0 + 40.0
    );
    for (axis, [low, high]) in axes.into_iter().enumerate() {
        for value in ticks(low, high) {
            let [x, y] = at(if axis == 0 { (value, axes[1][0]) } else { (axes[0][0], value) });
            let (line, text) = if axis == 0 {
                (
                    format!("M{x:.1} {y:.1}V{MARGIN}"),
                    format!(r#"x="{x:.1}" y="{:.1}" text-anchor="middle""#, y + 16.0),
                )
            } else {
                let end = SIZE[0] - MARGIN;
                (
                    format!("M{x:.1} {y:.1}H{end}"),
                    format!(r#"x="{:.1}" y="{:.1}" text-anchor="end""#, x - 6.0, y + 4.0),
                )
            };
            let _ = write!(svg, r##"<path d="{line}" stroke="#ddd"/><text {text}>{value}</text>"##);
        }
    }
    for ((curve, colour), row) in curves.iter().zip(COLOURS).zip(1_u8..) {
        let points: Vec<_> = curve
            .points
            .iter()
            .map(|&point| at(point).map(|c| format!("{c:.1}")).join(","))
            .collect();
        let _ = write!(
            svg,
            r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="2"/><text x="{}" y="{}" fill="{colour}">{}</text>"#,
            points.join(" "),
            LEFT + 8.0,
            MARGIN + 14.0 * f64::from(row),
            curve.name
        );
    }
    svg + "</svg>\n"
}

/// A range that contains all values with a margin. It has at least one decade, so that constant curves look
/// constant.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values
        .fold([f64::INFINITY, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)]);
    let room = (10.0 / (high / low)).sqrt().max(1.3);
    [low / room, high * room]
}

/// Powers of ten within a range; for a range of less than two decades, also their multiples by 2 and 5.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let digits: &[u8] = if high / low < 100.0 { &[1, 2, 5] } else { &[1] };
    let digits = decades.flat_map(|decade| {
        digits.iter().map(move |digit| format!("{digit}e{decade}").parse().unwrap_or(f64::NAN))
    });
    digits.filter(|value: &f64| (low..=high).contains(value)).collect()
}
