//! Results of effects that were hidden alone, by their strength.

use crate::measures::{LIKELY, SURE, alarmed, alone};
use crate::rate::Rate;
use crate::score::{CaseScore, Named};
use serde::{Deserialize, Serialize};

/// Limits between the classes of strength, as detectability `d'`.
const LIMITS: [f64; 4] = [3.0, LIKELY, SURE, 10.0];

/// The kind that the inspection finds in the passes. Its `d'`, which counts band levels, is not its strength there.
const IN_THE_PASSES: &str = "wheel_out_of_round";

/// Results of the effects of one class of strength, or of wheel orders, which have a row of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StrengthRow {
    /// The kind of the row, if it has only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub physics: Option<String>,
    /// The least detectability `d'` of the class. `None` for effects that the track model does not contain,
    /// whose `d'` is not known, and for a row of one kind.
    pub from: Option<f64>,
    /// The detectability `d'` where the next class begins. `None` for the last class.
    pub to: Option<f64>,
    /// Rate of alarms.
    pub detected: Rate,
    /// Rate of cases in which the first accepted hypothesis was of the family of the effect.
    pub family_first: Rate,
    /// Rate of cases in which the effect was the first accepted hypothesis.
    pub first: Rate,
}

/// One row per class of strength, weak effects first, and one of wheel orders.
pub(crate) fn strengths(scores: &[CaseScore]) -> Vec<StrengthRow> {
    let starts = std::iter::once(0.0).chain(LIMITS).map(Some);
    let ends = LIMITS.into_iter().map(Some).chain([None]);
    let classes = starts.zip(ends).chain([(None, None)]);
    let of_class = |(from, to): (Option<f64>, Option<f64>)| {
        let is_in = |named: &Named| match (from, named.detectability) {
            (Some(from), Some(value)) => value >= from && to.is_none_or(|to| value < to),
            (from, value) => from.is_none() && value.is_none(),
        };
        let row = row(scores, |named| named.physics != IN_THE_PASSES && is_in(named));
        StrengthRow { from, to, ..row }
    };
    let orders = row(scores, |named| named.physics == IN_THE_PASSES);
    let orders = StrengthRow { physics: Some(IN_THE_PASSES.to_owned()), ..orders };
    classes.map(of_class).chain([orders]).collect()
}

/// Results of some of the effects that were hidden alone.
fn row(scores: &[CaseScore], is_in: impl Fn(&Named) -> bool) -> StrengthRow {
    let of = || alone(scores).filter(|(_, named)| is_in(named));
    StrengthRow {
        physics: None,
        from: None,
        to: None,
        detected: Rate::of(of().map(|(score, _)| alarmed(score))),
        family_first: Rate::of(of().map(|(_, named)| named.family_first)),
        first: Rate::of(of().map(|(_, named)| named.first)),
    }
}

impl StrengthRow {
    /// The class as text.
    pub(crate) fn class(&self) -> String {
        if let Some(physics) = &self.physics {
            return format!("`{physics}` of any d', in the passes");
        }
        match (self.from, self.to) {
            (None, _) => "not in the track model".to_owned(),
            (Some(from), None) => format!("{from} and more"),
            (Some(from), Some(to)) => format!("{from} to {to}"),
        }
    }
}
