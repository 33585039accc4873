//! Page with the results of the paper beside those of this program.

use crate::map_picture::address;
use maud::{Markup, html};
use tracktwin_drawing::{Axis, Chart, figure, page};
use tracktwin_reproduction::{ClaimVerdict, Compared, Curve, Picture, Reproduction, Scale, Style};

const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// Width and height in px of a chart that fills the page, and of a small one.
const WIDE: [f64; 2] = [860.0, 320.0];
const NARROW: [f64; 2] = [370.0, 270.0];

/// Space in px for title and legend above a small chart, and widths in px of a letter and of a key of the
/// legend.
const ROOM: f64 = 284.0;
const LETTER: f64 = 7.4;
const KEY: f64 = 36.0;

/// Returns the HTML page of a reproduction: a summary, a table of all rows, and the charts by figure;
/// `command` is the command line that repeats it.
pub fn reproduction_page(reproduction: &Reproduction, command: &str) -> String {
    let of = &reproduction.provenance;
    let body = html! {
        p.note { "Shen et al. 2023, Mechanical Systems and Signal Processing 204, 110730. Each \
             verdict follows from the stated tolerance. Rows that hold, fail or are undecided are checks \
             of the program, not statements of the paper." }
        @for compared in &reproduction.figures { (section(compared)) }
        h2 { "Provenance" }
        dl {
            dt { "campaign" } dd { (of.campaign) }
            dt { "library" } dd { code { (of.library_digest) } ", " (of.library_entries) " entries" }
            dt { "program" } dd { "tracktwin " (of.code_version) }
        }
        p { "To reproduce, with the library of that digest:" }
        pre { (command) }
    };
    page("Comparison with the paper's results", &summary(reproduction), &body)
}

/// Summary: a sentence on the statements of the paper, and one on the checks of the program.
fn summary(reproduction: &Reproduction) -> String {
    let (count, checks) = (|verdict| reproduction.count(verdict), reproduction.checks());
    let statements = format!(
        "Of {} statements of the paper, {} are reproduced, {} differ, and {} cannot be decided.",
        reproduction.rows.len() - checks,
        count(ClaimVerdict::Reproduced),
        count(ClaimVerdict::Differs),
        count(ClaimVerdict::CannotTell)
    );
    if checks == 0 {
        return statements;
    }
    format!(
        "{statements} Of {checks} checks of the program, {} hold, {} fail, and {} are undecided.",
        count(ClaimVerdict::Holds),
        count(ClaimVerdict::Fails),
        count(ClaimVerdict::Undecided)
    )
}

fn section(compared: &Compared) -> Markup {
    let charts: Vec<String> = compared.pictures.iter().map(chart).collect();
    html! {
        h2 id=(compared.figure) { (compared.figure.name().replace("fig", "Fig. ")) ": " (compared.figure.title()) }
        div.scroll { (table(compared)) }
        (figure(&charts, &compared.caption))
    }
}

fn table(compared: &Compared) -> Markup {
    let wrapped = "white-space:normal;vertical-align:top;min-width:9rem";
    html! {
        table {
            thead { tr {
                th.words { "statement" } th.words { "paper" } th.words { "ours" }
                th.words { "verdict" } th.words { "tolerance and reason" }
            } }
            tbody {
                @for row in &compared.rows {
                    tr {
                        td.words style=(wrapped) { (row.claim) }
                        td.words style=(wrapped) { (row.paper) }
                        td.words style=(wrapped) { (row.ours) }
                        td.words style="vertical-align:top" { (verdict(row.verdict)) }
                        td.words style=(wrapped) { (row.why) }
                    }
                }
            }
        }
    }
}

/// The verdict with a symbol, so that it can be read without colour.
pub(crate) fn verdict(verdict: ClaimVerdict) -> Markup {
    let (mark, colour) = match verdict {
        ClaimVerdict::Reproduced | ClaimVerdict::Holds => ("✓", "var(--c)"),
        ClaimVerdict::Differs | ClaimVerdict::Fails => ("✗", "var(--b)"),
        ClaimVerdict::CannotTell | ClaimVerdict::Undecided => ("?", "var(--dim)"),
    };
    html! { strong style=(format!("color:{colour}")) { (mark) " " (verdict.label()) } }
}

pub(crate) fn chart(picture: &Picture) -> String {
    let points = || picture.curves.iter().flat_map(reach);
    let map = picture.curves.iter().find(|curve| matches!(curve.style, Style::Map(_)));
    let x = match (&picture.names[..], map.map(|map| &map.points[..])) {
        ([(first, _), .., (last, _)], _) => Axis::linear(&picture.x.label, first - 0.5, last + 0.5),
        // A map fills its frame.
        (_, Some([first, .., last])) => Axis::linear(&picture.x.label, first.0, last.0),
        _ => axis(&picture.x, points().map(|point| point.0)),
    };
    let bars = picture.curves.iter().filter(|curve| curve.style == Style::Bars).count();
    let heights = || points().map(|point| point.1);
    let y = if bars > 0 {
        Axis::linear(&picture.y.label, 0.0, 1.1 * heights().fold(0.0, f64::max))
    } else {
        axis(&picture.y, heights())
    };
    let size = if picture.wide { WIDE } else { NARROW };
    let mut chart = Chart::new(&picture.title, size, x, y);
    for (index, curve) in picture.curves.iter().enumerate() {
        draw(&mut chart, CLASSES[index % CLASSES.len()], curve, [index, bars]);
    }
    picture.marks.iter().for_each(|&place| chart.vertical(place));
    legend(&mut chart, picture);
    if !picture.names.is_empty() {
        chart.name_x(picture.names.clone());
    }
    chart.into_svg()
}

/// All points that the axes must include for a curve.
fn reach(curve: &Curve) -> Vec<(f64, f64)> {
    let ends = |(place, &(x, y)): (usize, &(f64, f64))| match &curve.style {
        Style::Band(half) => [(x, y - half[place]), (x, y + half[place])],
        Style::Bars => [(x, 0.0), (x, y)],
        _ => [(x, y), (x, y)],
    };
    curve.points.iter().enumerate().flat_map(ends).collect()
}

fn axis(scale: &Scale, values: impl Iterator<Item = f64>) -> Axis {
    if !scale.logarithmic {
        return Axis::around(&scale.label, values);
    }
    let positive = values.filter(|value| *value > 0.0);
    let [low, high] = positive.fold([f64::INFINITY, 0.0_f64], |[a, b], v| [a.min(v), b.max(v)]);
    let [low, high] = if low.is_finite() { [low, high.max(low * 1.001)] } else { [1.0, 10.0] };
    Axis::logarithmic(&scale.label, low, high)
}

fn draw(chart: &mut Chart, class: &'static str, curve: &Curve, [index, bars]: [usize; 2]) {
    let points = curve.points.iter().copied();
    match &curve.style {
        Style::Line => chart.line(class, points),
        Style::Truth => chart.line("ink", points),
        Style::Thin => chart.line("thin b", points),
        Style::Map(map) => {
            if let Some(address) = address(map) {
                chart.image(&address);
            }
        }
        Style::Dots => chart.dots("a pale", 1.6, &curve.points),
        Style::Points => chart.dots(class, 3.4, &curve.points),
        Style::Band(half) => {
            let sides = points.clone().zip(half).map(|((x, y), half)| (x, y - half, y + half));
            chart.band(class, &sides.collect::<Vec<_>>());
            chart.line(class, points);
        }
        Style::Bars => {
            let width = 0.84 / bars.max(1) as f64;
            for (x, y) in points.filter(|point| point.1.is_finite()) {
                let left = x - 0.42 + width * index as f64;
                let name = format!("{}: {y:.1}", curve.name);
                chart.bar(class, [left, left + 0.92 * width], y, &name);
            }
        }
    }
}

fn legend(chart: &mut Chart, picture: &Picture) {
    let names = picture.curves.iter().filter(|of| !of.name.is_empty());
    let width: f64 = names.map(|of| KEY + LETTER * of.name.chars().count() as f64).sum();
    if !picture.wide && LETTER * picture.title.chars().count() as f64 + width > ROOM {
        return;
    }
    for (index, curve) in picture.curves.iter().enumerate().filter(|(_, of)| !of.name.is_empty()) {
        let class = match curve.style {
            Style::Truth => "ink",
            _ => CLASSES[index % CLASSES.len()],
        };
        chart.explain(class, &curve.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_reproduction::{ClaimRow, Figure, Provenance};

    fn page_of(figure: Figure, verdicts: &[ClaimVerdict]) -> String {
        let row = |&verdict: &ClaimVerdict| ClaimRow {
            figure,
            claim: String::new(),
            paper: String::new(),
            ours: String::new(),
            verdict,
            why: String::new(),
        };
        let (rows, caption) = (verdicts.iter().map(row).collect(), String::new());
        let provenance = Provenance {
            code_version: "0.1.0",
            campaign: "made-up".to_owned(),
            library_digest: "0123abcd".to_owned(),
            library_entries: 60,
        };
        let compared = Compared { figure, rows, pictures: Vec::new(), caption };
        reproduction_page(&Reproduction::new(provenance, vec![compared]), "tracktwin reproduce")
    }

    #[test]
    fn checks_of_the_program_are_no_statements_of_the_paper() {
        use ClaimVerdict::{CannotTell, Differs, Fails, Holds, Reproduced, Undecided};
        let page = page_of(
            Figure::Fig19,
            &[Reproduced, Holds, Holds, Fails, Undecided, Differs, CannotTell],
        );
        assert!(page.contains("Of 3 statements of the paper, 1 are reproduced, 1 differ, and 1"));
        assert!(page.contains("Of 4 checks of the program, 2 hold, 1 fail, and 1 are undecided."));
        assert!(
            page.contains("✓ holds") && page.contains("✗ fails") && page.contains("? undecided")
        );
        assert!(!page_of(Figure::Fig19, &[Reproduced]).contains("Of 0 checks"));
    }
}
