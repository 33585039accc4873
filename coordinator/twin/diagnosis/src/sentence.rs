//! Summary of a diagnosis in one or two sentences.

use crate::outcome::{BeforeAfter, FitScores, Hypothesis, UNKNOWN, Verdict, meet};
use crate::search::HELD_OUT_MIN;
use std::collections::BTreeMap;
use tracktwin_track::extension::{Kind, PlaceKind};

/// Smallest bias of a parameter's logarithm that the sentence states.
const BIAS_MIN: f64 = 0.1;

/// The family is stated first if its probability exceeds that of its member by more than this.
const FAMILY_MORE: f64 = 0.02;

/// Smallest probability of another hypothesis that the sentence states.
const RIVAL_MIN: f64 = 0.05;

/// Error of a sum of probabilities from rounding and limits.
const ROUNDING: f64 = 0.01;

/// Largest number of sleepers that are listed one by one.
const NAMED_MAX: usize = 3;

/// Sentence on the hypotheses: kind, location, probability and removed bias. `sleepers` are the ids of the
/// section's sleepers; `nothing_left_out` is a probability.
pub(crate) fn sentence(
    verdict: Verdict,
    hypotheses: &[Hypothesis],
    nothing_left_out: f64,
    sleepers: &[String],
    fit: &FitScores,
    bias: &BTreeMap<String, BeforeAfter<f64>>,
) -> String {
    let mut accepted = hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    let Some(first) = accepted.next().filter(|_| verdict != Verdict::Consistent) else {
        let tested = match fit.before.held_out {
            Some(_) => "improves the prediction of speeds that were held out",
            None => "explains it better; a second speed would make that sure",
        };
        let tested = format!(
            "with every sleeper's stiffness, level and spectrum re-tuned, nothing that the catalogue \
             knows {tested}"
        );
        let percent = 100.0 * nothing_left_out.max(1.0 - nothing_left_out);
        return if nothing_left_out >= 0.5 {
            format!("Simulation and recording agree ({percent:.0} %): {tested}.")
        } else {
            format!(
                "Nothing can be named: {tested}. Yet something seems left out ({percent:.0} %)."
            )
        };
    };
    let others = accepted.filter(|other| !are_alike(first, other));
    let others = others.map(|other| format!(" Also: {}", named(other, sleepers)));
    let found = capital(&named(first, sleepers)) + &rival(first, hypotheses);
    let found = found + &others.collect::<String>();
    [found, gained(fit), biased(bias)].concat()
}

/// Location, summary, name and probability of a hypothesis.
fn named(hypothesis: &Hypothesis, sleepers: &[String]) -> String {
    let Hypothesis { physics, probability, .. } = hypothesis;
    let summary = Kind::from_name(physics)
        .map_or_else(|| unknown(hypothesis), |kind| kind.summary.to_owned());
    let place = place(hypothesis, sleepers);
    let family = Kind::from_name(physics).map(|kind| kind.family.words());
    match family.filter(|_| hypothesis.family_probability > probability + FAMILY_MORE) {
        Some(family) => format!(
            "{place}{family} ({:.0} %); most probably {summary} ({physics}, {:.0} %).",
            100.0 * hypothesis.family_probability,
            100.0 * probability
        ),
        None => format!("{place}{summary} ({physics}, {:.0} %).", 100.0 * probability),
    }
}

/// The next alternative to the first hypothesis, and the measurement that separates them. Alternatives
/// share one probability; a hypothesis that is probable in addition to the first is another effect.
fn rival(first: &Hypothesis, hypotheses: &[Hypothesis]) -> String {
    let is_rival = |other: &&Hypothesis| {
        (!other.accepted || are_alike(first, other))
            && other.physics != first.physics
            && other.probability >= RIVAL_MIN
            && first.probability + other.probability <= 1.0 + ROUNDING
            && meet(first.location.as_ref(), other.location.as_ref())
    };
    let Some(other) = hypotheses.iter().find(is_rival) else { return String::new() };
    let percent = 100.0 * other.probability;
    let is_unknown = other.physics == UNKNOWN;
    let name = if is_unknown { unknown(other) } else { other.physics.clone() };
    format!(
        " It could also be {name} ({percent:.0} %). To tell them apart: {}.",
        first.would_separate
    )
}

/// Whether an unknown element and the kind that models it are two names of one finding.
fn are_alike(first: &Hypothesis, other: &Hypothesis) -> bool {
    first.physics == UNKNOWN
        && first.look_alikes.contains(&other.physics)
        && first.location == other.location
}

/// Description of unknown physics: its port, the family that it is most like, and its behaviour.
fn unknown(hypothesis: &Hypothesis) -> String {
    let port = match hypothesis.port.as_deref() {
        Some("rail_seat") => " under the rail seat",
        Some("between_rail_seats") => " between the rail seats",
        Some("wheel") => " at the wheel",
        Some("rail_surface") => " on the rail's surface",
        Some("wheel_surface") => " on the wheel's tread",
        _ => "",
    };
    let does = hypothesis.behaviour.and_then(|element| element.words(&hypothesis.parameters));
    let does = does.map_or(String::new(), |does| format!("; it {does}"));
    // The families of unknown physics have no kinds, and the port already states them.
    let is_family = |kind: &&Kind| hypothesis.family.as_deref() == Some(kind.family.name());
    let like = Kind::all().find(is_family);
    let like = like.map_or(String::new(), |kind| format!(", most like {}", kind.family.words()));
    format!("something{port} that the catalogue lacks{like}{does}")
}

/// The text with a capital first letter.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().into_iter().flat_map(char::to_uppercase).chain(letters).collect()
}

fn place(hypothesis: &Hypothesis, sleepers: &[String]) -> String {
    match &hypothesis.location {
        Some(location) if location.sleepers.len() <= NAMED_MAX => {
            let middle_m = 0.5 * (location.x_m[0] + location.x_m[1]);
            let ids = location.sleepers.join(" and ");
            let near = if ids.is_empty() { ids } else { ids + ", " };
            format!("at {near}{middle_m:.2} m: ")
        }
        Some(location) if is_stretch(&hypothesis.physics) => {
            format!("from {:.2} to {:.2} m: ", location.x_m[0], location.x_m[1])
        }
        Some(location) if location.sleepers.len() < sleepers.len() => {
            format!("at {}: ", together(&location.sleepers, sleepers))
        }
        _ if hypothesis.port.as_deref() == Some("rail_seat") => "at all sleepers: ".to_owned(),
        _ => String::new(),
    }
}

/// Ids of some of all sleepers, as a run where they are one.
fn together(some: &[String], all: &[String]) -> String {
    run_of(some, all).unwrap_or_else(|| some.join(", "))
}

/// Ids of some of all sleepers, both in the order of the track, as "SN12 to SN25" or "SN12 to SN25 except SN18" if at
/// most a quarter between the first and the last is missing. `None` for fewer than three or for others.
pub fn run_of(some: &[String], all: &[String]) -> Option<String> {
    let index = |id: &String| all.iter().position(|known| known == id);
    let [first, _, .., last] = some else { return None };
    let run = all.get(index(first)?..=index(last)?)?;
    let holes: Vec<String> = run.iter().filter(|id| !some.contains(id)).cloned().collect();
    if run.len() != some.len() + holes.len() || 4 * holes.len() > run.len() {
        return None;
    }
    let except =
        if holes.is_empty() { String::new() } else { format!(" except {}", holes.join(", ")) };
    Some(format!("{first} to {last}{except}"))
}

/// Whether the location of a kind is a stretch of the rail.
fn is_stretch(physics: &str) -> bool {
    Kind::from_name(physics).is_some_and(|kind| kind.place == PlaceKind::Stretch)
}

fn gained(fit: &FitScores) -> String {
    let gain: f64 = fit.held_out_gain_nats.values().sum();
    if fit.held_out_gain_nats.is_empty() {
        return String::new();
    }
    if gain < HELD_OUT_MIN {
        return " Speeds that were held out do not confirm it.".to_owned();
    }
    format!(
        " With what was found, the model predicts speeds that it was not fitted to better by {gain:.0} nats."
    )
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

/// Name of a parameter in a sentence.
fn words(parameter: &str) -> &str {
    match parameter {
        "sleeper_EI_N_m2" => "the sleepers' bending stiffness",
        "ballast_stiffness_N_m" => "ballast stiffness",
        "railpad_stiffness_N_m" => "railpad stiffness",
        "irregularity_level" => "the irregularity level",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::behaviour::Element;
    use crate::estimate::Estimate;
    use crate::outcome::{Location, Score, Scores};

    #[test]
    fn where_nothing_is_named_agreement_is_not_said_of_what_seems_left_out() {
        let held_out = Some(Score { score: -1.0 });
        let scores = Scores { in_sample: Score { score: -1.0 }, held_out };
        let (score, held_out_gain_nats) = (String::new(), BTreeMap::new());
        let fit = FitScores { score, before: scores, after: scores, held_out_gain_nats };
        let said = |nothing_left_out: f64| {
            sentence(Verdict::Consistent, &[], nothing_left_out, &track(), &fit, &BTreeMap::new())
        };
        assert!(
            said(0.92).starts_with("Simulation and recording agree (92 %): with every sleeper")
        );
        let doubt = said(0.03);
        assert!(doubt.starts_with("Nothing can be named: with every sleeper"), "{doubt}");
        assert!(doubt.ends_with("Yet something seems left out (97 %)."), "{doubt}");
    }

    fn track() -> Vec<String> {
        (7..32).map(|number| format!("SN{number}")).collect()
    }

    #[test]
    fn a_run_of_sleepers_is_named_by_its_ends() {
        let all = track();
        assert_eq!(together(&all[5..19], &all), "SN12 to SN25");
        let holes = [&all[5..9], &all[10..12], &all[13..19]].concat();
        assert_eq!(together(&holes, &all), "SN12 to SN25 except SN16, SN19");
        let every_fourth: Vec<String> = all.iter().step_by(8).cloned().collect();
        assert_eq!(together(&every_fourth, &all), "SN7, SN15, SN23, SN31");
    }

    #[test]
    fn all_that_was_accepted_is_said_with_its_place() {
        let at = Location { x_m: [1.125, 1.125], sleepers: vec!["SN9".to_owned()] };
        let two = [
            Hypothesis::accepted("wheel_flat", None),
            Hypothesis::accepted("missing_railpad", Some(at)),
        ];
        let scores = Scores { in_sample: Score { score: -1.0 }, held_out: None };
        let fit = FitScores {
            score: String::new(),
            before: scores,
            after: scores,
            held_out_gain_nats: BTreeMap::from([("10".to_owned(), 12.0)]),
        };
        let said = sentence(Verdict::LeftOutPhysics, &two, 0.0, &track(), &fit, &BTreeMap::new());
        assert_eq!(
            said,
            "A flat of the wheel's tread, met once a turn (wheel_flat, 99 %). Also: at SN9, 1.12 m: a \
             railpad is missing or has lost most of its stiffness (missing_railpad, 99 %). With what \
             was found, the model predicts speeds that it was not fitted to better by 12 nats."
        );
        let held_out_gain_nats = BTreeMap::from([("10".to_owned(), 6.0), ("13".to_owned(), -4.0)]);
        let doubt = gained(&FitScores { held_out_gain_nats, ..fit });
        assert_eq!(doubt, " Speeds that were held out do not confirm it.");
    }

    #[test]
    fn a_family_is_said_before_its_member_and_what_else_it_could_be() {
        let at = Location { x_m: [1.75, 1.75], sleepers: vec!["SN14".to_owned()] };
        let first = Hypothesis {
            probability: 0.8,
            family_probability: 0.95,
            would_separate: "passes with another wheel load".to_owned(),
            ..Hypothesis::accepted("hanging_sleeper", Some(at))
        };
        assert_eq!(
            named(&first, &track()),
            "at SN14, 1.75 m: a support of sleepers that is lost, soft or layered (95 %); most \
             probably a sleeper hangs on the rail over a gap and meets its ballast only when it closes \
             (hanging_sleeper, 80 %)."
        );
        let mut second = Hypothesis::accepted("subgrade_layer", None);
        (second.accepted, second.probability) = (false, 0.15);
        let sure = Hypothesis { probability: 0.97, ..first.clone() };
        assert_eq!(rival(&sure, &[sure.clone(), second.clone()]), "");
        assert_eq!(
            rival(&first, &[first.clone(), second]),
            " It could also be subgrade_layer (15 %). To tell them apart: passes with another wheel \
             load."
        );
    }

    #[test]
    fn an_unknown_element_and_the_kind_that_models_it_are_one_finding() {
        let at = Location { x_m: [1.75, 1.75], sleepers: vec!["SN14".to_owned()] };
        let layer = Hypothesis {
            probability: 0.34,
            ..Hypothesis::accepted("subgrade_layer", Some(at.clone()))
        };
        let unknown = Hypothesis {
            probability: 0.63,
            look_alikes: vec!["subgrade_layer".to_owned()],
            would_separate: "a hammer test".to_owned(),
            ..Hypothesis::accepted("unknown_physics", Some(at))
        };
        let rival = rival(&unknown, &[unknown.clone(), layer.clone()]);
        assert_eq!(
            rival,
            " It could also be subgrade_layer (34 %). To tell them apart: a hammer test."
        );
        assert!(are_alike(&unknown, &layer) && !are_alike(&layer, &unknown));
    }

    #[test]
    fn something_unknown_is_said_with_its_place_its_port_and_what_it_does() {
        let at = Location { x_m: [3.0, 3.0], sleepers: vec!["SN24".to_owned()] };
        let estimate = |mean: f64| Estimate { mean, sd: 0.1 * mean };
        let absorber = Hypothesis {
            port: Some("rail_seat".to_owned()),
            behaviour: Some(Element::MassOnSpring),
            parameters: BTreeMap::from([
                ("mass_kg".to_owned(), estimate(0.41)),
                ("frequency_Hz".to_owned(), estimate(900.0)),
            ]),
            ..Hypothesis::accepted("unknown_physics", Some(at))
        };
        assert_eq!(
            capital(&named(&absorber, &track())),
            "At SN24, 3.00 m: something under the rail seat that the catalogue lacks; it \
             acts like a mass of 0.41 kg on a spring, at 900 Hz (unknown_physics, 99 %)."
        );
        let support = Hypothesis { family: Some("support".to_owned()), ..absorber.clone() };
        assert!(named(&support, &track()).contains(
            "lacks, most like a support of sleepers that is lost, soft or layered; it acts"
        ));
        let structure = Hypothesis { family: Some("unknown_structure".to_owned()), ..absorber };
        assert!(named(&structure, &track()).contains("lacks; it acts"));
        let away = Location { x_m: [4.5, 4.6], sleepers: Vec::new() };
        assert!(meet(Some(&away), Some(&Location { x_m: [4.55, 4.7], ..away.clone() })));
        let beyond = Hypothesis { location: Some(away), ..structure.clone() };
        assert!(named(&beyond, &track()).starts_with("at 4.55 m: something"));
        let everywhere = Hypothesis { location: None, behaviour: None, ..structure };
        assert_eq!(
            named(&everywhere, &track()),
            "at all sleepers: something under the rail seat that the catalogue lacks \
             (unknown_physics, 99 %)."
        );
    }
}
