//! Page of an inspection: content of a recording, without a track model.

use maud::{Markup, html};
use tracktwin_drawing::{Axis, Chart, figure, page};

const SIZE: [f64; 2] = [1000.0, 320.0];
const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// A named curve of a chart.
pub struct InspectedCurve {
    /// Text of the legend.
    pub name: String,
    /// Points of the curve.
    pub points: Vec<(f64, f64)>,
}

/// A finding from the passes alone.
pub struct Inspected {
    /// Name of the physics.
    pub physics: String,
    /// Location, as text.
    pub place: String,
    /// Probability of such a finding by chance.
    pub p_value: f64,
    /// Evidence, as text.
    pub evidence: String,
}

/// Content of the page.
pub struct InspectionReport {
    /// Name of the recording.
    pub name: String,
    /// Summary sentence.
    pub summary: String,
    /// Rows of the table of passes; the first row is the header.
    pub passes: Vec<Vec<String>>,
    /// Findings from the passes alone.
    pub found: Vec<Inspected>,
    /// Sentence on the positions at which the wheel loses contact with the rail, if there are any.
    pub loss_of_contact: Option<String>,
    /// Defects of unusable passes.
    pub pass_defects: Vec<String>,
    /// Corrections made while reading, and doubtful values.
    pub doubts: Vec<String>,
    /// Possible uses of the recording, and their limits.
    pub uses: Vec<String>,
    /// Power spectral density in dB against frequency in Hz; one curve per pass.
    pub spectra: Vec<InspectedCurve>,
    /// Level in dB against position in m; one curve per pass.
    pub levels: Vec<InspectedCurve>,
    /// Unit of the acceleration.
    pub unit: String,
}

/// Returns the HTML page of an inspection.
pub fn inspection_page(inspection: &InspectionReport) -> String {
    let unit = &inspection.unit;
    let spectra = chart(
        "Power spectral density",
        &inspection.spectra,
        |[low, high]| Axis::logarithmic("frequency in Hz", low.max(1.0), high),
        &format!("dB re 1 ({unit})²/Hz"),
    );
    let levels = chart(
        "Level along the track",
        &inspection.levels,
        |[low, high]| Axis::linear("position in m", low, high),
        &format!("dB re 1 ({unit})²"),
    );
    let body = html! {
        (figure(&[spectra, levels], "One curve per pass. Passes at one speed over the same track coincide, except for \
             noise at high frequencies."))
        h2 { "Passes" }
        div.scroll { (table(&inspection.passes)) }
        h2 { "Findings in the passes alone" }
        (found(inspection))
        @if !inspection.doubts.is_empty() {
            h2 { "Corrections and doubts" }
            ul { @for text in &inspection.doubts { li { (text) } } }
        }
        h2 { "Possible uses" }
        ul { @for text in &inspection.uses { li { (text) } } }
    };
    page(&format!("Recording {}", inspection.name), &inspection.summary, &body)
}

fn found(inspection: &InspectionReport) -> Markup {
    html! {
        @if let Some(lost) = &inspection.loss_of_contact {
            p { strong { code { "loss_of_contact" } } ": " (lost) }
        }
        @if inspection.found.is_empty() && inspection.pass_defects.is_empty() && inspection.loss_of_contact.is_none() {
            p { "No finding: consistent with a faultless measuring chain, a round wheel and a rail \
                 without defects (false-alarm rate 2 %)." }
        }
        @for defect in &inspection.pass_defects { p { strong { "Not usable: " } (defect) } }
        @if !inspection.found.is_empty() {
            div.scroll { table {
                tr { th { "what" } th.words { "where" } th { "by chance" } th.words { "seen" } }
                @for one in &inspection.found {
                    tr {
                        td { code { (one.physics) } } td.words { (one.place) }
                        td { (tracktwin_number::chance(one.p_value)) }
                        td.words style="white-space:normal" { (one.evidence) }
                    }
                }
            } }
        }
    }
}

fn table(rows: &[Vec<String>]) -> Markup {
    let (heads, rows) = rows.split_first().map_or((&[][..], &[][..]), |(h, r)| (&h[..], r));
    html! {
        table {
            tr { @for head in heads { th { (head) } } }
            @for row in rows { tr { @for cell in row { td { (cell) } } } }
        }
    }
}

fn chart(
    title: &str,
    curves: &[InspectedCurve],
    x_axis: impl Fn([f64; 2]) -> Axis,
    y_label: &str,
) -> String {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let ends = points().fold([f64::INFINITY, f64::NEG_INFINITY], |ends, point| {
        [ends[0].min(point.0), ends[1].max(point.0)]
    });
    if ends[0] >= ends[1] {
        return String::new();
    }
    let y = Axis::around(y_label, points().map(|point| point.1));
    let mut chart = Chart::new(title, SIZE, x_axis(ends), y);
    for (curve, class) in curves.iter().zip(CLASSES.iter().cycle()) {
        chart.line(&format!("{class} hair"), curve.points.iter().copied());
    }
    for (curve, class) in curves.iter().zip(CLASSES) {
        chart.explain(class, &curve.name);
    }
    chart.into_svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_what_was_found_and_carries_its_pictures() {
        let curve = |name: &str| InspectedCurve {
            name: name.to_owned(),
            points: vec![(10.0, -20.0), (1000.0, 3.0)],
        };
        let page = inspection_page(&InspectionReport {
            name: "a < b".to_owned(),
            summary: "One pass.".to_owned(),
            passes: vec![vec!["pass".to_owned()], vec!["one.csv".to_owned()]],
            found: vec![Inspected {
                physics: "squat".to_owned(),
                place: "1.7 m".to_owned(),
                p_value: 0.0,
                evidence: "loud".to_owned(),
            }],
            loss_of_contact: Some("the wheel loses contact".to_owned()),
            pass_defects: vec![],
            doubts: vec!["positions in steps".to_owned()],
            uses: vec!["nothing".to_owned()],
            spectra: vec![curve("one.csv")],
            levels: vec![curve("one.csv")],
            unit: "m/s²".to_owned(),
        });
        assert!(page.contains("a &lt; b") && page.contains("<code>squat</code>"));
        assert!(page.contains("<code>loss_of_contact</code></strong>: the wheel loses contact"));
        assert!(page.contains("<td>below 1e-12</td>") && page.contains("positions in steps"));
        assert_eq!(page.matches("<svg xmlns").count(), 2);
        assert!(!page.contains("http://") || !page.contains("src=\"http"));
    }
}
