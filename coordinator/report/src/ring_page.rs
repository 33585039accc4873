//! The page of the ring study: statements, and parameters along the sleepers with their true values.

use crate::reproduction_page::{chart, verdict};
use maud::{Markup, html};
use tracktwin_drawing::{figure, page, significant};
use tracktwin_parameters::Parameter;
use tracktwin_reproduction::{ClaimVerdict, Picture};
use tracktwin_ring::{Statement, Study};

/// Returns the HTML page of a ring study; `command` is the command line that repeats it.
pub fn ring_page(study: &Study, command: &str) -> String {
    let statements = study.statements();
    let body = html! {
        p.note { "The ring of Shen et al. 2023 (Mechanical Systems and Signal Processing 204, 110730) \
             as its section 2.1 describes it, on a straight track, recorded by the reference \
             simulator, which shares no discretisation with the evaluation. Each verdict follows from \
             the stated tolerance." }
        h2 { "Statements" }
        div.scroll { (table(&statements)) }
        h2 { "Along the ring" }
        @for (pictures, caption) in study.pictures() { (group(&pictures, caption)) }
        h2 { "What the ring has" }
        (ring(study))
        h2 { "Provenance" }
        (provenance(study, command))
    };
    page("The test ring with known truth", &summary(study, &statements), &body)
}

/// Summary in one sentence.
fn summary(study: &Study, statements: &[Statement]) -> String {
    let count = |verdict| Study::count(statements, verdict);
    let laps = match study.plan.laps {
        1 => "one lap".to_owned(),
        laps => format!("{laps} laps"),
    };
    format!(
        "{} sleepers, {laps}: of {} statements, {} hold, {} do not, and {} cannot be decided.",
        study.truth.sleepers.len(),
        statements.len(),
        count(ClaimVerdict::Reproduced),
        count(ClaimVerdict::Differs),
        count(ClaimVerdict::CannotTell)
    )
}

fn table(statements: &[Statement]) -> Markup {
    let wrapped = "white-space:normal;vertical-align:top;min-width:7rem";
    html! {
        table {
            thead { tr {
                th.words { "figure" } th.words { "method" } th.words { "statement" }
                th.words { "paper or truth" } th.words { "found" } th.words { "verdict" }
                th.words { "tolerance" }
            } }
            tbody {
                @for row in statements {
                    tr {
                        td.words style="vertical-align:top" { (row.figure) }
                        td.words style="vertical-align:top" { (row.method) }
                        td.words style=(wrapped) { (row.claim) }
                        td.words style=(wrapped) { (row.expected) }
                        td.words style=(wrapped) { (row.found) }
                        td.words style="vertical-align:top" { (verdict(row.verdict)) }
                        td.words style=(wrapped) { (row.tolerance) }
                    }
                }
            }
        }
    }
}

fn group(pictures: &[Picture], caption: &str) -> Markup {
    figure(&pictures.iter().map(chart).collect::<Vec<_>>(), caption)
}

/// List of the structures of the ring.
fn ring(study: &Study) -> Markup {
    let truth = &study.truth;
    let ids = |wanted: fn(&tracktwin_ring::SleeperTruth) -> bool| -> String {
        let some: Vec<&str> =
            truth.sleepers.iter().filter(|it| wanted(it)).map(|it| it.id.as_str()).collect();
        if some.is_empty() { "none".to_owned() } else { some.join(", ") }
    };
    let joints: Vec<String> = truth
        .joints
        .iter()
        .map(|joint| {
            format!(
                "{} behind SN{}: dip of {} mm, {} of the bending stiffness",
                joint.name,
                joint.after,
                significant(1e3 * joint.dip_m),
                joint.bending_factor
            )
        })
        .collect();
    let gaps: Vec<String> = truth.gaps.iter().map(|gap| format!("SN{gap}")).collect();
    html! {
        dl {
            dt { "joints" } dd { (if joints.is_empty() { "none".to_owned() } else { joints.join("; ") }) }
            dt { "clamps" } dd { (ids(|it| it.clamp)) }
            dt { "railpad missing" } dd { (ids(|it| it.missing_railpad)) }
            dt { "no bolts" } dd { (ids(|it| !it.bolt)) }
            dt { "gaps behind" } dd { (if gaps.is_empty() { "none".to_owned() } else { gaps.join(", ") }) }
            dt { "sleepers" } dd { "bending stiffness " (bending(study)) " N m², bolts at all others" }
        }
    }
}

fn bending(study: &Study) -> String {
    let first = study.truth.sleepers.first();
    first.map(|it| it.values[&Parameter::SleeperBendingStiffness].to_string()).unwrap_or_default()
}

fn provenance(study: &Study, command: &str) -> Markup {
    let plan = &study.plan;
    let speeds: Vec<String> = plan.speeds_km_h.iter().map(ToString::to_string).collect();
    html! {
        dl {
            dt { "seed" } dd { (plan.seed) }
            dt { "sleepers" } dd { "SN" (plan.stretch.first) " to SN" (plan.stretch.last) }
            dt { "passes" } dd { (plan.laps) " at each of " (speeds.join(", ")) " km/h" }
            dt { "program" } dd { "tracktwin " (env!("CARGO_PKG_VERSION")) }
        }
        p { "To repeat it:" }
        pre { (command) }
    }
}
