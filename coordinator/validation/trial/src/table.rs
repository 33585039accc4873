//! The result of a trial as a page of Markdown.

use crate::making::Making;
use crate::rate::Rate;
use crate::score::CaseScore;
use crate::strength::StrengthRow;
use crate::summary::{KindRow, MeasureRow, Summary};
use std::fmt::Write;

/// What the tables say about the held-out gain.
const NOTE: &str = "\nNote: the rule of acceptance demands a held-out gain of 4 nats or more of a kind. So a named kind \
cannot miss this target; only \"unknown\" can.\n";

impl Summary {
    /// The tables, with one line for each case whose diagnosis is not completely correct.
    pub fn to_markdown(&self, scores: &[CaseScore]) -> String {
        let makings: Vec<_> = self.makings.iter().map(|making| making.name()).collect();
        let makings = makings.join(" | ");
        let mut page = format!("| measure | all | {makings} | worst | target | met |\n|");
        page.push_str(&"---|".repeat(self.makings.len() + 5));
        page.push('\n');
        self.rows.iter().for_each(|row| page.push_str(&measure(row)));
        page.push_str(NOTE);
        page.push_str(
            "\n| d' of effects that were hidden alone | alarm | family first | member first \
             |\n|---|---|---|---|\n",
        );
        self.strengths.iter().for_each(|row| page.push_str(&of_strength(row)));
        page.push_str(
            "\n| hidden | alarm | first name | placed within a sleeper | median d' | re-tuned \
             baseline looks well | paper's pipeline content |\n|---|---|---|---|---|---|---|\n",
        );
        self.kinds.iter().for_each(|kind| page.push_str(&of_kind(kind)));
        page.push_str("\n| case | making | hidden (d') | said |\n|---|---|---|---|\n");
        scores.iter().filter(|score| !score.is_right()).for_each(|score| {
            page.push_str(&case(score));
        });
        page
    }
}

fn measure(row: &MeasureRow) -> String {
    let MeasureRow { measure, value, by_making, worst, goal, reached } = row;
    let reached = match reached {
        Some(true) => "reached",
        Some(false) => "**not reached**",
        None if goal.is_none() => "-",
        None => "not measured",
    };
    let by_making: Vec<_> = by_making.values().map(String::as_str).collect();
    let by_making = by_making.join(" | ");
    let worst = worst.map_or("-", Making::name);
    let goal = goal.as_deref().unwrap_or("-");
    format!("| {measure} | {value} | {by_making} | {worst} | {goal} | {reached} |\n")
}

fn count(rate: Rate) -> String {
    format!("{} of {}", rate.hits, rate.of)
}

fn of_strength(row: &StrengthRow) -> String {
    let [detected, family, first] = [row.detected, row.family_first, row.first].map(count);
    format!("| {} | {detected} | {family} | {first} |\n", row.class())
}

fn of_kind(row: &KindRow) -> String {
    let length = row.detectability.map_or("-".to_owned(), |length| format!("{length:.1}"));
    let KindRow { physics, detected, first, placed, concealed, content, .. } = row;
    let [detected, first, placed, concealed, content] =
        [*detected, *first, *placed, *concealed, *content].map(count);
    format!(
        "| `{physics}` | {detected} | {first} | {placed} | {length} | {concealed} | {content} |\n"
    )
}

fn case(score: &CaseScore) -> String {
    let mut hidden = String::new();
    for named in &score.hidden {
        let length = named.detectability.map_or("-".to_owned(), |length| format!("{length:.1}"));
        write!(hidden, "`{}` ({length}) ", named.physics).expect("a string takes all");
    }
    let said = if score.accepted.is_empty() {
        score.verdict.name().to_owned()
    } else {
        format!("{}: {}", score.verdict.name(), score.accepted.join(", "))
    };
    let hidden = if hidden.is_empty() { "nothing".to_owned() } else { hidden };
    format!("| {} | {} | {} | {said} |\n", score.number, score.making.name(), hidden.trim_end())
}
