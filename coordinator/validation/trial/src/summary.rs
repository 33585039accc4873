//! Summary of a trial: measures over all cases and by making, and results by kind.

use crate::class::Class;
use crate::making::Making;
use crate::measures::{Measured, alarmed, measures, of_class};
use crate::paper::Usual;
use crate::rate::{Rate, median};
use crate::score::{CaseScore, Placed};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Cases of a making from which it is compared with the others.
const ENOUGH: u64 = 5;

/// The scores of all cases together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Cases scored.
    pub cases: usize,
    /// Makings of the cases.
    pub makings: BTreeSet<Making>,
    /// One row per measure.
    pub rows: Vec<MeasureRow>,
    /// One row per kind of physics.
    pub kinds: Vec<KindRow>,
}

/// A measure, its value and its goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureRow {
    /// Name of the measure.
    pub measure: String,
    /// Value over all cases.
    pub value: String,
    /// Value over the cases of each making.
    pub by_making: BTreeMap<Making, String>,
    /// The making with the worst value, among those with at least five cases. `None` if fewer than two
    /// makings have so many cases, or if all values are equal.
    pub worst: Option<Making>,
    /// Goal of the measure.
    pub goal: String,
    /// Whether all cases together reach the goal. `None` if nothing was measured.
    pub reached: Option<bool>,
}

/// Results of one kind of physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KindRow {
    /// Name of the kind.
    pub physics: String,
    /// Rate of alarms.
    pub detected: Rate,
    /// Rate of cases in which the kind was the first accepted hypothesis.
    pub first: Rate,
    /// Rate of places correct to within one sleeper, among effects with a place.
    pub placed: Rate,
    /// Median of `d'`.
    pub detectability: Option<f64>,
    /// Rate of cases in which the fitted baseline does not show the effect: parameters inside their usual
    /// ranges, and no cell far beyond the random variation.
    pub concealed: Rate,
    /// Rate of cases in which the method of the paper does not show the effect: parameters inside Table
    /// D1, and an error of the model selector as usual for controls. Without observations if the method
    /// was not tested.
    pub content: Rate,
}

impl Summary {
    /// Summary of the scores of a trial. `planned` has the making of every case. A case without a score
    /// is a failed diagnosis.
    pub fn new(planned: &[Making], scores: &[CaseScore]) -> Self {
        let makings: BTreeSet<Making> = planned.iter().copied().collect();
        let of = |making: Making| {
            let planned = planned.iter().filter(|other| **other == making).count();
            let scores: Vec<CaseScore> =
                scores.iter().filter(|score| score.making == making).cloned().collect();
            (making, measures(planned, &scores))
        };
        let by_making: Vec<(Making, Vec<Measured>)> = makings.iter().copied().map(of).collect();
        let all = measures(planned.len(), scores).into_iter().enumerate();
        let rows = all.map(|(row, all)| {
            let parts = by_making.iter().map(|(making, measured)| (*making, &measured[row]));
            side_by_side(all, &parts.collect::<Vec<_>>())
        });
        Self { cases: scores.len(), rows: rows.collect(), kinds: kinds(scores), makings }
    }
}

/// A row with the measure of all cases and that of each making.
fn side_by_side(all: Measured, parts: &[(Making, &Measured)]) -> MeasureRow {
    MeasureRow {
        measure: all.measure.to_owned(),
        value: all.value,
        by_making: parts.iter().map(|(making, part)| (*making, part.value.clone())).collect(),
        worst: worst(parts),
        goal: all.goal,
        reached: all.reached,
    }
}

fn worst(parts: &[(Making, &Measured)]) -> Option<Making> {
    let enough = parts.iter().filter(|(_, part)| part.of >= ENOUGH);
    let mut ranked: Vec<(Making, f64)> =
        enough.filter_map(|(making, part)| Some((*making, part.badness?))).collect();
    ranked.sort_by(|(_, one), (_, other)| one.total_cmp(other));
    let (best, worst) = (ranked.first()?, ranked.last()?);
    (worst.1 > best.1).then_some(worst.0)
}

fn kinds(scores: &[CaseScore]) -> Vec<KindRow> {
    let controls = of_class(scores, Class::Control).filter_map(|score| score.paper.as_ref());
    let usual = Usual::of(&controls.collect::<Vec<_>>());
    let all = || {
        let alone = scores.iter().filter(|score| score.hidden.len() == 1);
        alone.filter_map(|score| Some((score, score.hidden.first()?)))
    };
    let names: BTreeSet<&str> = all().map(|(_, named)| named.physics.as_str()).collect();
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
    use tracktwin_diagnosis::Verdict;

    fn control(number: u32, verdict: Verdict) -> CaseScore {
        CaseScore {
            number,
            class: Class::Control,
            making: Making::ALL[number as usize % 2],
            verdict,
            accepted: Vec::new(),
            hidden: Vec::new(),
            probabilities: Vec::new(),
            wrong_member: false,
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

    /// Makings in turn.
    fn makings(cases: usize) -> Vec<Making> {
        Making::ALL[..2].iter().copied().cycle().take(cases).collect()
    }

    fn controls(cases: u32, alarms: &[u32]) -> Vec<CaseScore> {
        let said = |number| {
            if alarms.contains(&number) { Verdict::LeftOutPhysics } else { Verdict::Consistent }
        };
        (0..cases).map(|number| control(number, said(number))).collect()
    }

    #[test]
    fn makings_stand_side_by_side_and_the_worst_is_named_where_there_are_enough() {
        let summary = Summary::new(&makings(11), &controls(10, &[1, 4, 7]));
        let [first, second] = [Making::ALL[0], Making::ALL[1]];
        let alarms = &summary.rows[0];
        assert!(alarms.value.starts_with("3 of 10:"), "{alarms:?}");
        assert!(alarms.by_making[&first].starts_with("1 of 5:"), "{alarms:?}");
        assert!(alarms.by_making[&second].starts_with("2 of 5:"), "{alarms:?}");
        assert_eq!(alarms.worst, Some(second));
        // The case without a score is of the first.
        let broken_down = summary.rows.last().unwrap();
        assert!(broken_down.by_making[&first].starts_with("1 of 6:"), "{broken_down:?}");
        assert_eq!(broken_down.worst, Some(first));
        let few = Summary::new(&makings(8), &controls(8, &[1]));
        assert!(few.rows.iter().all(|row| row.worst.is_none()));
        let alike = Summary::new(&makings(10), &controls(10, &[1, 2]));
        assert_eq!(alike.rows[0].worst, None);
    }

    #[test]
    fn the_table_has_a_column_for_each_making_beside_all() {
        let scores = controls(10, &[1]);
        let page = Summary::new(&makings(10), &scores).to_markdown(&scores);
        let [first, second] = [Making::ALL[0], Making::ALL[1]].map(Making::name);
        let head = format!("| measure | all | {first} | {second} | worst | target | met |\n");
        assert!(page.starts_with(&head), "{page}");
        let columns = |line: &str| line.matches('|').count();
        let lines: Vec<&str> = page.lines().take_while(|line| !line.is_empty()).collect();
        assert!(lines.iter().all(|line| columns(line) == columns(lines[0])), "{page}");
        assert!(lines[2].contains(&format!("| {second} | 5 % at most | **not reached** |")));
        assert!(page.contains(&format!("| 1 | {second} | nothing | left_out_physics |")), "{page}");
    }

    #[test]
    fn a_wrong_member_stated_as_certain_counts_of_all_cases() {
        let mut scores = controls(20, &[]);
        scores[3].wrong_member = true;
        let summary = Summary::new(&makings(20), &scores);
        let of = |row: &&MeasureRow| row.measure.starts_with("wrong member");
        let row = summary.rows.iter().find(of).unwrap();
        assert!(row.value.starts_with("1 of 20: 5 %") && row.reached == Some(false), "{row:?}");
    }

    #[test]
    fn one_alarm_on_ten_controls_misses_the_goal() {
        let scores = controls(10, &[4]);
        let summary = Summary::new(&makings(10), &scores);
        assert!(summary.rows[0].value.starts_with("1 of 10: 10 %"), "{:?}", summary.rows[0]);
        assert_eq!(summary.rows[0].reached, Some(false));
        assert_eq!(Summary::new(&makings(4), &scores[..4]).rows[0].reached, Some(true));
        assert_eq!(summary.rows[1].reached, None);
        assert_eq!(summary.rows.last().unwrap().reached, Some(true));
        let without_one = Summary::new(&makings(11), &scores);
        let broken_down = without_one.rows.last().unwrap();
        assert!(broken_down.value.starts_with("1 of 11:"), "{broken_down:?}");
        assert_eq!(broken_down.reached, Some(false));
    }
}
