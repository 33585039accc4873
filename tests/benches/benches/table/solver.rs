//! Time steps, and the work of a worker for one case.

use super::{Error, Line};
use tracktwin_benches::{Track, cases, cost};
use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
use tracktwin_track::time::{Pass, pass, passes};

pub(crate) fn time_steps() -> Result<Vec<Line>, Error> {
    let mut lines = Vec::new();
    for (spans, rail_elements) in [(25, 8), (25, 4), (40, 8), (40, 4)] {
        let track = Track { spans, rail_elements, sleeper_elements: 8 };
        let (models, surfaces) = cases(track, 16);
        let way = track.pass(7.0);
        let of_plain = pass(&models[0], &way, &surfaces[0])?;
        let of_lanes = &passes(&models[..1], &way, &surfaces[..1])?[0];
        let difference = relative(&of_lanes.acceleration_m_s2, &of_plain.acceleration_m_s2);
        let steps = way.steps() * models.len();
        let fast = cost(|| passes(&models, &way, &surfaces)).of_each(steps);
        let name = format!("time step, {spans} spans of {rail_elements} elements");
        lines.push(Line::new(&name, fast, format!("{difference:.0e} off the plain solver")));
        if spans == 25 && rail_elements == 8 {
            let plain = cost(|| pass(&models[0], &way, &surfaces[0])).of_each(way.steps());
            lines.push(Line::new("time step of the plain solver", plain, "the reference"));
        }
    }
    Ok(lines)
}

/// Root mean square of the difference, divided by that of the reference.
fn relative(values: &[f64], reference: &[f64]) -> f64 {
    let power = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let difference = power(&mut values.iter().zip(reference).map(|(a, b)| a - b));
    (difference / power(&mut reference.iter().copied())).sqrt()
}

/// Work for a case of a campaign, in groups of eight: at every speed two spans of run-in, the window and
/// its margins, then the features.
pub(crate) fn case() -> Result<Vec<Line>, Error> {
    let track = Track { spans: 40, rail_elements: 4, sleeper_elements: 8 };
    let extractor = Extractor::new(&FeatureDefinition::default())?;
    let speeds_m_s = [7.0, 10.0, 13.0].map(|speed_km_h| speed_km_h / 3.6);
    let (spacing_m, margin_s) = (0.125, extractor.definition().margin_s);
    let way = |speed_m_s: f64| {
        let (window_m, margin_m) = (19.5 * spacing_m, margin_s * speed_m_s);
        let [start_m, end_m] =
            [window_m - margin_m - 2.0 * spacing_m, window_m + spacing_m + margin_m];
        Pass { speed_m_s, start_m, end_m, ..track.pass(1.0) }
    };
    let (models, surfaces) = cases(track, 8);
    let run = || speeds_m_s.map(|speed_m_s| passes(&models, &way(speed_m_s), &surfaces));
    let mut signals = Vec::new();
    for (records, speed_m_s) in run().into_iter().zip(speeds_m_s) {
        let step_m = speed_m_s * 1e-5;
        let [before, within] = [2.0 * spacing_m, spacing_m].map(|m| (m / step_m).ceil() as usize);
        for record in records? {
            let signal = Signal::new(1e5, record.acceleration_m_s2[before..].to_vec())?;
            signals.push((signal, 6000..6000 + within));
        }
    }
    let features = || {
        let each = signals.iter().map(|(signal, window)| extractor.extract(signal, window.clone()));
        each.collect::<Vec<_>>()
    };
    let count = models.len();
    let how = "40 spans of 4 elements, 7, 10 and 13 km/h";
    Ok(vec![
        Line::new("case: tracks and surfaces", cost(|| cases(track, 8)).of_each(count), how),
        Line::new("case: passes", cost(run).of_each(count), how),
        Line::new("case: features", cost(features).of_each(count), how),
    ])
}
