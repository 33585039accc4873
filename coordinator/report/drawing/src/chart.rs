//! A chart as inline SVG: frame, axes, lines, bands, dots, bars. The page's style sheet defines the
//! colours.

use crate::axis::Axis;
use std::fmt::Write as _;

const LEFT: f64 = 72.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 46.0;
/// Minimum distance of tick labels along x and along y, in px.
const TICK_ROOM: [f64; 2] = [70.0, 34.0];

/// A chart under construction.
pub struct Chart {
    title: String,
    size: [f64; 2],
    x: Axis,
    y: Axis,
    marks: String,
    x_names: Option<Vec<(f64, String)>>,
    legend: Vec<(&'static str, String)>,
}

impl Chart {
    /// Creates an empty chart of `width` by `height` px.
    pub fn new(title: &str, [width, height]: [f64; 2], x: Axis, y: Axis) -> Self {
        let title = title.to_owned();
        let size = [width - LEFT - RIGHT, height - TOP - BOTTOM];
        Self { title, size, x, y, marks: String::new(), x_names: None, legend: Vec::new() }
    }

    /// Sets names at positions of the x axis, instead of numbers.
    pub fn name_x(&mut self, names: Vec<(f64, String)>) {
        self.x_names = Some(names);
    }

    /// Adds an entry with the style `class` to the legend.
    pub fn explain(&mut self, class: &'static str, text: &str) {
        self.legend.push((class, text.to_owned()));
    }

    /// Adds a line through the points.
    pub fn line(&mut self, class: &str, points: impl IntoIterator<Item = (f64, f64)>) {
        let points: Vec<_> = points.into_iter().map(|(x, y)| self.at(x, y)).collect();
        let _ =
            write!(self.marks, r#"<polyline class="line {class}" points="{}"/>"#, join(&points));
    }

    /// Adds the area between a lower and an upper curve. A point is x, lower value and upper value.
    pub fn band(&mut self, class: &str, points: &[(f64, f64, f64)]) {
        let low = points.iter().map(|&(x, low, _)| self.at(x, low));
        let high = points.iter().rev().map(|&(x, _, high)| self.at(x, high));
        let points: Vec<_> = low.chain(high).collect();
        let _ = write!(self.marks, r#"<polygon class="band {class}" points="{}"/>"#, join(&points));
    }

    /// Adds a line through mean values, with a band around the line. A point is x, mean, and half width of
    /// the band. The reference line (class `was`) is drawn behind the others and without dots, except for a
    /// single point.
    pub fn curve(&mut self, class: &str, points: &[(f64, f64, f64)]) {
        let band: Vec<_> = points.iter().map(|&(x, y, half)| (x, y - half, y + half)).collect();
        let means: Vec<_> = points.iter().map(|&(x, y, _)| (x, y)).collect();
        self.band(class, &band);
        self.line(class, means.iter().copied());
        if class != "was" || means.len() == 1 {
            self.dots(class, 2.6, &means);
        }
    }

    /// Adds a dot of `radius` px at each point.
    pub fn dots(&mut self, class: &str, radius: f64, points: &[(f64, f64)]) {
        for &(x, y) in points {
            let [x, y] = self.at(x, y);
            let _ = write!(
                self.marks,
                r#"<circle class="dot {class}" cx="{x:.1}" cy="{y:.1}" r="{radius}"/>"#
            );
        }
    }

    /// Adds a bar from the bottom of the chart to `y`, between `from` and `to`; `name` is its tooltip.
    pub fn bar(&mut self, class: &str, [from, to]: [f64; 2], y: f64, name: &str) {
        let ([left, top], [right, _]) = (self.at(from, y), self.at(to, y));
        let _ = write!(
            self.marks,
            r#"<rect class="bar {class}" x="{left:.1}" y="{top:.1}" width="{:.1}" height="{:.1}"><title>{}</title></rect>"#,
            right - left,
            (self.size[1] - top).max(0.0),
            escape(name)
        );
    }

    /// Adds filled rectangles, each given as left, right, low and high edge.
    pub fn cells(&mut self, class: &str, edges: &[[f64; 4]]) {
        let _ = write!(self.marks, r#"<path class="cell {class}" d=""#);
        for &[left, right, low, high] in edges {
            let ([left, top], [right, bottom]) = (self.at(left, high), self.at(right, low));
            let _ = write!(self.marks, "M{left:.1} {top:.1}H{right:.1}V{bottom:.1}H{left:.1}z");
        }
        self.marks += r#""/>"#;
    }

    /// Adds a thin vertical line at `x`, from bottom to top.
    pub fn vertical(&mut self, x: f64) {
        let [x, _] = self.at_x(x);
        let bottom = self.size[1];
        let _ = write!(self.marks, r#"<path class="mark" d="M{x:.1} 0V{bottom:.1}"/>"#);
    }

    /// Adds an image over the whole frame, given as a `data:` URL.
    pub fn image(&mut self, address: &str) {
        let [width, height] = self.size;
        let _ = write!(
            self.marks,
            r#"<image href="{address}" width="{width}" height="{height}" preserveAspectRatio="none" image-rendering="auto"/>"#
        );
    }

    /// Returns the chart as an `<svg>` element.
    pub fn into_svg(self) -> String {
        let [width, height] = self.size;
        let (full_width, full_height) = (width + LEFT + RIGHT, height + TOP + BOTTOM);
        let title = escape(&self.title);
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" aria-label="{title}" viewBox="0 0 {full_width} {full_height}" width="{full_width}" height="{full_height}"><text class="title" x="{LEFT}" y="16">{title}</text><g transform="translate({LEFT} {TOP})">"#
        );
        self.grid(&mut svg);
        let _ = write!(
            svg,
            r#"<svg width="{width}" height="{height}" overflow="hidden">{}</svg><rect class="frame" width="{width}" height="{height}"/>"#,
            self.marks
        );
        self.labels(&mut svg);
        self.explanations(&mut svg);
        svg += "</g></svg>";
        svg
    }

    fn grid(&self, svg: &mut String) {
        let [width, height] = self.size;
        let x_ticks = self
            .x_names
            .clone()
            .unwrap_or_else(|| self.x.ticks(((width / TICK_ROOM[0]) as usize).max(2)));
        for (value, text) in x_ticks {
            let x = self.x.place(value) * width;
            let (grid, text) = (if self.x_names.is_some() { 0.0 } else { height }, escape(&text));
            let _ = write!(
                svg,
                r#"<path class="grid" d="M{x:.1} {height}v-{grid}"/><text class="tick" x="{x:.1}" y="{:.1}" text-anchor="middle">{text}</text>"#,
                height + 16.0
            );
        }
        for (value, text) in self.y.ticks(((height / TICK_ROOM[1]) as usize).max(2)) {
            let y = (1.0 - self.y.place(value)) * height;
            let _ = write!(
                svg,
                r#"<path class="grid" d="M0 {y:.1}h{width}"/><text class="tick" x="-6" y="{:.1}" text-anchor="end">{}</text>"#,
                y + 4.0,
                escape(&text)
            );
        }
    }

    fn labels(&self, svg: &mut String) {
        let [width, height] = self.size;
        let _ = write!(
            svg,
            r#"<text class="label" x="{:.1}" y="{:.1}" text-anchor="middle">{}</text><text class="label" transform="translate(-54 {:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            width / 2.0,
            height + 38.0,
            escape(&self.x.label),
            height / 2.0,
            escape(&self.y.label)
        );
    }

    /// Writes the legend in the upper right corner, above the frame.
    fn explanations(&self, svg: &mut String) {
        /// Mean width of a letter in the legend, in px.
        const LETTER: f64 = 6.3;
        let mut x = self.size[0];
        for (class, text) in self.legend.iter().rev() {
            x -= text.chars().count() as f64 * LETTER;
            let _ = write!(
                svg,
                r#"<text class="tick" x="{x:.1}" y="-9">{}</text><rect class="key {class}" x="{:.1}" y="-17" width="16" height="8"/>"#,
                escape(text),
                x - 20.0
            );
            x -= 36.0;
        }
    }

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.at_x(x)[0], (1.0 - self.y.place(y)) * self.size[1]]
    }

    fn at_x(&self, x: f64) -> [f64; 2] {
        [self.x.place(x) * self.size[0], 0.0]
    }
}

fn join(points: &[[f64; 2]]) -> String {
    let mut text = String::with_capacity(points.len() * 12);
    for [x, y] in points {
        let _ = write!(text, "{x:.1},{y:.1} ");
    }
    text
}

/// Replaces the characters that have a special meaning in SVG and HTML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_land_where_the_axes_put_them() {
        let axis = || Axis::linear("", 0.0, 10.0);
        let mut chart =
            Chart::new("a < b", [200.0 + LEFT + RIGHT, 100.0 + TOP + BOTTOM], axis(), axis());
        chart.line("first", [(0.0, 0.0), (5.0, 10.0)]);
        let svg = chart.into_svg();
        assert!(svg.contains(r#"points="0.0,100.0 100.0,0.0 ""#), "{svg}");
        assert!(svg.contains("a &lt; b") && !svg.contains("a < b"));
    }
}
