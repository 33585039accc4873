//! Charts of receptances: magnitude and phase against frequency.

use num_complex::Complex64;
use tracktwin_drawing::{Axis, Chart, sheet, stand_alone};

/// Receptance between two points of the track.
#[derive(Clone, Debug)]
pub struct ReceptanceCurve {
    /// Name of the curve in the legend.
    pub name: String,
    /// Displacement per unit force in m/N, one value per frequency, in the convention `exp(+i w t)`.
    pub values: Vec<Complex64>,
}

const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];
const WIDTH: f64 = 860.0;
const HEIGHTS: [f64; 2] = [380.0, 240.0];

/// Returns magnitude (both axes logarithmic) above phase, as an SVG file.
///
/// `frequencies_hz` must be positive and ascending. From the seventh curve on, the colours repeat.
pub fn receptance_chart(frequencies_hz: &[f64], curves: &[ReceptanceCurve]) -> String {
    let (Some(&low), Some(&high)) = (frequencies_hz.first(), frequencies_hz.last()) else {
        return stand_alone("<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>");
    };
    let frequency = || Axis::logarithmic("frequency in Hz", low, high.max(low * 1.001));
    let magnitudes = curves.iter().flat_map(|curve| &curve.values).map(|value| value.norm());
    let positive: Vec<f64> = magnitudes.filter(|magnitude| *magnitude > 0.0).collect();
    let least = positive.iter().copied().fold(f64::INFINITY, f64::min).min(1.0);
    let most = positive.iter().copied().fold(0.0, f64::max).max(2.0 * least);
    let axis = Axis::logarithmic("receptance in m/N", least / 1.3, most * 1.3);
    let mut magnitude = Chart::new("Magnitude", [WIDTH, HEIGHTS[0]], frequency(), axis);
    let axis = Axis::linear("phase in degrees", -190.0, 190.0).every(90.0);
    let mut phase = Chart::new("Phase", [WIDTH, HEIGHTS[1]], frequency(), axis);
    for (curve, class) in curves.iter().zip(CLASSES.into_iter().cycle()) {
        let points = || frequencies_hz.iter().zip(&curve.values).map(|(f, value)| (*f, *value));
        magnitude.line(class, points().map(|(f, value)| (f, value.norm().max(least / 2.0))));
        for stretch in unbroken(points().map(|(f, value)| (f, value.arg().to_degrees()))) {
            phase.line(class, stretch);
        }
        magnitude.explain(class, &curve.name);
    }
    let charts = [([0.0; 2], magnitude.into_svg()), ([0.0, HEIGHTS[0]], phase.into_svg())];
    sheet("Receptance", [WIDTH, HEIGHTS[0] + HEIGHTS[1]], &charts)
}

/// Splits a phase curve at jumps of more than 180 degrees, so that no line crosses the chart.
fn unbroken(points: impl Iterator<Item = (f64, f64)>) -> Vec<Vec<(f64, f64)>> {
    let mut stretches: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    for point in points {
        let jumps = stretches
            .last()
            .and_then(|stretch| stretch.last())
            .is_some_and(|before: &(f64, f64)| (before.1 - point.1).abs() > 180.0);
        if jumps {
            stretches.push(Vec::new());
        }
        if let Some(stretch) = stretches.last_mut() {
            stretch.push(point);
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_that_jumps_is_cut_in_two() {
        let points = [(1.0, 170.0), (2.0, 179.0), (3.0, -179.0), (4.0, -170.0)];
        assert_eq!(unbroken(points.into_iter()).len(), 2);
    }

    #[test]
    fn every_curve_is_named_and_drawn_twice() {
        let values = vec![Complex64::new(1e-9, -1e-9), Complex64::new(2e-9, -3e-9)];
        let curve = ReceptanceCurve { name: "midspan".to_owned(), values };
        let svg = receptance_chart(&[100.0, 1000.0], &[curve]);
        assert!(svg.contains("midspan") && svg.starts_with("<svg"));
        assert_eq!(svg.matches("<polyline").count(), 2);
    }
}
