//! The frame of every page: head, style sheet, footer.

use crate::chart::escape;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Style sheet of charts: colours and lines, in a light version and a dark one for readers who prefer it.
///
/// The colours are those of Okabe and Ito, which readers with any colour vision can distinguish.
pub const CHART_STYLE: &str = "
:root{--paper:#fff;--ink:#1b1f24;--faint:#d9dde2;--dim:#5b6470;--a:#0072b2;--b:#d55e00;--c:#009e73;--d:#cc79a7;--e:#e69f00;--f:#56b4e9}
@media (prefers-color-scheme:dark){:root{--paper:#14171a;--ink:#e6e9ec;--faint:#343a41;--dim:#9aa4af;--a:#56b4e9;--b:#f08a4b;--c:#2cc295;--d:#e29cc2;--e:#f0c04a;--f:#2b8fd0}}
@media print{:root{--paper:#fff;--ink:#000;--faint:#ccc;--dim:#444;--a:#0072b2;--b:#d55e00;--c:#009e73;--d:#cc79a7;--e:#e69f00;--f:#56b4e9}}
.chart{background:var(--paper);font-family:system-ui,'Segoe UI','DejaVu Sans',sans-serif;max-width:100%;height:auto}
.chart text{fill:var(--ink);font-size:12px}.chart .tick{fill:var(--dim)}.chart .title{font-weight:600;font-size:13px}
.chart .grid{stroke:var(--faint);fill:none}.chart .frame{fill:none;stroke:var(--dim)}.chart .mark{stroke:var(--dim);stroke-dasharray:3 4;fill:none}
.line{fill:none;stroke-width:1.8;stroke-linejoin:round}.line.hair{stroke-width:.7}.line.thin{stroke-width:.8;opacity:.55}.band{opacity:.22;stroke:none}
.line.a{stroke:var(--a)}.line.b{stroke:var(--b)}.line.c{stroke:var(--c)}.line.d{stroke:var(--d)}.line.e{stroke:var(--e)}.line.f{stroke:var(--f)}.line.ink{stroke:var(--ink)}
.band.a,.dot.a,.bar.a,.key.a{fill:var(--a)}.band.b,.dot.b,.bar.b,.key.b{fill:var(--b)}.band.c,.dot.c,.bar.c,.key.c{fill:var(--c)}
.dot.d,.bar.d,.key.d{fill:var(--d)}.dot.e,.bar.e,.key.e{fill:var(--e)}.dot.f,.bar.f,.key.f{fill:var(--f)}.key.ink{fill:var(--ink)}.dot.pale{opacity:.35}
.line.was{stroke:var(--dim);stroke-width:1.2;stroke-dasharray:5 3}.band.was{fill:var(--dim);opacity:.14}.dot.was{fill:var(--dim)}.key.was{fill:var(--dim);opacity:.6}
.dot.hollow{fill:var(--paper);stroke:var(--dim)}.key.hollow{fill:var(--paper);stroke:var(--dim)}
";

const PAGE_STYLE: &str = "
body{margin:0 auto;padding:1.5rem;max-width:72rem;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,'Segoe UI','DejaVu Sans',sans-serif}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.15rem;margin:2.2rem 0 .4rem;border-top:1px solid var(--faint);padding-top:1.2rem}
.summary{font-size:1.1rem;max-width:60rem}.note,figcaption,footer{color:var(--dim);font-size:.88rem;max-width:60rem}figure{margin:.6rem 0}
.pictures{display:flex;flex-wrap:wrap;gap:.6rem}.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.88rem}th,td{padding:.2rem .55rem;text-align:right;border-bottom:1px solid var(--faint);white-space:nowrap}
th{vertical-align:bottom;font-weight:600;white-space:normal}th small{white-space:nowrap}th small{display:block;font-weight:400;color:var(--dim)}td:first-child,th:first-child,.words{text-align:left}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1.2rem;font-size:.9rem}dt{color:var(--dim)}dd{margin:0;overflow-wrap:anywhere}
code,pre{font-family:ui-monospace,'DejaVu Sans Mono',monospace;font-size:.85rem}pre{overflow-x:auto;border:1px solid var(--faint);padding:.6rem}
tr.invalid{color:var(--dim);font-style:italic}.banner{border:2px solid var(--b);padding:.6rem .9rem;max-width:60rem}.banner p{margin:.2rem 0}
@media print{body{max-width:none;padding:0;font-size:11pt}figure,tr{break-inside:avoid}}
";

/// Returns a whole page: heading, summary sentence and content.
pub fn page(title: &str, summary: &str, body: &Markup) -> String {
    page_with(title, summary, &Markup::default(), body, &Markup::default())
}

/// Returns a whole page, with additional elements in its head and after its content.
pub fn page_with(title: &str, summary: &str, head: &Markup, body: &Markup, end: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width,initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(CHART_STYLE)) (PreEscaped(PAGE_STYLE)) }
                (head)
            }
            body {
                header { h1 { (title) } p.summary { (summary) } }
                main { (body) }
                footer { p { "tracktwin " (env!("CARGO_PKG_VERSION")) } }
                (end)
            }
        }
    };
    page.into_string()
}

/// Charts side by side, with a caption.
pub fn figure(charts: &[String], caption: &str) -> Markup {
    html! {
        figure {
            div.pictures { @for chart in charts { (PreEscaped(chart)) } }
            figcaption { (caption) }
        }
    }
}

/// Returns several charts as one SVG file of `width` by `height` px. Each chart has its position in px.
pub fn sheet(title: &str, [width, height]: [f64; 2], charts: &[([f64; 2], String)]) -> String {
    let placed = |([x, y], chart): &([f64; 2], String)| {
        format!(r#"<g transform="translate({x} {y})">{chart}</g>"#)
    };
    let (title, charts) = (escape(title), charts.iter().map(placed).collect::<String>());
    stand_alone(&format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" aria-label="{title}" viewBox="0 0 {width} {height}" width="{width}" height="{height}"><rect width="100%" height="100%" style="fill:var(--paper)"/>{charts}</svg>"#
    ))
}

/// Returns a chart as one SVG file with the colours of a page.
pub fn stand_alone(chart: &str) -> String {
    let style = format!("<style>{CHART_STYLE}</style>");
    match chart.find('>') {
        Some(end) => format!("{}{style}{}\n", &chart[..=end], &chart[end + 1..]),
        None => chart.to_owned(),
    }
}
