//! Agreement of recording and prediction in numbers, with an explanation.

use super::levels::{Side, cells, rms};
use super::place::Site;
use super::quantity::{digits, signed};
use super::words::{accepted, addition, physics, speeds};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Score, Scores};

/// Section with the scores, and with differences and gains by speed.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let fit = &diagnosis.fit;
    if diagnosis.track.is_empty() && fit.before.held_out.is_none() {
        return html! {
            h2 { "Goodness of fit" }
            p { "No track model was compared and nothing was fitted, so there are no scores." }
        };
    }
    // Where no track was compared the first that was found is what the scores are about.
    let alone = || accepted(diagnosis).next().map(|found| physics(&found.physics));
    let with = addition(diagnosis).or_else(|| alone().filter(|_| diagnosis.track.is_empty()));
    let without = if diagnosis.track.is_empty() { "without it" } else { "re-tuned track" };
    let withheld = if diagnosis.track.is_empty() {
        "on blocks withheld from it"
    } else {
        "on speeds withheld from it"
    };
    html! {
        h2 { "Goodness of fit" }
        p { (meaning(diagnosis)) }
        div.scroll { table {
            thead { tr { th { "model" } th { "score" small { "on what it was fitted to" } } th { "score" small { (withheld) } } } }
            tbody {
                (scores(without, &fit.before, false))
                @if let Some(with) = &with { (scores(&format!("with {with}"), &fit.after, true)) }
            }
        } }
        p.note { "Score: " (fit.score) ". Higher is better." }
        @if !diagnosis.levels.speeds_km_h.is_empty() { (by_speed(diagnosis, with.is_some())) }
    }
}

fn scores(name: &str, scores: &Scores, better: bool) -> Markup {
    let text = |score: Score| signed(score.score, 2);
    html! {
        tr.better[better] {
            td { (name) } td { (text(scores.in_sample)) }
            td { (scores.held_out.map_or_else(|| "–".to_owned(), text)) }
        }
    }
}

/// Explanation of the scores in one sentence.
fn meaning(diagnosis: &Diagnosis) -> String {
    let fit = &diagnosis.fit;
    let single = "With a single speed no speed could be withheld, so no model was tested on other \
         passes; add a second speed.";
    match (fit.before.held_out, fit.after.held_out) {
        _ if diagnosis.track.is_empty() => "No track model was compared. Every other block of the recording was withheld, and \
             predicted by a fit to its neighbours.".to_owned(),
        (Some(before), Some(after)) if addition(diagnosis).is_some() => {
            let factor = (after.score - before.score).exp();
            let change = if factor >= 1.0 { "more" } else { "less" };
            let per_cent = 100.0 * (factor.max(1.0 / factor) - 1.0);
            format!(
                "Each speed was withheld in turn and predicted from the others: with the addition, every level measured at the withheld speed is on average {} % {change} probable than without it.",
                digits(per_cent, 2)
            )
        }
        (Some(_), _) => "Each speed was withheld in turn and predicted from the others: the two scores are alike where the model has learnt the track and not the noise.".to_owned(),
        (None, _) => single.to_owned(),
    }
}

/// Table of differences and gains, one row per speed.
fn by_speed(diagnosis: &Diagnosis, extended: bool) -> Markup {
    let levels = &diagnosis.levels;
    let site = Site::first(diagnosis);
    let gains = extended && !diagnosis.fit.held_out_gain_nats.is_empty();
    let pair = |sides: [Option<f64>; 2]| -> String {
        let [before, after] =
            sides.map(|db| db.map_or_else(|| "–".to_owned(), |db| format!("{db:.1}")));
        if extended { format!("{before} → {after}") } else { before }
    };
    let here = |speed: usize| {
        pair(
            [Side::Before, Side::After]
                .map(|side| rms(levels, side, site.cells_at(diagnosis, speed))),
        )
    };
    let overall = |speed: usize| {
        pair([Side::Before, Side::After].map(|side| rms(levels, side, cells(diagnosis, speed))))
    };
    html! {
        div.scroll { table {
            thead { tr {
                th { "speed" }
                @if site.is_part(diagnosis) { th { "difference " (site.at()) small { "dB, root mean square" } } }
                th { "difference over all sleepers" small { "dB, root mean square" } }
                @if gains { th { "gain when withheld" small { "nats, all its levels together" } } }
            } }
            tbody {
                @for (speed, km_h) in levels.speeds_km_h.iter().enumerate() {
                    tr {
                        td { (speeds(&[*km_h])) }
                        @if site.is_part(diagnosis) { td { (here(speed)) } }
                        td { (overall(speed)) }
                        @if gains { td { (gain(diagnosis, *km_h).map_or_else(|| "–".to_owned(), |gain| signed(gain, 1))) } }
                    }
                }
            }
        } }
        @if gains { p.note { "A gain is the logarithm of the probability ratio of the withheld passes with and \
             without the addition; 2.3 nats are a factor of ten." } }
    }
}

/// Gain at a speed. Its key begins with the speed in km/h, which may be rounded.
fn gain(diagnosis: &Diagnosis, km_h: f64) -> Option<f64> {
    let speed = |key: &str| {
        let number = key.trim_start().split(|c: char| !(c.is_ascii_digit() || c == '.')).next();
        number.and_then(|number| number.parse::<f64>().ok())
    };
    let here = |key: &str| speed(key).is_some_and(|speed| (speed - km_h).abs() <= 0.51);
    let mut gains = diagnosis.fit.held_out_gain_nats.iter();
    gains.find(|(key, _)| here(key)).map(|(_, gain)| *gain)
}
