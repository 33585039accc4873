//! Score of one diagnosis: comparison with the truth.

use crate::baseline::{Bias, bias, cells_inside, parameters_inside};
use crate::class::Class;
use crate::draw::Plan;
use crate::making::Making;
use crate::names::{is_family, is_it, is_member_wrong, probabilities, set};
use crate::paper::Paper;
use crate::place::{local, local_location};
use serde::{Deserialize, Serialize};
use tracktwin_diagnosis::{Diagnosis, Hypothesis, UNKNOWN, Verdict};
use tracktwin_reference_simulator::{Hidden, Scene};

/// Score of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseScore {
    /// Number of the case.
    pub number: u32,
    /// Class of the case.
    pub class: Class,
    /// Making of the case.
    pub making: Making,
    /// Result of the diagnosis.
    pub verdict: Verdict,
    /// Kinds of the accepted hypotheses.
    pub accepted: Vec<String>,
    /// Results of the hidden effects.
    pub hidden: Vec<Named>,
    /// Each stated probability, and whether the statement is true.
    pub probabilities: Vec<(f64, bool)>,
    /// Whether the diagnosis gave a kind of the catalogue more than 90 % at a place where this kind is
    /// not hidden.
    pub wrong_member: bool,
    /// Held-out gain in nats. `None` if no hypothesis was accepted.
    pub held_out_gain_nats: Option<f64>,
    /// Errors of the stiffnesses next to the effect. `None` if nothing was hidden.
    pub bias: Option<Bias>,
    /// Whether the stiffnesses of the fitted baseline are inside the usual ranges of the track: of V-Track,
    /// Table D1.
    pub parameters_inside: bool,
    /// Whether no cell of the residual of the fitted baseline is far beyond the random variation.
    pub cells_inside: bool,
    /// CPU time of the diagnosis in s.
    pub cpu_s: f64,
    /// Result without the hidden kind in the catalogue, if tested.
    pub knocked_out: Option<KnockedOut>,
    /// Result with its sleepers shuffled, if tested.
    #[serde(default)]
    pub shuffled: Option<Verdict>,
    /// Result of the paper's method, if tested.
    #[serde(default)]
    pub paper: Option<Paper>,
}

/// Result of a knock-out: a diagnosis without the hidden kind in the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnockedOut {
    /// The verdict.
    pub verdict: Verdict,
    /// Whether the verdict was "unknown", which is correct.
    pub unknown: bool,
    /// Accuracy of the place of the effect. `None` if the effect has no place.
    pub place: Option<Placed>,
}

/// Result of a hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is an answer to a question of its own")]
pub struct Named {
    /// Kind of the effect.
    pub physics: String,
    /// Detectability `d'` of the effect after the baseline was fitted again. `None` if the track model
    /// does not contain the effect; earlier programs also wrote 0 in this way.
    pub detectability: Option<f64>,
    /// Whether the effect is the first accepted hypothesis.
    pub first: bool,
    /// Whether the first accepted hypothesis is of the family of the effect. For effects that the
    /// catalogue lacks, the correct name is `unknown_physics`.
    pub family_first: bool,
    /// Whether the effect is in the smallest set of hypotheses with a total probability of 90 %.
    pub in_set: bool,
    /// Whether the effect was accepted, at any rank.
    pub accepted: bool,
    /// Accuracy of the place of the effect. `None` if the effect has no place.
    pub place: Option<Placed>,
}

/// Accuracy of the place of a local effect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placed {
    /// Distance to the nearest accepted place in sleeper spacings. `None` if no place of at most three spacings
    /// was accepted.
    pub error_spacings: Option<f64>,
}

impl Placed {
    /// Whether the error is at most one sleeper spacing.
    pub fn within_a_sleeper(self) -> bool {
        self.error_spacings.is_some_and(|error| error <= 1.0)
    }
}

impl CaseScore {
    /// Whether the knock-out test applies: a single hidden effect, detected and accepted.
    pub fn can_be_knocked_out(&self) -> bool {
        self.class == Class::Single && self.hidden.iter().all(|named| named.accepted)
    }

    /// Whether the shuffle test applies: a single local effect, detected.
    pub fn can_be_shuffled(&self) -> bool {
        self.class == Class::Single
            && self.verdict != Verdict::Consistent
            && self.hidden.iter().all(|named| named.place.is_some())
    }

    /// Whether the diagnosis is completely correct: the accepted hypotheses are the hidden effects, those of local
    /// effects within a sleeper spacing, a fault of the measuring chain is called one, and a control is consistent.
    pub fn is_right(&self) -> bool {
        let is_right =
            |named: &Named| named.accepted && named.place.is_none_or(Placed::within_a_sleeper);
        let are_right =
            self.accepted.len() == self.hidden.len() && self.hidden.iter().all(is_right);
        match self.class {
            Class::Control => self.verdict == Verdict::Consistent,
            Class::Artefact => self.verdict == Verdict::MeasurementChain && are_right,
            Class::Single | Class::Double | Class::Unknown => are_right,
        }
    }

    /// Whether the first accepted hypothesis is a hidden effect. `None` if none was accepted, or if it is "unknown"
    /// where the catalogue has the effect.
    pub(crate) fn is_first_name_right(&self) -> Option<bool> {
        let is_right = self.hidden.iter().any(|named| named.first);
        (is_right || self.accepted.first()? != UNKNOWN).then_some(is_right)
    }
}

/// Scores a diagnosis. `detectability` has a value for each hidden effect.
pub fn score(
    plan: &Plan,
    diagnosis: &Diagnosis,
    detectability: &[Option<f64>],
    cpu_s: f64,
) -> CaseScore {
    let accepted: Vec<&Hypothesis> = diagnosis.hypotheses.iter().filter(|h| h.accepted).collect();
    let left_out = &plan.scene.left_out;
    let spacing_m = plan.scene.spacing_m();
    let named = left_out.iter().zip(detectability);
    let gains = diagnosis.fit.held_out_gain_nats.values();
    CaseScore {
        number: plan.number,
        class: plan.class,
        making: plan.making,
        verdict: diagnosis.verdict,
        accepted: accepted.iter().map(|hypothesis| hypothesis.physics.clone()).collect(),
        hidden: named
            .map(|(hidden, &d)| becomes(hidden, d, diagnosis, &accepted, spacing_m))
            .collect(),
        probabilities: probabilities(plan.class, left_out, diagnosis, spacing_m),
        wrong_member: is_member_wrong(left_out, &diagnosis.hypotheses, spacing_m),
        held_out_gain_nats: (gains.len() > 0).then(|| gains.sum()),
        bias: bias(&plan.scene, diagnosis),
        parameters_inside: parameters_inside(plan.scene.preset, diagnosis),
        cells_inside: cells_inside(diagnosis),
        cpu_s,
        knocked_out: None,
        shuffled: None,
        paper: None,
    }
}

/// Accuracy with which a diagnosis places the first hidden effect that has a place.
pub fn placed(scene: &Scene, diagnosis: &Diagnosis) -> Option<Placed> {
    let spacing_m = scene.spacing_m();
    let place = scene.left_out.iter().find_map(|hidden| local(hidden, spacing_m))?;
    let accepted = diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    Some(Placed { error_spacings: nearest(place, accepted, spacing_m) })
}

/// Distance in sleeper spacings from the middle of a place to the nearest of the local ones of these.
fn nearest<'h>(
    place: [f64; 2],
    hypotheses: impl IntoIterator<Item = &'h Hypothesis>,
    spacing_m: f64,
) -> Option<f64> {
    let middle = |[from_m, to_m]: [f64; 2]| 0.5 * (from_m + to_m);
    let error = |hypothesis: &Hypothesis| {
        let said = local_location(hypothesis, spacing_m)?;
        Some((middle(said) - middle(place)).abs() / spacing_m)
    };
    hypotheses.into_iter().filter_map(error).min_by(f64::total_cmp)
}

fn becomes(
    hidden: &Hidden,
    detectability: Option<f64>,
    diagnosis: &Diagnosis,
    accepted: &[&Hypothesis],
    spacing_m: f64,
) -> Named {
    let is_it = |hypothesis: &Hypothesis| is_it(hidden, &hypothesis.physics);
    let nearest = |place| nearest(place, accepted.iter().copied(), spacing_m);
    let place = local(hidden, spacing_m).map(|place| Placed { error_spacings: nearest(place) });
    Named {
        physics: hidden.physics().to_owned(),
        detectability,
        first: accepted.first().is_some_and(|first| is_it(first)),
        family_first: accepted.first().is_some_and(|first| is_family(hidden, first)),
        in_set: set(&diagnosis.hypotheses).iter().any(is_it),
        accepted: accepted.iter().any(|hypothesis| is_it(hypothesis)),
        place,
    }
}

#[cfg(test)]
mod tests;
