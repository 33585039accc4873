//! Maps of measured minus predicted levels over position and frequency, at each speed, before and after.

use super::levels::{Side, all_cells, difference, usual_scatter};
use super::quantity::digits;
use super::words::{addition, chance, numbers, sleepers, speeds, stretch};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Mismatch};
use tracktwin_drawing::{Axis, Chart, figure};

/// Width of a map in px, in a row of two and in a row of three.
const WIDTHS: [f64; 2] = [546.0, 361.0];
const HEIGHT: f64 = 250.0;

/// Number of shades on either side of zero.
const SHADES: usize = 6;

/// Possible ends of the colour scale in dB; with six shades, a shade has 0.5 to 6 dB.
const LIMITS_DB: [f64; 7] = [3.0, 6.0, 9.0, 12.0, 18.0, 24.0, 36.0];

/// Minimum end of the scale in standard deviations, so that random differences have a pale shade.
const SCATTERS: f64 = 6.0;

/// Maximum number of columns of cells in a map.
const COLUMNS_MAX: usize = 240;

/// Width of a sleeper's name in px.
const NAME_WIDTH: f64 = 46.0;

/// The maps with their scale, and a list of the mismatches.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let levels = &diagnosis.levels;
    if levels.speeds_km_h.is_empty() || levels.frequency_hz.is_empty() || diagnosis.track.is_empty()
    {
        return html! { @if !diagnosis.mismatches.is_empty() { (mismatches(diagnosis)) } };
    }
    let limit_db = limit(diagnosis);
    let with = addition(diagnosis);
    let sides: &[Side] =
        if with.is_some() { &[Side::Before, Side::After] } else { &[Side::Before] };
    let panels: Vec<String> = (0..levels.speeds_km_h.len())
        .flat_map(|speed| sides.iter().map(move |side| (speed, *side)))
        .map(|(speed, side)| panel(diagnosis, speed, side, limit_db))
        .collect();
    html! {
        h2 { "Differences between recording and prediction" }
        (scale(limit_db))
        (figure(&panels, &caption(diagnosis, with.as_deref())))
        (mismatches(diagnosis))
    }
}

/// End of the colour scale in dB. 98 % of the differences before the extension are inside the scale.
fn limit(diagnosis: &Diagnosis) -> f64 {
    let levels = &diagnosis.levels;
    let mut sizes: Vec<f64> = all_cells(diagnosis)
        .filter_map(|at| difference(levels, Side::Before, at))
        .map(f64::abs)
        .collect();
    sizes.sort_by(f64::total_cmp);
    let nearly_all = sizes.get(sizes.len() * 49 / 50).copied().unwrap_or_default();
    let needed = nearly_all.max(SCATTERS * usual_scatter(levels).unwrap_or_default());
    LIMITS_DB.into_iter().find(|limit| *limit >= needed).unwrap_or(LIMITS_DB[LIMITS_DB.len() - 1])
}

fn panel(diagnosis: &Diagnosis, speed: usize, side: Side, limit_db: f64) -> String {
    let levels = &diagnosis.levels;
    let km_h = levels.speeds_km_h[speed];
    let at = speeds(&[km_h]);
    let grid = Grid::new(diagnosis);
    let title = match (side, addition(diagnosis)) {
        (Side::After, Some(with)) => format!("{at}: after, with {with}"),
        (_, Some(_)) => format!("{at}: before, re-tuned track only"),
        (_, None) => at,
    };
    let size = [WIDTHS[usize::from(addition(diagnosis).is_none())], HEIGHT];
    let mut chart = Chart::new(&title, size, grid.position_axis(), grid.frequency_axis());
    let mut shades = vec![Vec::new(); 2 * SHADES];
    for (edges, db) in grid.cells(speed, side) {
        if let Some(shade) = shade(db, limit_db) {
            shades[shade].push(edges);
        }
    }
    for (shade, cells) in shades.iter().enumerate().filter(|(_, cells)| !cells.is_empty()) {
        chart.cells(&class(shade), cells);
    }
    let here = |mismatch: &&Mismatch| mismatch.speeds_km_h.contains(&km_h);
    for mismatch in diagnosis.mismatches.iter().filter(here) {
        let [x, y] = grid.around(mismatch);
        let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])];
        chart.line(if side == Side::Before { "box" } else { "box then" }, corners);
    }
    chart.name_x(grid.names(size[0]));
    chart.into_svg()
}

/// Index of a difference's shade. The first half of the indices is for negative differences; `None` is for
/// differences near zero.
fn shade(difference_db: f64, limit_db: f64) -> Option<usize> {
    let steps = (difference_db.abs() / limit_db * SHADES as f64).round() as usize;
    let strength = steps.min(SHADES).checked_sub(1)?;
    Some(if difference_db < 0.0 { strength } else { SHADES + strength })
}

fn class(shade: usize) -> String {
    let side = if shade < SHADES { "less" } else { "more" };
    format!("{side} s{}", shade % SHADES + 1)
}

/// Number of sleepers per cell, so that a long track has no more cells than a map has pixels.
fn shared(diagnosis: &Diagnosis) -> usize {
    diagnosis.track.len().div_ceil(COLUMNS_MAX).max(1)
}

/// Edges of the cells along position and frequency.
struct Grid<'a> {
    diagnosis: &'a Diagnosis,
    half_span_m: f64,
    half_band: f64,
}

impl<'a> Grid<'a> {
    fn new(diagnosis: &'a Diagnosis) -> Self {
        let track = &diagnosis.track;
        let bands = &diagnosis.levels.frequency_hz;
        // The middle one of the distances: a gap in the list leaves a gap in the map.
        let mut spans: Vec<f64> = track.windows(2).map(|pair| pair[1].x_m - pair[0].x_m).collect();
        spans.sort_by(f64::total_cmp);
        let span_m = spans.get(spans.len() / 2).copied().filter(|span| *span > 0.0).unwrap_or(1.0);
        let ratio = match bands[..] {
            [first, .., last] => (last / first).powf(1.0 / (bands.len() - 1) as f64),
            _ => 2.0,
        };
        Self { diagnosis, half_span_m: 0.5 * span_m, half_band: ratio.sqrt() }
    }

    /// The cells of a speed: edges, and mean difference of the sleepers in dB.
    fn cells(&self, speed: usize, side: Side) -> Vec<([f64; 4], f64)> {
        let Diagnosis { track, levels, .. } = self.diagnosis;
        let many = shared(self.diagnosis);
        let sleepers = |first: usize| first..(first + many).min(track.len());
        let cell = |first: usize, band: usize| {
            let differences: Vec<f64> = sleepers(first)
                .filter_map(|sleeper| difference(levels, side, [speed, sleeper, band]))
                .collect();
            let [left, _, low, high] = self.cell(first, band);
            let [_, right, _, _] = self.cell(sleepers(first).end - 1, band);
            let mean = differences.iter().sum::<f64>() / differences.len() as f64;
            (!differences.is_empty()).then_some(([left, right, low, high], mean))
        };
        let bands = levels.frequency_hz.len();
        (0..track.len())
            .step_by(many)
            .flat_map(|first| (0..bands).filter_map(move |band| cell(first, band)))
            .collect()
    }

    /// Left, right, low and high edge of one sleeper in one band.
    fn cell(&self, sleeper: usize, band: usize) -> [f64; 4] {
        let x_m = self.diagnosis.track[sleeper].x_m;
        let hz = self.diagnosis.levels.frequency_hz[band];
        let half = self.half_span_m;
        [x_m - half, x_m + half, hz / self.half_band, hz * self.half_band]
    }

    fn position_axis(&self) -> Axis {
        let last = self.diagnosis.track.len() - 1;
        Axis::linear("sleeper", self.cell(0, 0)[0], self.cell(last, 0)[1])
    }

    fn frequency_axis(&self) -> Axis {
        let last = self.diagnosis.levels.frequency_hz.len() - 1;
        Axis::logarithmic("frequency in Hz", self.cell(0, 0)[2], self.cell(0, last)[3])
    }

    /// Names of sleepers at their positions, as many as fit.
    fn names(&self, width: f64) -> Vec<(f64, String)> {
        let room = ((width / NAME_WIDTH) as usize).saturating_sub(2).max(1);
        let track = &self.diagnosis.track;
        let step = track.len().div_ceil(room);
        track.iter().step_by(step).map(|s| (s.x_m, s.id.clone())).collect()
    }

    /// Edges of a mismatch: those of its sleepers if they are known, extended by half a band in frequency.
    fn around(&self, mismatch: &Mismatch) -> [[f64; 2]; 2] {
        let places = numbers(self.diagnosis, &mismatch.sleepers);
        let x = match (places.iter().min(), places.iter().max()) {
            (Some(&first), Some(&last)) => [self.cell(first, 0)[0], self.cell(last, 0)[1]],
            _ => mismatch.x_m,
        };
        let [low, high] = mismatch.frequency_hz;
        [x, [low / self.half_band, high * self.half_band]]
    }
}

/// The colour scale: one box per shade, with the end values in dB.
fn scale(limit_db: f64) -> Markup {
    let shades = (0..SHADES).rev().map(class);
    let more = (SHADES..2 * SHADES).map(class);
    html! {
        div.scale {
            span { "measured lower than predicted" }
            span { "−" (limit_db) " dB" }
            span.steps role="img" aria-label=(format!("colour scale from −{limit_db} to +{limit_db} dB")) {
                @for class in shades { i class=(class) {} }
                i {}
                @for class in more { i class=(class) {} }
            }
            span { "+" (limit_db) " dB" }
            span { "measured higher" }
        }
    }
}

fn caption(diagnosis: &Diagnosis, with: Option<&str>) -> String {
    let sleepers = match shared(diagnosis) {
        1 => "one sleeper".to_owned(),
        many => format!("the mean of {many} sleepers"),
    };
    let shown = format!(
        "Each cell is {sleepers} in one frequency band; the colour is the measured minus \
             the predicted level."
    );
    let scatter = usual_scatter(&diagnosis.levels).map_or_else(String::new, |db| {
        format!(
            " Roughness alone scatters a level by about {} dB, and by more at low frequencies, \
                 where a span holds few waves. Speckle is therefore expected everywhere; a \
                 deviation concentrated at one place or in one band is not chance.",
            digits(db, 2)
        )
    });
    let is_left_out = diagnosis.levels.scatter_db.iter().flatten().any(Option::is_none);
    let left_out = if is_left_out {
        " Some bands stay white at all sleepers: their waves are short against the contact patch, \
         and they are not compared."
    } else {
        ""
    };
    let sides = with.map_or_else(
        || {
            " The prediction is that of the track model with a separate stiffness at every sleeper."
                .to_owned()
        },
        |with| {
            format!(
                " Before: re-tuned track model with a separate stiffness at every sleeper. After: \
             the same model with {with}."
            )
        },
    );
    let boxes = if diagnosis.mismatches.is_empty() {
        ""
    } else {
        " Frames mark the mismatches listed below."
    };
    format!("{shown}{sides}{scatter}{left_out}{boxes}")
}

fn mismatches(diagnosis: &Diagnosis) -> Markup {
    if diagnosis.mismatches.is_empty() {
        return html! { p { "No difference is better explained by left-out physics." } };
    }
    let words = |mismatch: &Mismatch| {
        let [low, high] = mismatch.frequency_hz;
        format!(
            "{}, {low:.0} to {high:.0} Hz, at {}: {} dB between measured and predicted (root \
                 mean square); probability of such a mismatch anywhere by chance {}",
            where_it_is(diagnosis, mismatch),
            speeds(&mismatch.speeds_km_h),
            digits(mismatch.level_db, 2),
            chance(mismatch.p_value)
        )
    };
    html! { ol.places { @for mismatch in &diagnosis.mismatches { li { (words(mismatch)) } } } }
}

fn where_it_is(diagnosis: &Diagnosis, mismatch: &Mismatch) -> String {
    let everywhere = mismatch.sleepers.len() == diagnosis.track.len();
    match sleepers(diagnosis, &mismatch.sleepers) {
        _ if everywhere => "all along the track".to_owned(),
        names if names.is_empty() => stretch(mismatch.x_m),
        names => format!("{names} ({})", stretch(mismatch.x_m)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shades_grow_with_the_difference_and_end_at_the_limit() {
        assert_eq!(shade(0.4, 6.0), None);
        assert_eq!(shade(0.6, 6.0).map(class).as_deref(), Some("more s1"));
        assert_eq!(shade(-3.1, 6.0).map(class).as_deref(), Some("less s3"));
        assert_eq!(shade(40.0, 6.0).map(class).as_deref(), Some("more s6"));
    }
}
