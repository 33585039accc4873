//! Headline of the page: sentence, verdict, key figures and notes.

use super::levels::{Side, all_cells, difference, rms, share_within_two_sd, usual_scatter};
use super::place::Site;
use super::quantity::{digits, per_cent, signed};
use super::words::{accepted, addition, chance, is_chain, physics, place, speeds};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Mismatch, Verdict, section_folder};

/// The verdict as a tag, key figures and notes.
pub(super) fn headline(diagnosis: &Diagnosis) -> Markup {
    let (class, name, meaning) = verdict(diagnosis.verdict);
    html! {
        p.verdict { span class=(format!("tag {class}")) { (name) } span { (meaning) } }
        dl.facts { @for (figure, what) in facts(diagnosis) { div { dt { (what) } dd { (figure) } } } }
        @if !diagnosis.notes.is_empty() {
            ul.notes { @for note in &diagnosis.notes { li { (note) } } }
        }
    }
}

/// Verdicts on the sections of a long track, with links to their pages.
pub(super) fn sections(diagnosis: &Diagnosis) -> Markup {
    html! {
        @if !diagnosis.sections.is_empty() {
            h2 { "Sections" }
            p {
                "The track was diagnosed in overlapping sections. Each has its own page with all \
                 hypotheses and levels."
            }
            table {
                thead { tr {
                    th { "sleepers" } th { "verdict" } th { "nothing left out" } th.words { "diagnosis" }
                } }
                tbody {
                    @for section in &diagnosis.sections {
                        @let (class, name, _) = verdict(section.verdict);
                        tr {
                            td { a href=(format!("{}/report.html", section_folder(section.number))) {
                                (section.sleepers[0]) " to " (section.sleepers[1])
                            } }
                            td { span class=(format!("tag {class}")) { (name) } }
                            td { (section.nothing_left_out.map(per_cent).unwrap_or_default()) }
                            td.words { (section.sentence) }
                        }
                    }
                }
            }
        }
    }
}

/// Class, name and meaning of a verdict.
pub(super) const fn verdict(verdict: Verdict) -> (&'static str, &'static str, &'static str) {
    match verdict {
        Verdict::Consistent => {
            ("consistent", "consistent", "the re-tuned track model explains the recording")
        }
        Verdict::LeftOutPhysics => {
            ("left-out", "left-out physics", "the track has physics that the track model lacks")
        }
        Verdict::UnknownPhysics => (
            "unknown",
            "unknown physics",
            "something was found that no kind of the catalogue explains",
        ),
        Verdict::MeasurementChain => (
            "chain",
            "measuring chain",
            "the fault is in the sensor, its mounting, the clock or the odometer, not in the track",
        ),
    }
}

/// Key figures, each with its explanation.
fn facts(diagnosis: &Diagnosis) -> Vec<(String, String)> {
    let among_others = accepted(diagnosis).count() > 1;
    let mut facts: Vec<(String, String)> = accepted(diagnosis)
        .map(|hypothesis| {
            let of = if is_chain(&hypothesis.physics) { "fault" } else { "physics" };
            let name = physics(&hypothesis.physics);
            let at = match hypothesis.location.as_ref().filter(|_| among_others) {
                Some(location) => format!(", {}", place(diagnosis, location)),
                None => String::new(),
            };
            (per_cent(hypothesis.probability), format!("probability of this {of}: {name}{at}"))
        })
        .collect();
    facts.extend(nothing(diagnosis));
    facts.extend(agreement(diagnosis));
    facts.extend(held_out(diagnosis));
    facts
}

/// Probability that nothing is left out, if the verdict is `consistent`.
fn nothing(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let probability = diagnosis.nothing_left_out?;
    let what =
        "probability that nothing is left out; the remainder is for effects too weak to detect";
    (diagnosis.verdict == Verdict::Consistent).then(|| (per_cent(probability), what.to_owned()))
}

/// Agreement of measured and predicted levels.
fn agreement(diagnosis: &Diagnosis) -> Vec<(String, String)> {
    match (addition(diagnosis).is_some(), diagnosis.mismatches.first()) {
        (true, _) => improvement(diagnosis).into_iter().collect(),
        (false, Some(mismatch)) => unexplained(diagnosis, mismatch),
        (false, None) => chance_alone(diagnosis).into_iter().chain(compared(diagnosis)).collect(),
    }
}

fn improvement(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let site = Site::first(diagnosis);
    let [before, after] = [Side::Before, Side::After]
        .map(|side| rms(&diagnosis.levels, side, site.cells(diagnosis)).map(|db| digits(db, 2)));
    Some((
        format!("{} → {} dB", before?, after?),
        format!("typical difference of measured and predicted level {}", site.at()),
    ))
}

fn unexplained(diagnosis: &Diagnosis, mismatch: &Mismatch) -> Vec<(String, String)> {
    let by_chance = usual_scatter(&diagnosis.levels).map_or_else(String::new, |db| {
        format!("; roughness alone gives about {} dB", digits(db, 2))
    });
    vec![
        (
            format!("{} dB", digits(mismatch.level_db, 2)),
            format!("between measured and predicted level in the largest mismatch{by_chance}"),
        ),
        (chance(mismatch.p_value), "probability of such a mismatch anywhere by chance".to_owned()),
    ]
}

fn chance_alone(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let share = share_within_two_sd(diagnosis, Side::Before)?;
    let what = "of all levels lie within twice the expected scatter; 95 % are expected";
    Some((format!("{:.0} %", 100.0 * share), what.to_owned()))
}

/// Extent of the comparison.
fn compared(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let levels = &diagnosis.levels;
    let (low, high) = (levels.frequency_hz.first()?, levels.frequency_hz.last()?);
    let count =
        all_cells(diagnosis).filter(|at| difference(levels, Side::Before, *at).is_some()).count();
    Some((
        format!("{count} levels"),
        format!(
            "were compared: {} sleepers, {low:.0} to {high:.0} Hz, at {}",
            diagnosis.track.len(),
            speeds(&levels.speeds_km_h)
        ),
    ))
}

fn held_out(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let gains = &diagnosis.fit.held_out_gain_nats;
    addition(diagnosis)?;
    if gains.is_empty() {
        return None;
    }
    let better = gains.values().filter(|gain| **gain > 0.0).count();
    let total: f64 = gains.values().sum();
    Some((
        format!("{better} of {}", gains.len()),
        format!(
            "withheld speeds are predicted better with it ({} nats together)",
            signed(total, 0)
        ),
    ))
}
