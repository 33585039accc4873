//! Results of effects that were hidden alone, by their strength.

use crate::measures::{LIKELY, SURE, alarmed, alone};
use crate::rate::Rate;
use crate::score::CaseScore;
use serde::{Deserialize, Serialize};

/// Limits between the classes of strength, as detectability `d'`.
const LIMITS: [f64; 4] = [3.0, LIKELY, SURE, 10.0];

/// Results of the effects of one class of strength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StrengthRow {
    /// The least detectability `d'` of the class. `None` for effects that the track model does not contain;
    /// their `d'` is not known.
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

/// One row per class of strength, weak effects first.
pub(crate) fn strengths(scores: &[CaseScore]) -> Vec<StrengthRow> {
    let starts = std::iter::once(0.0).chain(LIMITS).map(Some);
    let ends = LIMITS.into_iter().map(Some).chain([None]);
    starts.zip(ends).chain([(None, None)]).map(|(from, to)| row(scores, from, to)).collect()
}

fn row(scores: &[CaseScore], from: Option<f64>, to: Option<f64>) -> StrengthRow {
    let is_in = |detectability: Option<f64>| match (from, detectability) {
        (Some(from), Some(value)) => value >= from && to.is_none_or(|to| value < to),
        (from, value) => from.is_none() && value.is_none(),
    };
    let of = || alone(scores).filter(|(_, named)| is_in(named.detectability));
    StrengthRow {
        from,
        to,
        detected: Rate::of(of().map(|(score, _)| alarmed(score))),
        family_first: Rate::of(of().map(|(_, named)| named.family_first)),
        first: Rate::of(of().map(|(_, named)| named.first)),
    }
}

impl StrengthRow {
    /// The class as text.
    pub(crate) fn class(&self) -> String {
        match (self.from, self.to) {
            (None, _) => "not in the track model".to_owned(),
            (Some(from), None) => format!("{from} and more"),
            (Some(from), Some(to)) => format!("{from} to {to}"),
        }
    }
}
