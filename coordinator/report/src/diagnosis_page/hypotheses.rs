//! Hypotheses: probability, place, look-alikes, and measurements that separate them.

use super::quantity::{per_cent, signed};
use super::words::{
    accepted, addition, chance, is_chain, is_fitted, list, physics, place, summary,
};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Hypothesis, UNKNOWN, Verdict};

/// Maximum number of hypotheses shown in full, in addition to the accepted ones.
const SHOWN: usize = 8;

/// Probability below which a hypothesis that was not accepted is counted and not shown.
const LEAST: f64 = 0.005;

/// The hypotheses, or an explanation if there are none.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let worth = |(rank, hypothesis): &(usize, &Hypothesis)| {
        hypothesis.accepted || (*rank < SHOWN && hypothesis.probability >= LEAST)
    };
    let shown: Vec<&Hypothesis> =
        diagnosis.hypotheses.iter().enumerate().filter(worth).map(|(_, h)| h).collect();
    let rest = diagnosis.hypotheses.len() - shown.len();
    html! {
        h2 { "Hypotheses" }
        p { (opening(diagnosis)) }
        @for hypothesis in &shown { (row(diagnosis, hypothesis)) }
        @if rest > 0 { p.note { (rest) " further " (if rest == 1 { "hypothesis is" } else { "hypotheses are" }) " less probable than these." } }
        @if !shown.is_empty() { p.note { (LEGEND) } }
    }
}

const LEGEND: &str = "Log evidence: logarithm of the probability ratio of the recording with and without \
     the hypothesis, in nats (3 nats are a factor of 20). Detectability d′: size of the \
     signature relative to the scatter, after re-tuning the track; if it is small, the \
     effect resembles a change of stiffness or is hidden by the scatter.";

fn opening(diagnosis: &Diagnosis) -> &'static str {
    let any = !diagnosis.hypotheses.is_empty();
    match (diagnosis.verdict, any) {
        (Verdict::Consistent, _) if accepted(diagnosis).next().is_some() => {
            "The accepted hypothesis lies within the track model with a separate stiffness at \
                 every sleeper."
        }
        (Verdict::Consistent, true) => {
            "No hypothesis was accepted. These have the highest evidence, but none reaches the \
                 threshold."
        }
        (Verdict::Consistent, false) => {
            "No kind in the catalogue explains the recording better than the track model with a \
                 separate stiffness at every sleeper. This excludes effects above the scatter; it \
                 does not exclude an effect that is weaker than the scatter or that resembles a \
                 change of stiffness."
        }
        (Verdict::UnknownPhysics, _) => {
            "The difference is significant, but no kind of physics in the catalogue was \
                 accepted: each explains too little, or fails on passes that were not fitted."
        }
        (Verdict::MeasurementChain, _) => {
            "The accepted hypothesis is a fault of the measuring chain. Physics of the track \
                 cannot be assessed until it is corrected."
        }
        (Verdict::LeftOutPhysics, _) if addition(diagnosis).is_none() => {
            "The accepted hypothesis follows from the passes alone, without a track model. The \
                 predictions on this page do not include it."
        }
        (Verdict::LeftOutPhysics, _) => {
            "The accepted hypothesis also improves the prediction of passes that were not \
                 fitted. The others are listed with their probabilities."
        }
    }
}

fn row(diagnosis: &Diagnosis, hypothesis: &Hypothesis) -> Markup {
    let width = format!("width:{:.1}%", 100.0 * hypothesis.probability.clamp(0.0, 1.0));
    html! {
        div class=(class(hypothesis)) {
            div.name { (physics(&hypothesis.physics)) small { (summary(&hypothesis.physics)) } }
            div {
                div.share {
                    div.track { i style=(width) {} }
                    b { (per_cent(hypothesis.probability)) }
                    @if hypothesis.accepted { span.accepted-mark { "✓ accepted" } }
                }
                p { (facts(diagnosis, hypothesis)) }
                @if !hypothesis.look_alikes.is_empty() || !hypothesis.would_separate.is_empty() {
                    p { (alike(hypothesis)) }
                }
            }
        }
    }
}

fn class(hypothesis: &Hypothesis) -> String {
    let mut class = "hypothesis".to_owned();
    if hypothesis.accepted {
        class += " accepted";
    }
    match hypothesis.physics.as_str() {
        UNKNOWN => class += " unknown",
        name if is_chain(name) => class += " chain",
        _ => {}
    }
    class
}

/// Place and strength of evidence.
fn facts(diagnosis: &Diagnosis, hypothesis: &Hypothesis) -> String {
    let place = match &hypothesis.location {
        Some(location) => place(diagnosis, location),
        None if is_chain(&hypothesis.physics) => "in the measuring chain".to_owned(),
        None if hypothesis.physics == UNKNOWN => "where the mismatches are".to_owned(),
        None => "all along the track, or on the vehicle".to_owned(),
    };
    let by_chance = (-hypothesis.log_evidence).exp();
    let evidence = signed(hypothesis.log_evidence, 1);
    match hypothesis.physics.as_str() {
        UNKNOWN => format!("{place} · log evidence {evidence} nats"),
        _ if is_fitted(hypothesis) => format!(
            "{place} · log evidence {evidence} nats · detectability d′ {:.1}",
            hypothesis.detectability
        ),
        _ => format!(
            "{place} · found in the passes alone; probability by chance {}",
            chance(by_chance)
        ),
    }
}

fn alike(hypothesis: &Hypothesis) -> String {
    let names: Vec<String> = hypothesis.look_alikes.iter().map(|name| physics(name)).collect();
    let separate = hypothesis.would_separate.trim_end_matches('.');
    match (names.is_empty(), separate.is_empty()) {
        (false, false) => format!("Look-alikes: {}. To separate them: {separate}.", list(&names)),
        (false, true) => format!("Look-alikes: {}.", list(&names)),
        _ => format!("To separate: {separate}."),
    }
}
