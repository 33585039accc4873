//! What stands beside and beneath the sentence: verdict, key figures, what to keep in mind.

use super::levels::{Side, rms, share_within_two_sd};
use super::place::Site;
use super::quantity::{digits, per_cent, signed};
use super::words::{accepted, is_chain, physics};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Verdict};

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

/// Class, name and meaning of a verdict.
pub(super) const fn verdict(verdict: Verdict) -> (&'static str, &'static str, &'static str) {
    match verdict {
        Verdict::Consistent => {
            ("consistent", "consistent", "the track model, re-tuned, explains the recording")
        }
        Verdict::LeftOutPhysics => (
            "left-out",
            "left-out physics",
            "the track has something that the re-tuned track model has not",
        ),
        Verdict::UnknownPhysics => (
            "unknown",
            "unknown physics",
            "something is there that nothing in the catalogue explains",
        ),
        Verdict::MeasurementChain => (
            "chain",
            "measuring chain",
            "it is the sensor, its mounting, the clock or the odometer, not the track",
        ),
    }
}

/// Key figures, each with what it is.
fn facts(diagnosis: &Diagnosis) -> Vec<(String, String)> {
    let mut facts: Vec<(String, String)> = accepted(diagnosis)
        .map(|hypothesis| {
            let of = if is_chain(&hypothesis.physics) { "fault" } else { "physics" };
            let name = physics(&hypothesis.physics);
            (per_cent(hypothesis.probability), format!("probability of this {of}: {name}"))
        })
        .collect();
    facts.extend(agreement(diagnosis));
    facts.extend(held_out(diagnosis));
    facts
}

/// How far measured and predicted levels are apart.
fn agreement(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let levels = &diagnosis.levels;
    if accepted(diagnosis).next().is_none() {
        let share = share_within_two_sd(diagnosis, Side::Before)?;
        let what =
            "of all levels lie within twice the scatter to expect; by chance it would be 95 %";
        return Some((format!("{:.0} %", 100.0 * share), what.to_owned()));
    }
    let site = Site::first(diagnosis);
    let [before, after] = [Side::Before, Side::After]
        .map(|side| rms(levels, side, site.cells(diagnosis)).map(|db| digits(db, 2)));
    Some((
        format!("{} → {} dB", before?, after?),
        format!("typical difference of measured and predicted level {}", site.at()),
    ))
}

fn held_out(diagnosis: &Diagnosis) -> Option<(String, String)> {
    let gains = &diagnosis.fit.held_out_gain_nats;
    accepted(diagnosis).next()?;
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
