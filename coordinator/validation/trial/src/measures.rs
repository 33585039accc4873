//! Measures of a group of cases: rates with their intervals, compared with the goals.

use crate::class::Class;
use crate::paper::Usual;
use crate::rate::{Rate, median};
use crate::score::{CaseScore, KnockedOut, Named, Placed};
use tracktwin_diagnosis::Verdict;

/// Detectabilities `d'` from which effects must be seen nearly always, and mostly.
pub(crate) const SURE: f64 = 6.5;
pub(crate) const LIKELY: f64 = 5.0;

/// Bins of probabilities for the calibration error.
const BINS: usize = 10;

/// A measure of a group of cases, with its goal.
pub(crate) struct Measured {
    pub(crate) measure: &'static str,
    pub(crate) value: String,
    /// `None` if the measure is only reported.
    pub(crate) goal: Option<String>,
    pub(crate) reached: Option<bool>,
    /// Size for comparisons; a larger value is worse. `None` if nothing was measured.
    pub(crate) badness: Option<f64>,
    /// Number of cases of the measure.
    pub(crate) of: u64,
}

pub(crate) fn alarmed(score: &CaseScore) -> bool {
    score.verdict != Verdict::Consistent
}

pub(crate) fn of_class(scores: &[CaseScore], class: Class) -> impl Iterator<Item = &CaseScore> {
    scores.iter().filter(move |score| score.class == class)
}

/// Effects of the catalogue that were hidden alone, with their scores.
fn singles(scores: &[CaseScore]) -> impl Iterator<Item = (&CaseScore, &Named)> {
    of_class(scores, Class::Single).filter_map(|score| Some((score, score.hidden.first()?)))
}

/// Effects that were hidden alone, of the catalogue or not, with their scores.
pub(crate) fn alone(scores: &[CaseScore]) -> impl Iterator<Item = (&CaseScore, &Named)> {
    let one = |class| matches!(class, Class::Single | Class::Unknown);
    let cases = scores.iter().filter(move |score| one(score.class));
    cases.filter_map(|score| Some((score, score.hidden.first()?)))
}

/// All measures of the scores. `planned` is the number of cases; a case without a score is a failed
/// diagnosis. `usual` has the errors that the method of the paper usually has on controls.
pub(crate) fn measures(
    planned: usize,
    scores: &[CaseScore],
    usual: Option<&Usual<'_>>,
) -> Vec<Measured> {
    let broken_down = Rate { hits: (planned - scores.len()) as u64, of: planned as u64 };
    let mut all = not_shown(scores, usual);
    all.extend(of_any_strength(scores));
    all.extend(alarms(scores));
    all.extend(names(scores));
    all.extend(gains(scores));
    all.extend(places(scores));
    all.extend([calibration(scores), bias(scores), cost(scores)]);
    all.push(at_most("diagnoses that broke down", broken_down, 0.0));
    all
}

/// What is said of effects that the method of the paper does not show.
fn not_shown(scores: &[CaseScore], usual: Option<&Usual<'_>>) -> Vec<Measured> {
    let shown_as_usual = |score: &CaseScore| {
        let tested = usual.zip(score.paper.as_ref());
        tested.and_then(|(usual, paper)| usual.is_content(paper)) == Some(true)
    };
    let hidden: Vec<_> = alone(scores).filter(|(score, _)| shown_as_usual(score)).collect();
    let rate = |is_so: fn(&CaseScore, &Named) -> bool| {
        Rate::of(hidden.iter().map(|(score, named)| is_so(score, named)))
    };
    let places = hidden.iter().filter_map(|(_, named)| named.place);
    vec![
        without_goal(
            "not shown by the paper's pipeline: detected",
            rate(|score, _| alarmed(score)),
        ),
        without_goal(
            "not shown by the paper's pipeline: family first",
            rate(|_, named| named.family_first),
        ),
        without_goal(
            "not shown by the paper's pipeline, with a place: placed within one sleeper",
            Rate::of(places.map(Placed::within_a_sleeper)),
        ),
        without_goal(
            "not shown by the paper's pipeline, d' 6.5 and more: family first",
            Rate::of(
                hidden
                    .iter()
                    .filter(|(_, named)| named.detectability.is_some_and(|it| it >= SURE))
                    .map(|(_, named)| named.family_first),
            ),
        ),
    ]
}

/// What is said of all effects that were hidden alone, weak ones too.
fn of_any_strength(scores: &[CaseScore]) -> Vec<Measured> {
    let rate = |is_so: fn(&CaseScore, &Named) -> bool| {
        Rate::of(alone(scores).map(|(score, named)| is_so(score, named)))
    };
    let places = alone(scores).filter_map(|(_, named)| named.place);
    vec![
        without_goal("effects of any strength: detected", rate(|score, _| alarmed(score))),
        without_goal("effects of any strength: family first", rate(|_, named| named.family_first)),
        without_goal("effects of any strength: member first", rate(|_, named| named.first)),
        without_goal(
            "effects of any strength with a place: placed within one sleeper",
            Rate::of(places.map(Placed::within_a_sleeper)),
        ),
    ]
}

fn visible(scores: &[CaseScore], least: f64) -> impl Iterator<Item = (&CaseScore, &Named)> {
    singles(scores).filter(move |(_, named)| named.detectability.is_some_and(|it| it >= least))
}

fn alarms(scores: &[CaseScore]) -> Vec<Measured> {
    let is_physics = |verdict| matches!(verdict, Verdict::LeftOutPhysics | Verdict::UnknownPhysics);
    let detected = |least| Rate::of(visible(scores, least).map(|(score, _)| alarmed(score)));
    let controls = Rate::of(of_class(scores, Class::Control).map(alarmed));
    let artefacts =
        |is_so: &dyn Fn(&CaseScore) -> bool| Rate::of(of_class(scores, Class::Artefact).map(is_so));
    let called_physics = artefacts(&|score| is_physics(score.verdict));
    let shuffled = scores.iter().filter_map(|score| score.shuffled);
    let shuffled = Rate::of(shuffled.map(is_physics));
    vec![
        at_most("false alarms on controls", controls, 0.05),
        at_most("artefacts called physics", called_physics, 0.02),
        without_goal("artefacts detected", artefacts(&alarmed)),
        without_goal("artefacts named first", artefacts(&is_named_fault)),
        at_least("detected, d' 6.5 and more", detected(SURE), 0.95),
        at_least("detected, d' 5 and more", detected(LIKELY), 0.75),
        at_most("of local effects found, called physics with sleepers shuffled", shuffled, 0.05),
    ]
}

/// Whether a fault of the measuring chain is the first name, and the verdict is such a fault.
fn is_named_fault(score: &CaseScore) -> bool {
    score.verdict == Verdict::MeasurementChain && score.hidden.iter().all(|named| named.first)
}

fn names(scores: &[CaseScore]) -> Vec<Measured> {
    let found_from = |least| visible(scores, least).filter(|(score, _)| alarmed(score));
    let found = || found_from(LIKELY);
    let surely = |is_so: fn(&Named) -> bool| Rate::of(found_from(SURE).map(|(_, n)| is_so(n)));
    let strange = || of_class(scores, Class::Unknown).filter(|score| alarmed(score));
    let unknown = Rate::of(strange().map(|score| score.verdict == Verdict::UnknownPhysics));
    let doubles = || of_class(scores, Class::Double);
    let one = Rate::of(doubles().map(|score| score.hidden.iter().any(|named| named.accepted)));
    let both = Rate::of(doubles().map(|score| score.hidden.iter().all(|named| named.accepted)));
    let without = Rate::of(knocked_out(scores).map(|knocked_out| knocked_out.unknown));
    vec![
        at_least(
            "named first, of those detected, d' 5 and more",
            Rate::of(found().map(|(_, n)| n.first)),
            0.85,
        ),
        at_least(
            "family first, of those detected, d' 6.5 and more",
            surely(|n| n.family_first),
            0.9,
        ),
        at_least("member first, of those detected, d' 6.5 and more", surely(|n| n.first), 0.8),
        at_most(
            "wrong member stated above 90 %, of all cases",
            Rate::of(scores.iter().map(|score| score.wrong_member)),
            0.02,
        ),
        at_least(
            "in the 0.9 set, of those detected, d' 5 and more",
            Rate::of(found().map(|(_, n)| n.in_set)),
            0.95,
        ),
        at_least("unknowns called unknown, of those detected", unknown, 0.8),
        at_least("knocked out of the catalogue: called unknown", without, 0.8),
        at_least("two hidden: one of them named", one, 0.9),
        at_least("two hidden: both named", both, 0.6),
    ]
}

/// Held-out gains: how many are positive, and how large they are for right and for wrong names.
fn gains(scores: &[CaseScore]) -> Vec<Measured> {
    let gains = scores.iter().filter_map(|score| score.held_out_gain_nats);
    let positive = Rate::of(gains.map(|gain| gain > 0.0));
    let of = |measure, is_right: bool| {
        let named = scores.iter().filter(|it| it.is_first_name_right() == Some(is_right));
        let gains: Vec<f64> = named.filter_map(|score| score.held_out_gain_nats).collect();
        let of = gains.len() as u64;
        let value = median(gains)
            .map_or("none".to_owned(), |median| format!("median {median:.0} nats (of {of})"));
        Measured { measure, value, goal: None, reached: None, badness: None, of }
    };
    vec![
        at_least("held-out gain positive, of what is accepted", positive, 0.95),
        of("held-out gain where the first name is right", true),
        of("held-out gain where the first name is wrong", false),
    ]
}

fn places(scores: &[CaseScore]) -> Vec<Measured> {
    let found = singles(scores).filter(|(score, _)| alarmed(score));
    let placed = Rate::of(found.filter_map(|(_, named)| named.place).map(Placed::within_a_sleeper));
    let without = knocked_out(scores).filter(|knocked_out| knocked_out.unknown);
    let without = Rate::of(without.filter_map(|k| k.place).map(Placed::within_a_sleeper));
    vec![
        at_least("placed within one sleeper, of those detected", placed, 0.95),
        at_least("knocked out and called unknown: placed within one sleeper", without, 0.9),
    ]
}

fn knocked_out(scores: &[CaseScore]) -> impl Iterator<Item = &KnockedOut> {
    scores.iter().filter_map(|score| score.knocked_out.as_ref())
}

/// A rate that is only reported.
fn without_goal(measure: &'static str, rate: Rate) -> Measured {
    Measured { goal: None, reached: None, ..at_least(measure, rate, 1.0) }
}

fn at_least(measure: &'static str, rate: Rate, goal: f64) -> Measured {
    let share = rate.share();
    Measured {
        measure,
        value: rate.to_text(),
        goal: Some(format!("{:.0} % or more", 100.0 * goal)),
        reached: share.map(|share| share >= goal),
        badness: share.map(|share| 1.0 - share),
        of: rate.of,
    }
}

fn at_most(measure: &'static str, rate: Rate, goal: f64) -> Measured {
    let share = rate.share();
    Measured {
        measure,
        value: rate.to_text(),
        goal: Some(format!("{:.0} % at most", 100.0 * goal)),
        reached: share.map(|share| share <= goal),
        badness: share,
        of: rate.of,
    }
}

/// Expected calibration error: by how much probabilities and frequencies differ, bin by bin.
fn calibration(scores: &[CaseScore]) -> Measured {
    let given: Vec<(f64, bool)> =
        scores.iter().flat_map(|score| score.probabilities.iter().copied()).collect();
    let error = calibration_error(&given);
    Measured {
        measure: "expected calibration error of the probabilities",
        value: error
            .map_or("none".to_owned(), |error| format!("{error:.3} ({} given)", given.len())),
        goal: Some("0.05 at most".to_owned()),
        reached: error.map(|error| error <= 0.05),
        badness: error,
        of: scores.len() as u64,
    }
}

fn calibration_error(given: &[(f64, bool)]) -> Option<f64> {
    let mut bins = [(0.0, 0.0); BINS];
    for &(probability, true_) in given {
        let bin = &mut bins[((probability * BINS as f64) as usize).min(BINS - 1)];
        bin.0 += probability;
        bin.1 += f64::from(u8::from(true_));
    }
    let sum: f64 = bins.iter().map(|(said, so)| (said - so).abs()).sum();
    (!given.is_empty()).then(|| sum / given.len() as f64)
}

/// Errors of the stiffnesses next to accepted effects.
fn bias(scores: &[CaseScore]) -> Measured {
    let named = singles(scores).filter(|(_, named)| named.accepted);
    let biases: Vec<_> = named.filter_map(|(score, _)| score.bias).collect();
    let count = biases.len() as f64;
    let before = biases.iter().map(|bias| bias.before).sum::<f64>() / count;
    let after = biases.iter().map(|bias| bias.after).sum::<f64>() / count;
    let known = !biases.is_empty();
    Measured {
        measure: "mean absolute error of ln stiffness, railpad and ballast, next to what was named",
        value: if known {
            format!("{after:.3}, re-tuned baseline {before:.3}")
        } else {
            "none".to_owned()
        },
        goal: Some("a third of the baseline's at most".to_owned()),
        reached: known.then_some(after <= before / 3.0),
        badness: known.then_some(after / before),
        of: biases.len() as u64,
    }
}

fn cost(scores: &[CaseScore]) -> Measured {
    let seconds: Vec<f64> = scores.iter().map(|score| score.cpu_s).collect();
    let most = seconds.iter().copied().max_by(f64::total_cmp);
    let median = median(seconds);
    let value = match (median, most) {
        (Some(median), Some(most)) => format!("median {median:.0} s, most {most:.0} s"),
        _ => "none".to_owned(),
    };
    Measured {
        measure: "CPU time of a diagnosis",
        value,
        goal: Some("median 60 s".to_owned()),
        reached: median.map(|median| median <= 60.0),
        badness: median,
        of: scores.len() as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_that_come_true_as_often_as_said_have_no_error() {
        let given: Vec<_> =
            (0..10).map(|n| (0.3, n < 3)).chain((0..4).map(|_| (1.0, true))).collect();
        assert!(calibration_error(&given).unwrap() < 1e-12);
        // Certain and wrong every time.
        assert_eq!(calibration_error(&[(1.0, false), (1.0, false)]), Some(1.0));
        assert_eq!(calibration_error(&[]), None);
    }
}
