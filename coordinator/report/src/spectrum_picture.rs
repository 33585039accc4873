//! Measured LWPS of a sleeper with the best matches of the library (paper, Fig. 11).

use tracktwin_drawing::{Axis, Chart};
use tracktwin_evaluation::{Measured, SleeperEvaluation};
use tracktwin_number::rounded;

const SIZE: [f64; 2] = [560.0, 300.0];

/// Selects sleepers at even distances from those without flags, or from all if every sleeper has a flag.
pub(crate) fn chosen(sleepers: &[SleeperEvaluation], count: usize) -> Vec<&SleeperEvaluation> {
    let mut clean: Vec<_> = sleepers.iter().filter(|sleeper| sleeper.flags.is_empty()).collect();
    if clean.is_empty() {
        clean = sleepers.iter().collect();
    }
    let count = count.min(clean.len());
    (0..count).map(|index| clean[(2 * index + 1) * clean.len() / (2 * count)]).collect()
}

/// LWPS in dB against frequency, measured and matched, at one speed.
pub(crate) fn spectrum_chart(
    sleeper: &SleeperEvaluation,
    measured: &Measured,
    frequencies_hz: &[f64],
) -> String {
    let (Some(&low), Some(&high)) = (frequencies_hz.first(), frequencies_hz.last()) else {
        return String::new();
    };
    // ln of a power to dB.
    let decibel = 10.0 / std::f64::consts::LN_10;
    let points = |values: &[f64]| -> Vec<(f64, f64)> {
        frequencies_hz.iter().zip(values).map(|(&f, value)| (f, decibel * value)).collect()
    };
    let all = measured.matches.iter().chain([&measured.log_power]).flatten();
    let y = Axis::around("LWPS in dB re 1 (m/s²)²", all.map(|value| decibel * value));
    let valid = if sleeper.is_valid() { "" } else { " (not valid)" };
    let title = format!("{} at {} km/h{valid}", sleeper.id, rounded(measured.speed_km_h, 4));
    let x = Axis::logarithmic("frequency in Hz", low, high);
    let mut chart = Chart::new(&title, SIZE, x, y);
    for matched in &measured.matches {
        chart.line("thin b", points(matched));
    }
    chart.line("a", points(&measured.log_power));
    chart.explain("a", "measured");
    chart.explain("b", &format!("{} nearest entries", measured.matches.len()));
    chart.into_svg()
}
