//! The page of a reproduction, from a figure with invented rows and charts.

use std::path::Path;
use tracktwin_report::reproduction_page;
use tracktwin_reproduction::{
    ClaimRow, ClaimVerdict, Compared, Curve, Figure, Picture, Provenance, Reproduction, Scale,
    Style,
};
use tracktwin_signal::TimeFrequencyMap;

fn row(claim: &str, verdict: ClaimVerdict) -> ClaimRow {
    let text = |what: &str| format!("{what} of {claim}");
    let (paper, ours, why) = (text("paper"), text("ours"), text("why"));
    ClaimRow { figure: Figure::Fig17, claim: claim.to_owned(), paper, ours, verdict, why }
}

fn picture(styles: Vec<Style>) -> Picture {
    let points = || (1..=9).map(|at| (f64::from(at), f64::from(at % 4))).collect();
    let curve = |style| Curve { name: "S < 1".to_owned(), style, points: points() };
    let scale = |label: &str| Scale { label: label.to_owned(), logarithmic: false };
    Picture {
        title: "Sleepers".to_owned(),
        x: scale("sleeper"),
        y: scale("k_p in MN/m"),
        curves: styles.into_iter().map(curve).collect(),
        names: Vec::new(),
        marks: Vec::new(),
        wide: true,
    }
}

fn reproduction() -> Reproduction {
    let bars = Picture {
        names: (1..=9).map(|at| (f64::from(at - 1), format!("p{at}"))).collect(),
        ..picture(vec![Style::Bars, Style::Bars])
    };
    let figure = Compared {
        figure: Figure::Fig17,
        rows: vec![
            row("levels < 5", ClaimVerdict::Reproduced),
            row("meshes", ClaimVerdict::Differs),
            row("the rest", ClaimVerdict::CannotTell),
        ],
        pictures: vec![picture(vec![Style::Band(vec![0.5; 9]), Style::Truth, Style::Dots]), bars],
        caption: "Truth and estimates.".to_owned(),
    };
    let provenance = Provenance {
        code_version: "0.1.0",
        campaign: "made-up".to_owned(),
        library_digest: "0123abcd".to_owned(),
        library_entries: 60,
    };
    Reproduction::new(provenance, vec![figure])
}

#[test]
fn the_page_shows_every_row_with_its_verdict_and_every_picture() {
    let command = "tracktwin reproduce fig17 --library sqlite:l --out o --models m --campaign c";
    let page = reproduction_page(&reproduction(), command);
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("reproduce.html");
    std::fs::write(file, &page).expect("writable");
    assert!(page.contains("Of 3 statements of the paper, 1 are reproduced, 1 differ"));
    for text in ["levels &lt; 5", "ours of meshes", "✗ differs", "? cannot tell", "why of the rest"]
    {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(page.matches("<svg xmlns").count(), 2);
    // A bar a curve and a name; a band; a dot a point.
    assert_eq!(page.matches("<rect class=\"bar").count(), 18);
    assert_eq!(page.matches("<polygon").count(), 1);
    assert_eq!(page.matches("<circle").count(), 9);
    assert!(page.contains(command));
}

#[test]
fn a_map_fills_its_frame_and_many_thin_lines_have_one_style() {
    let map = TimeFrequencyMap {
        times_s: vec![0.0, 1.0],
        frequencies_hz: vec![100.0, 200.0],
        magnitudes: vec![1.0, 0.5, 0.1, 0.2],
    };
    let corners = vec![(2.0, 100.0), (3.0, 200.0)];
    let mut shown = picture(vec![Style::Thin, Style::Thin]);
    shown.curves = vec![Curve { name: String::new(), style: Style::Map(map), points: corners }];
    shown.marks = vec![2.0, 3.0];
    let mut reproduction = reproduction();
    reproduction.figures[0].pictures = vec![shown, picture(vec![Style::Thin, Style::Thin])];
    let page = reproduction_page(&reproduction, "");
    assert!(page.contains("data:image/png;base64,"));
    // Left and right edge of the frame of 774 px.
    assert!(page.contains("M0.0 0V") && page.contains("M774.0 0V"), "{page}");
    assert_eq!(page.matches("line thin b").count(), 2);
}

#[test]
fn the_page_needs_nothing_from_elsewhere() {
    let page = reproduction_page(&reproduction(), "").replace("http://www.w3.org/2000/svg", "");
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("<script"));
    assert!(!page.contains("NaN") && !page.contains("inf"), "{page}");
}

#[test]
fn the_record_names_its_format_and_a_row_a_claim() {
    let json: serde_json::Value = serde_json::from_str(&reproduction().json()).expect("it is JSON");
    assert_eq!(json["format"], "reproduction/1");
    assert_eq!((&json["campaign"], &json["library_entries"]), (&"made-up".into(), &60.into()));
    assert_eq!(json["rows"][2]["figure"], "fig17");
    assert_eq!(json["rows"][2]["verdict"], "cannot_tell");
}
