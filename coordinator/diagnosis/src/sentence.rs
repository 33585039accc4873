//! A diagnosis in one sentence or two.

use crate::outcome::{BeforeAfter, Fit, Hypothesis, Verdict};
use std::collections::BTreeMap;
use tracktwin_track::extension::Kind;

/// Logarithm of a parameter's bias that is worth a word.
const BIAS_MIN: f64 = 0.1;

/// Sleepers that are named one by one.
const NAMED_MAX: usize = 3;

/// What was found, where, how sure, and what it changes; for a section of so many sleepers, of
/// which nothing is left out with this probability.
pub(crate) fn sentence(
    verdict: Verdict,
    hypotheses: &[Hypothesis],
    nothing_left_out: f64,
    sleepers: usize,
    fit: &Fit,
    bias: &BTreeMap<String, BeforeAfter<f64>>,
) -> String {
    let accepted = hypotheses.iter().find(|hypothesis| hypothesis.accepted);
    let Some(first) = accepted.filter(|_| verdict != Verdict::Consistent) else {
        let tested = match fit.before.held_out {
            Some(_) => "improves the prediction of speeds that were held out",
            None => "explains it better; a second speed would make that sure",
        };
        return format!(
            "Simulation and recording agree ({:.0} %): with every sleeper's stiffness, level and \
             spectrum re-tuned, nothing that the catalogue knows {tested}.",
            100.0 * nothing_left_out
        );
    };
    let summary = Kind::from_name(&first.physics)
        .map_or("something that no kind in the catalogue explains", |kind| kind.summary);
    let (place, probability) = (place(first, sleepers), 100.0 * first.probability);
    let name = format!("{place}{summary} ({}, {probability:.0} %).", first.physics);
    [name, gained(fit), biased(bias)].concat()
}

fn place(hypothesis: &Hypothesis, sleepers: usize) -> String {
    match &hypothesis.location {
        Some(location) if location.sleepers.len() <= NAMED_MAX => {
            let middle_m = 0.5 * (location.x_m[0] + location.x_m[1]);
            format!("At {}, {middle_m:.2} m: ", location.sleepers.join(" and "))
        }
        Some(location) if hypothesis.physics == "corrugation" => {
            format!("From {:.2} to {:.2} m: ", location.x_m[0], location.x_m[1])
        }
        Some(location) if location.sleepers.len() < sleepers => {
            format!("At {}: ", location.sleepers.join(", "))
        }
        _ => match hypothesis.port.as_deref() {
            Some("wheel") => "At the wheel: ".to_owned(),
            Some("wheel_surface") => "On the wheel's tread: ".to_owned(),
            _ => String::new(),
        },
    }
}

fn gained(fit: &Fit) -> String {
    let gain: f64 = fit.held_out_gain_nats.values().sum();
    if gain <= 0.0 {
        return String::new();
    }
    format!(" With it, speeds that nothing was fitted to are predicted better by {gain:.0} nats.")
}

fn biased(bias: &BTreeMap<String, BeforeAfter<f64>>) -> String {
    let size = |pair: &BeforeAfter<f64>| (pair.before / pair.after).ln().abs();
    let worst = bias
        .iter()
        .filter(|(name, pair)| !name.contains("damping") && size(pair) > BIAS_MIN)
        .max_by(|a, b| size(a.1).total_cmp(&size(b.1)));
    let Some((name, pair)) = worst else { return String::new() };
    let change = 100.0 * (pair.before / pair.after - 1.0);
    let direction = if change > 0.0 { "high" } else { "low" };
    format!(" Without it, {} comes out {:.0} % too {direction}.", words(name), change.abs())
}

/// What a parameter is called in a sentence.
fn words(parameter: &str) -> &str {
    match parameter {
        "sleeper_EI_N_m2" => "the sleepers' bending stiffness",
        "ballast_stiffness_N_m" => "ballast stiffness",
        "railpad_stiffness_N_m" => "railpad stiffness",
        "irregularity_level" => "the irregularity level",
        other => other,
    }
}
