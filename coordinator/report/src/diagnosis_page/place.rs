//! Measured and predicted levels by frequency, at the sites of accepted physics or of the largest mismatch.

use super::levels::{Side, measured, mismatch_norm, predicted, scatter};
use super::words::{accepted, addition, numbers, sleepers, speeds};
use maud::{Markup, PreEscaped, html};
use tracktwin_diagnosis::{Diagnosis, Levels, Location};
use tracktwin_drawing::{Axis, Chart, figure};

const SIZE: [f64; 2] = [361.0, 280.0];

/// Frequencies in Hz that are marked with a thin line.
const ROUND_HZ: [f64; 9] = [20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0];

/// Up to this number of sleepers of a location, the one with the largest mismatch is shown; above it, their
/// mean.
const TOGETHER: usize = 3;

/// Sleepers whose levels are shown as one mean.
pub(super) struct Site {
    sleepers: Vec<usize>,
    name: String,
}

impl Site {
    /// Sites of the accepted physics; if there are none, the sleeper with the largest mismatch.
    fn all(diagnosis: &Diagnosis) -> Vec<Self> {
        let mut sites: Vec<Self> = Vec::new();
        for hypothesis in accepted(diagnosis) {
            let site = hypothesis.location.as_ref().map_or_else(
                || Self::everywhere(diagnosis),
                |location| Self::of(diagnosis, location),
            );
            if sites.iter().all(|known| known.sleepers != site.sleepers) {
                sites.push(site);
            }
        }
        if sites.is_empty() { vec![Self::strangest(diagnosis)] } else { sites }
    }

    /// The first site.
    pub(super) fn first(diagnosis: &Diagnosis) -> Self {
        Self::all(diagnosis).swap_remove(0)
    }

    fn of(diagnosis: &Diagnosis, location: &Location) -> Self {
        let named = numbers(diagnosis, &location.sleepers);
        if named.len() > TOGETHER {
            let name = format!("mean over {}", sleepers(diagnosis, &location.sleepers));
            return Self { sleepers: named, name };
        }
        match largest_mismatch_of(diagnosis, &named) {
            Some(sleeper) => Self::one(diagnosis, sleeper),
            None => nearest(diagnosis, location.x_m)
                .map_or_else(|| Self::everywhere(diagnosis), |s| Self::one(diagnosis, s)),
        }
    }

    fn strangest(diagnosis: &Diagnosis) -> Self {
        let all: Vec<usize> = (0..diagnosis.track.len()).collect();
        largest_mismatch_of(diagnosis, &all)
            .map_or_else(|| Self::everywhere(diagnosis), |s| Self::one(diagnosis, s))
    }

    fn one(diagnosis: &Diagnosis, sleeper: usize) -> Self {
        Self { sleepers: vec![sleeper], name: diagnosis.track[sleeper].id.clone() }
    }

    fn everywhere(diagnosis: &Diagnosis) -> Self {
        let sleepers = (0..diagnosis.track.len()).collect();
        Self { sleepers, name: "mean over all sleepers".to_owned() }
    }

    /// Text for use after a quantity: "at SN18", "over all sleepers".
    pub(super) fn at(&self) -> String {
        self.name.strip_prefix("mean ").map_or_else(|| format!("at {}", self.name), str::to_owned)
    }

    /// Whether the track has other sleepers as well.
    pub(super) fn is_part(&self, diagnosis: &Diagnosis) -> bool {
        self.sleepers.len() < diagnosis.track.len()
    }

    /// All cells of this site.
    pub(super) fn cells(&self, diagnosis: &Diagnosis) -> impl Iterator<Item = [usize; 3]> {
        let speeds = diagnosis.levels.speeds_km_h.len();
        (0..speeds).flat_map(|speed| self.cells_at(diagnosis, speed))
    }

    /// Cells of this site at one speed.
    pub(super) fn cells_at(
        &self,
        diagnosis: &Diagnosis,
        speed: usize,
    ) -> impl Iterator<Item = [usize; 3]> {
        let bands = diagnosis.levels.frequency_hz.len();
        let of = move |&sleeper: &usize| (0..bands).map(move |band| [speed, sleeper, band]);
        self.sleepers.iter().flat_map(of)
    }

    /// Mean of a level over the sleepers of this site, in one band.
    fn mean(
        &self,
        speed: usize,
        band: usize,
        level: impl Fn([usize; 3]) -> Option<f64>,
    ) -> Option<f64> {
        let levels = self.sleepers.iter().filter_map(|&sleeper| level([speed, sleeper, band]));
        let (sum, count) = levels.fold((0.0, 0u32), |(sum, n), level| (sum + level, n + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

fn largest_mismatch_of(diagnosis: &Diagnosis, sleepers: &[usize]) -> Option<usize> {
    let mismatches = sleepers.iter().map(|&sleeper| (mismatch_norm(diagnosis, sleeper), sleeper));
    mismatches.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, sleeper)| sleeper)
}

fn nearest(diagnosis: &Diagnosis, [from, to]: [f64; 2]) -> Option<usize> {
    let distance = |at: &usize| (diagnosis.track[*at].x_m - 0.5 * (from + to)).abs();
    (0..diagnosis.track.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// One row of charts per site, one chart per speed.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let levels = &diagnosis.levels;
    if levels.speeds_km_h.is_empty() || levels.frequency_hz.is_empty() || diagnosis.track.is_empty()
    {
        return Markup::default();
    }
    let sites = Site::all(diagnosis);
    let searched =
        if accepted(diagnosis).next().is_none() { ", where they differ most" } else { "" };
    let heading = match &sites[..] {
        [site] => format!("Measured and predicted levels {}{searched}", site.at()),
        _ => "Measured and predicted levels at the places".to_owned(),
    };
    html! {
        h2 { (heading) }
        (keys(addition(diagnosis).as_deref()))
        @for site in &sites {
            @let charts: Vec<String> =
                (0..levels.speeds_km_h.len()).map(|speed| chart(diagnosis, site, speed)).collect();
            (figure(&charts, &caption(site)))
        }
    }
}

fn chart(diagnosis: &Diagnosis, site: &Site, speed: usize) -> String {
    let levels = &diagnosis.levels;
    let points = |level: &dyn Fn([usize; 3]) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |(band, &hz): (usize, &f64)| Some((hz, site.mean(speed, band, level)?));
        levels.frequency_hz.iter().enumerate().filter_map(point).collect()
    };
    let recorded = points(&|at| measured(levels, at));
    let before = points(&|at| predicted(levels, Side::Before, at));
    let after = points(&|at| predicted(levels, Side::After, at));
    let named = addition(diagnosis).is_some();
    let band = band(diagnosis, site, speed, if named { Side::After } else { Side::Before });
    let all = [&recorded, &before, &after].into_iter().flatten().map(|point| point.1);
    let y =
        Axis::around("level in dB re 1 (m/s²)²", all.chain(band.iter().flat_map(|b| [b.1, b.2])));
    let x = match (levels.frequency_hz.first(), levels.frequency_hz.last()) {
        (Some(&low), Some(&high)) if high > low => Axis::logarithmic("frequency in Hz", low, high),
        _ => Axis::around("frequency in Hz", levels.frequency_hz.iter().copied()),
    };
    // The speed first: many sleepers don't find room.
    let title = format!("{}, {}", speeds(&levels.speeds_km_h[speed..=speed]), site.name);
    let mut chart = Chart::new(&title, SIZE, x, y.clone());
    rule(&mut chart, levels, &y);
    if !band.is_empty() {
        chart.band("a", &band);
    }
    if named {
        chart.line("was", before);
        chart.line("a", after);
    } else {
        chart.line("a", before);
    }
    chart.dots("ink", 2.3, &recorded);
    chart.into_svg()
}

/// Draws thin lines with labels at round frequencies, closer than automatic ticks. They show which features
/// move from one speed to the next.
fn rule(chart: &mut Chart, levels: &Levels, y: &Axis) {
    let (Some(&low), Some(&high)) = (levels.frequency_hz.first(), levels.frequency_hz.last())
    else {
        return;
    };
    let inside = |hz: &f64| (low * 0.999..=high * 1.001).contains(hz);
    let round = ROUND_HZ.into_iter().filter(inside);
    let [bottom, top] = y.ends();
    round.clone().for_each(|hz| chart.line("rule", [(hz, bottom), (hz, top)]));
    chart.name_x(round.map(|hz| (hz, hz.to_string())).collect());
}

/// Expected band of two standard deviations around a prediction. Sleepers vary independently, so the band
/// of a mean over many sleepers is narrower.
fn band(diagnosis: &Diagnosis, site: &Site, speed: usize, side: Side) -> Vec<(f64, f64, f64)> {
    let levels = &diagnosis.levels;
    let many = (site.sleepers.len() as f64).sqrt();
    let of = |(band, &hz): (usize, &f64)| {
        let level = site.mean(speed, band, |at| predicted(levels, side, at))?;
        let two = 2.0 * scatter(levels, speed, band)? / many;
        Some((hz, level - two, level + two))
    };
    levels.frequency_hz.iter().enumerate().filter_map(of).collect()
}

/// Legend of dots, lines and band.
fn keys(with: Option<&str>) -> Markup {
    let sample = |inside: &str| {
        let svg = format!(
            r#"<svg class="chart" width="26" height="12" viewBox="0 0 26 12" aria-hidden="true">{inside}</svg>"#
        );
        PreEscaped(svg)
    };
    let line = |class: &str| format!(r#"<path class="line {class}" d="M0 6H26"/>"#);
    html! {
        div.keys {
            span { (sample(r#"<circle class="dot ink" cx="13" cy="6" r="2.8"/>"#)) "measured" }
            @if let Some(with) = with {
                span { (sample(&line("was"))) "before: re-tuned track only" }
                span { (sample(&line("a"))) "after: with " (with) }
            } @else {
                span { (sample(&line("a"))) "predicted by the re-tuned track" }
            }
            span { (sample(r#"<rect class="band a" width="26" height="12"/>"#)) "where 95 % of the measured levels should lie" }
        }
    }
}

fn caption(site: &Site) -> String {
    let what = match site.sleepers.len() {
        1 => format!(
            "Levels over one sleeper spacing around {}, mean over the passes of a speed.",
            site.name
        ),
        _ => format!("Levels averaged over the passes of a speed and {}.", site.at()),
    };
    format!(
        "{what} The band is twice the scatter of roughness alone; the prediction does not \
             explain dots outside it. Effects of the structure keep their frequency when the \
             speed changes; effects of the shape of rail or wheel move with the speed."
    )
}
