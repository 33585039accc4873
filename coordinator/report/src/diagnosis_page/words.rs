//! Readable names of physics, sleepers and locations.

use tracktwin_diagnosis::{Diagnosis, Hypothesis, Location, UNKNOWN, run_of};
use tracktwin_track::extension::Kind;

/// Maximum number of sleepers that are listed individually.
const NAMED_MAX: usize = 4;

/// Readable name of a kind in the catalogue.
pub(super) fn physics(name: &str) -> String {
    name.replace('_', " ")
}

/// Summary of a kind, without a full stop.
pub(super) fn summary(name: &str) -> &'static str {
    match Kind::from_name(name) {
        Some(kind) => kind.summary,
        None if name == UNKNOWN => "something that the catalogue does not have",
        None => "",
    }
}

/// Whether the kind is a fault of the measuring chain.
pub(super) fn is_chain(name: &str) -> bool {
    Kind::from_name(name).is_some_and(|kind| kind.measuring_chain)
}

/// Accepted hypotheses.
pub(super) fn accepted(diagnosis: &Diagnosis) -> impl Iterator<Item = &Hypothesis> {
    diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted)
}

/// Whether the track model was fitted with this hypothesis. A hypothesis found in the passes alone was not
/// fitted.
pub(super) fn is_fitted(hypothesis: &Hypothesis) -> bool {
    hypothesis.physics != UNKNOWN && hypothesis.detectability > 0.0
}

/// Kinds that are only in the second prediction, each once; `None` if there are none.
pub(super) fn addition(diagnosis: &Diagnosis) -> Option<String> {
    let fitted = accepted(diagnosis).filter(|hypothesis| is_fitted(hypothesis));
    let mut names: Vec<String> = Vec::new();
    for name in fitted.map(|hypothesis| physics(&hypothesis.physics)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    (!names.is_empty()).then(|| list(&names))
}

/// Joins items as "a", "a and b", "a, b and c".
pub(super) fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Sleepers as "SN18", as [`run_of`] if they are a run, or listed individually.
pub(super) fn sleepers(diagnosis: &Diagnosis, ids: &[String]) -> String {
    let all: Vec<String> = diagnosis.track.iter().map(|sleeper| sleeper.id.clone()).collect();
    run_of(ids, &all).unwrap_or_else(|| {
        if ids.len() > NAMED_MAX {
            format!("{} and {} more", ids[..NAMED_MAX].join(", "), ids.len() - NAMED_MAX)
        } else {
            list(ids)
        }
    })
}

/// Indices of the sleepers with these names.
pub(super) fn numbers(diagnosis: &Diagnosis, ids: &[String]) -> Vec<usize> {
    ids.iter().filter_map(|id| diagnosis.track.iter().position(|known| known.id == *id)).collect()
}

/// Text of a location on the track.
pub(super) fn place(diagnosis: &Diagnosis, location: &Location) -> String {
    let stretch = stretch(location.x_m);
    if location.sleepers.len() == diagnosis.track.len() && !diagnosis.track.is_empty() {
        return "all along the track".to_owned();
    }
    match sleepers(diagnosis, &location.sleepers) {
        names if names.is_empty() => stretch,
        names => format!("{names}, {stretch}"),
    }
}

/// Range of positions in m, with millimetres.
pub(super) fn stretch([from, to]: [f64; 2]) -> String {
    if (to - from).abs() < 5e-4 {
        format!("{from:.3} m")
    } else {
        format!("{from:.3} to {to:.3} m")
    }
}

/// Speeds in km/h, with three significant digits.
pub(super) fn speeds(speeds_km_h: &[f64]) -> String {
    let rounded = |speed: &f64| tracktwin_number::rounded(*speed, 3);
    let texts: Vec<String> = speeds_km_h.iter().map(rounded).collect();
    format!("{} km/h", list(&texts))
}

/// Smallest p-value shown on a page. A few hundred null simulations do not resolve smaller ones.
const CHANCE_LEAST: f64 = 1e-3;

/// Text of a p-value, for use after "probability".
pub(super) fn chance(p_value: f64) -> String {
    tracktwin_number::chance_down_to(p_value, CHANCE_LEAST)
}
