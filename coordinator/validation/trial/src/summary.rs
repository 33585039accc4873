//! Summary of a trial: rates with their intervals, compared with the goals.

use crate::class::Class;
use crate::paper::Usual;
use crate::rate::{Rate, median};
use crate::score::{CaseScore, KnockedOut, Named, Placed};
use serde::{Deserialize, Serialize};
use tracktwin_diagnosis::Verdict;

/// Lengths `d'` from which effects must be seen nearly always, and mostly.
const SURE: f64 = 6.5;
const LIKELY: f64 = 5.0;

/// Bins of probabilities for the calibration error.
const BINS: usize = 10;

/// The scores of all cases together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Cases scored.
    pub cases: usize,
    /// A row a measure.
    pub rows: Vec<MeasureRow>,
    /// A row a kind of physics.
    pub kinds: Vec<KindRow>,
}

/// A measure, its value and its goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureRow {
    /// What is measured.
    pub measure: String,
    /// What came out.
    pub value: String,
    /// What was asked.
    pub goal: String,
    /// Whether it was reached; none where nothing was measured.
    pub reached: Option<bool>,
}

/// What became of one kind of physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KindRow {
    /// Its name.
    pub physics: String,
    /// How often it raised an alarm.
    pub detected: Rate,
    /// How often it was the first name.
    pub first: Rate,
    /// How often it was placed within one sleeper, of those with a place.
    pub placed: Rate,
    /// Median of `d'`.
    pub detectability: Option<f64>,
    /// How often the re-tuned baseline looked well: parameters inside Table D1, no cell far out.
    pub concealed: Rate,
    /// How often the paper's own pipeline looked content: parameters inside Table D1, the selector's
    /// error usual on controls; of none where it was not asked.
    pub content: Rate,
}

impl Summary {
    /// Summary of the scores; a case without a score has a failed diagnosis.
    pub fn new(cases: u32, scores: &[CaseScore]) -> Self {
        Self { cases: scores.len(), rows: rows(cases, scores), kinds: kinds(scores) }
    }
}

fn alarmed(score: &CaseScore) -> bool {
    score.verdict != Verdict::Consistent
}

fn of_class(scores: &[CaseScore], class: Class) -> impl Iterator<Item = &CaseScore> {
    scores.iter().filter(move |score| score.class == class)
}

/// Effects of the catalogue that were hidden alone, with their scores.
fn singles(scores: &[CaseScore]) -> impl Iterator<Item = (&CaseScore, &Named)> {
    of_class(scores, Class::Single).filter_map(|score| Some((score, score.hidden.first()?)))
}

fn rows(cases: u32, scores: &[CaseScore]) -> Vec<MeasureRow> {
    let scored: std::collections::BTreeSet<u32> = scores.iter().map(|score| score.number).collect();
    let broken_down = Rate::of((0..cases).map(|number| !scored.contains(&number)));
    [
        alarms(scores),
        names(scores),
        places(scores),
        vec![calibration(scores), bias(scores), cost(scores)],
        vec![at_most("diagnoses that broke down", broken_down, 0.0)],
    ]
    .concat()
}

fn visible(scores: &[CaseScore], least: f64) -> impl Iterator<Item = (&CaseScore, &Named)> {
    singles(scores)
        .filter(move |(_, named)| named.detectability.is_some_and(|length| length >= least))
}

fn alarms(scores: &[CaseScore]) -> Vec<MeasureRow> {
    let is_physics = |verdict| matches!(verdict, Verdict::LeftOutPhysics | Verdict::UnknownPhysics);
    let detected = |least| Rate::of(visible(scores, least).map(|(score, _)| alarmed(score)));
    let controls = Rate::of(of_class(scores, Class::Control).map(alarmed));
    let artefacts =
        Rate::of(of_class(scores, Class::Artefact).map(|score| is_physics(score.verdict)));
    let shuffled = scores.iter().filter_map(|score| score.shuffled);
    let shuffled = Rate::of(shuffled.map(is_physics));
    vec![
        at_most("false alarms on controls", controls, 0.05),
        at_most("artefacts called physics", artefacts, 0.02),
        at_least("detected, d' 6.5 and more", detected(SURE), 0.95),
        at_least("detected, d' 5 and more", detected(LIKELY), 0.75),
        at_most("of local effects found, called physics with sleepers shuffled", shuffled, 0.05),
    ]
}

fn names(scores: &[CaseScore]) -> Vec<MeasureRow> {
    let found = || visible(scores, LIKELY).filter(|(score, _)| alarmed(score));
    let strange = || of_class(scores, Class::Unknown).filter(|score| alarmed(score));
    let unknown = Rate::of(strange().map(|score| score.verdict == Verdict::UnknownPhysics));
    let doubles = || of_class(scores, Class::Double);
    let one = Rate::of(doubles().map(|score| score.hidden.iter().any(|named| named.accepted)));
    let both = Rate::of(doubles().map(|score| score.hidden.iter().all(|named| named.accepted)));
    let without = Rate::of(knocked_out(scores).map(|knocked_out| knocked_out.unknown));
    let gains = scores.iter().filter_map(|score| score.held_out_gain_nats);
    vec![
        at_least("named first, of those detected", Rate::of(found().map(|(_, n)| n.first)), 0.85),
        at_least(
            "in the 0.9 set, of those detected",
            Rate::of(found().map(|(_, n)| n.in_set)),
            0.95,
        ),
        at_least("unknowns called unknown, of those detected", unknown, 0.8),
        at_least("knocked out of the catalogue: called unknown", without, 0.8),
        at_least("two hidden: one of them named", one, 0.9),
        at_least("two hidden: both named", both, 0.6),
        at_least(
            "held-out gain positive, of what is accepted",
            Rate::of(gains.map(|g| g > 0.0)),
            0.95,
        ),
    ]
}

fn places(scores: &[CaseScore]) -> Vec<MeasureRow> {
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

fn at_least(measure: &str, rate: Rate, goal: f64) -> MeasureRow {
    row(measure, rate, format!("{:.0} % or more", 100.0 * goal), |share| share >= goal)
}

fn at_most(measure: &str, rate: Rate, goal: f64) -> MeasureRow {
    row(measure, rate, format!("{:.0} % at most", 100.0 * goal), |share| share <= goal)
}

fn row(measure: &str, rate: Rate, goal: String, reached: impl Fn(f64) -> bool) -> MeasureRow {
    let reached = rate.share().map(reached);
    MeasureRow { measure: measure.to_owned(), value: rate.to_text(), goal, reached }
}

/// Expected calibration error: by how much probabilities and frequencies differ, bin by bin.
fn calibration(scores: &[CaseScore]) -> MeasureRow {
    let given: Vec<(f64, bool)> =
        scores.iter().flat_map(|score| score.probabilities.iter().copied()).collect();
    let error = calibration_error(&given);
    MeasureRow {
        measure: "expected calibration error of the probabilities".to_owned(),
        value: error
            .map_or("none".to_owned(), |error| format!("{error:.3} ({} given)", given.len())),
        goal: "0.05 at most".to_owned(),
        reached: error.map(|error| error <= 0.05),
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

/// Errors of the stiffnesses next to effects that were named.
fn bias(scores: &[CaseScore]) -> MeasureRow {
    let named = singles(scores).filter(|(_, named)| named.accepted);
    let biases: Vec<_> = named.filter_map(|(score, _)| score.bias).collect();
    let count = biases.len() as f64;
    let before = biases.iter().map(|bias| bias.before).sum::<f64>() / count;
    let after = biases.iter().map(|bias| bias.after).sum::<f64>() / count;
    let known = !biases.is_empty();
    MeasureRow {
        measure: "mean absolute error of ln stiffness, railpad and ballast, next to what was named"
            .to_owned(),
        value: if known {
            format!("{after:.3}, re-tuned baseline {before:.3}")
        } else {
            "none".to_owned()
        },
        goal: "a third of the baseline's at most".to_owned(),
        reached: known.then_some(after <= before / 3.0),
    }
}

fn cost(scores: &[CaseScore]) -> MeasureRow {
    let seconds: Vec<f64> = scores.iter().map(|score| score.cpu_s).collect();
    let most = seconds.iter().copied().max_by(f64::total_cmp);
    let value = match (median(seconds), most) {
        (Some(median), Some(most)) => format!("median {median:.0} s, most {most:.0} s"),
        _ => "none".to_owned(),
    };
    let reached = most.map(|most| most <= 600.0);
    let measure = "CPU time of a diagnosis".to_owned();
    MeasureRow { measure, value, goal: "5 minutes on two cores".to_owned(), reached }
}

fn kinds(scores: &[CaseScore]) -> Vec<KindRow> {
    let controls = of_class(scores, Class::Control).filter_map(|score| score.paper.as_ref());
    let usual = Usual::of(&controls.collect::<Vec<_>>());
    let all = || {
        let alone = scores.iter().filter(|score| score.hidden.len() == 1);
        alone.filter_map(|score| Some((score, score.hidden.first()?)))
    };
    let names: std::collections::BTreeSet<&str> =
        all().map(|(_, named)| named.physics.as_str()).collect();
    let kind = |physics: &str| {
        let of = || all().filter(|(_, named)| named.physics == physics);
        let placed = of().filter(|(score, _)| alarmed(score)).filter_map(|(_, named)| named.place);
        KindRow {
            physics: physics.to_owned(),
            detected: Rate::of(of().map(|(score, _)| alarmed(score))),
            first: Rate::of(of().map(|(_, named)| named.first)),
            placed: Rate::of(placed.map(Placed::within_a_sleeper)),
            detectability: median(of().filter_map(|(_, named)| named.detectability).collect()),
            concealed: Rate::of(of().map(|(s, _)| s.parameters_inside && s.cells_inside)),
            content: Rate::of(
                of().filter_map(|(score, _)| Some(usual?.is_content(score.paper.as_ref()?))),
            ),
        }
    };
    names.into_iter().map(kind).collect()
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

    fn control(number: u32, verdict: Verdict) -> CaseScore {
        CaseScore {
            number,
            class: Class::Control,
            verdict,
            accepted: Vec::new(),
            hidden: Vec::new(),
            probabilities: Vec::new(),
            held_out_gain_nats: None,
            bias: None,
            parameters_inside: true,
            cells_inside: true,
            cpu_s: 50.0,
            knocked_out: None,
            shuffled: None,
            paper: None,
        }
    }

    #[test]
    fn one_alarm_on_ten_controls_misses_the_goal() {
        let scores: Vec<CaseScore> = (0..10)
            .map(|n| control(n, if n == 4 { Verdict::LeftOutPhysics } else { Verdict::Consistent }))
            .collect();
        let summary = Summary::new(10, &scores);
        assert!(summary.rows[0].value.starts_with("1 of 10: 10 %"), "{:?}", summary.rows[0]);
        assert_eq!(summary.rows[0].reached, Some(false));
        assert_eq!(Summary::new(4, &scores[..4]).rows[0].reached, Some(true));
        assert_eq!(summary.rows[1].reached, None);
        assert_eq!(summary.rows.last().unwrap().reached, Some(true));
        let without_one = Summary::new(11, &scores);
        let broken_down = without_one.rows.last().unwrap();
        assert!(broken_down.value.starts_with("1 of 11:"), "{broken_down:?}");
        assert_eq!(broken_down.reached, Some(false));
    }
}
