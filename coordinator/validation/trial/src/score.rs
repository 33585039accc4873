//! Score of one diagnosis: comparison with the truth.

use crate::class::Class;
use crate::draw::Plan;
use crate::known::{is_artefact, kind};
use crate::making::Making;
use crate::paper::Paper;
use crate::place::{is_placed, local, near};
use serde::{Deserialize, Serialize};
use tracktwin_diagnosis::{Diagnosis, Hypothesis, UNKNOWN, Verdict};
use tracktwin_parameters::{Parameter, Preset};
use tracktwin_reference_simulator::{Hidden, Scene};

/// Total probability of the set of names.
const SET: f64 = 0.9;

/// Probability above which a wrong member of a family is a wrong statement.
const CERTAIN: f64 = 0.9;

/// Deviations of the null simulations above which a cell is visibly anomalous.
const CELL_DEVIATIONS: f64 = 3.5;

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
    /// does not contain the effect.
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
    /// Distance to the nearest accepted place in sleeper spacings. `None` if no place was accepted.
    pub error_spacings: Option<f64>,
}

impl Placed {
    /// Whether the error is at most one sleeper spacing.
    pub fn within_a_sleeper(self) -> bool {
        self.error_spacings.is_some_and(|error| error <= 1.0)
    }
}

/// Mean absolute error of the logarithms of railpad and ballast stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bias {
    /// Error of the fitted baseline.
    pub before: f64,
    /// Error with the accepted hypotheses in the model.
    pub after: f64,
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

    /// Whether the diagnosis is completely correct: the accepted hypotheses are the hidden effects, no
    /// fault of the measuring chain is called physics, and no hypothesis is accepted for a control.
    pub fn is_right(&self) -> bool {
        match self.class {
            Class::Control => self.verdict == Verdict::Consistent,
            Class::Artefact => {
                matches!(self.verdict, Verdict::Consistent | Verdict::MeasurementChain)
            }
            Class::Single | Class::Double | Class::Unknown => {
                self.accepted.len() == self.hidden.len()
                    && self.hidden.iter().all(|named| named.accepted)
            }
        }
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

/// Distance in sleeper spacings from the middle of a place to the nearest of these.
fn nearest<'h>(
    place: [f64; 2],
    hypotheses: impl IntoIterator<Item = &'h Hypothesis>,
    spacing_m: f64,
) -> Option<f64> {
    let middle = |[from_m, to_m]: [f64; 2]| 0.5 * (from_m + to_m);
    let error = |hypothesis: &Hypothesis| {
        let said = hypothesis.location.as_ref()?.x_m;
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

/// Whether a name is correct. For effects that the catalogue lacks, the correct name is "unknown".
fn is_it(hidden: &Hidden, physics: &str) -> bool {
    physics == kind(hidden).map_or(UNKNOWN, |kind| kind.physics)
}

/// Whether a hypothesis is of the family of the hidden effect. For effects that the catalogue lacks, the
/// correct name is "unknown".
fn is_family(hidden: &Hidden, hypothesis: &Hypothesis) -> bool {
    match kind(hidden) {
        Some(kind) => hypothesis.family.as_deref() == Some(kind.family.name()),
        None => hypothesis.physics == UNKNOWN,
    }
}

/// Whether a hidden effect has the name and place of the hypothesis.
fn is_there(left_out: &[Hidden], hypothesis: &Hypothesis, spacing_m: f64) -> bool {
    let is_so = |hidden: &Hidden| {
        is_it(hidden, &hypothesis.physics) && is_placed(hidden, hypothesis, spacing_m)
    };
    left_out.iter().any(is_so)
}

/// Whether a kind has more than 90 % probability at a place where this kind is not hidden.
fn is_member_wrong(left_out: &[Hidden], hypotheses: &[Hypothesis], spacing_m: f64) -> bool {
    hypotheses.iter().any(|hypothesis| {
        hypothesis.physics != UNKNOWN
            && hypothesis.probability > CERTAIN
            && !is_there(left_out, hypothesis, spacing_m)
    })
}

/// The smallest set of the most probable hypotheses with a total probability of 90 %.
fn set(hypotheses: &[Hypothesis]) -> &[Hypothesis] {
    let all: f64 = hypotheses.iter().map(|hypothesis| hypothesis.probability).sum();
    let mut held = 0.0;
    let enough = hypotheses.iter().position(|hypothesis| {
        held += hypothesis.probability;
        held >= SET * all
    });
    &hypotheses[..enough.map_or(hypotheses.len(), |last| last + 1)]
}

/// Every probability given, with whether it was so; that of nothing where nothing is said.
fn probabilities(
    class: Class,
    left_out: &[Hidden],
    diagnosis: &Diagnosis,
    spacing_m: f64,
) -> Vec<(f64, bool)> {
    let given = diagnosis.hypotheses.iter();
    let is_there = |hypothesis| is_there(left_out, hypothesis, spacing_m);
    let mut all: Vec<_> =
        given.map(|hypothesis| (hypothesis.probability, is_there(hypothesis))).collect();
    if diagnosis.verdict == Verdict::Consistent {
        all.push((diagnosis.nothing_left_out.unwrap_or(1.0), class == Class::Control));
    }
    all
}

/// Errors at the sleepers next to hidden effects. All sleepers count if an effect acts everywhere.
fn bias(scene: &Scene, diagnosis: &Diagnosis) -> Option<Bias> {
    if scene.left_out.iter().all(is_artefact) {
        return None;
    }
    let spacing_m = scene.spacing_m();
    let (mut before, mut after, mut count) = (0.0, 0.0, 0.0);
    for sleeper in diagnosis.track.iter().filter(|sleeper| near(scene, sleeper.x_m)) {
        let number = (sleeper.x_m / spacing_m).round() as usize;
        let Some(truth) = number.checked_sub(1).and_then(|n| scene.sleepers.get(n)) else {
            continue;
        };
        let error = |value: f64, truth: f64| (value / truth).ln().abs();
        let (railpad, ballast) = (&sleeper.railpad_stiffness, &sleeper.ballast_stiffness);
        before += error(railpad.before.mean, truth.railpad_stiffness_n_m)
            + error(ballast.before.mean, truth.ballast_stiffness_n_m);
        after += error(railpad.after.mean, truth.railpad_stiffness_n_m)
            + error(ballast.after.mean, truth.ballast_stiffness_n_m);
        count += 2.0;
    }
    (count > 0.0).then(|| Bias { before: before / count, after: after / count })
}

/// Whether the baseline of every sleeper lies inside the usual ranges of the track: of V-Track, Table D1 of
/// the paper.
fn parameters_inside(preset: Preset, diagnosis: &Diagnosis) -> bool {
    let track = preset.track();
    let inside = |parameter: Parameter, value: f64| {
        let [low, high] = track.ranges[parameter.index()];
        (low..=high).contains(&value)
    };
    diagnosis.track.iter().all(|sleeper| {
        inside(Parameter::RailpadStiffness, sleeper.railpad_stiffness.before.mean)
            && inside(Parameter::BallastStiffness, sleeper.ballast_stiffness.before.mean)
    })
}

fn cells_inside(diagnosis: &Diagnosis) -> bool {
    let levels = &diagnosis.levels;
    let speeds = levels.measured_db.iter().zip(&levels.before_db).zip(&levels.scatter_db);
    speeds.into_iter().all(|((measured, before), scatter)| {
        measured.iter().zip(before).all(|(measured, before)| {
            let cells = measured.iter().zip(before).zip(scatter);
            let is_inside = |m: f64, b: f64, sd: f64| (m - b).abs() <= CELL_DEVIATIONS * sd;
            cells.into_iter().all(|((m, b), sd)| sd.is_none_or(|sd| is_inside(*m, *b, sd)))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::testing::hypothesis;
    use tracktwin_track::extension::Kind;

    #[test]
    fn another_member_of_the_family_is_wrong_only_where_it_is_certain() {
        let joint = [Hidden::RailJoint {
            x_m: [2.5, 2.5],
            dip_m: 1e-4,
            length_m: 0.02,
            bending_factor: 0.3,
            bending_length_m: 0.025,
        }];
        let said = |physics: &str, probability: f64, x_m: f64| Hypothesis {
            physics: physics.to_owned(),
            probability,
            ..hypothesis(Some(x_m))
        };
        let wrong = |it: Hypothesis| is_member_wrong(&joint, &[it], 0.125);
        assert!(wrong(said("squat", 0.95, 2.5)) && !wrong(said("squat", 0.85, 2.5)));
        assert!(wrong(said("rail_joint", 0.95, 1.0)) && !wrong(said("rail_joint", 0.95, 2.5)));
        assert!(!wrong(said(UNKNOWN, 0.95, 2.5)));
        let of = |physics: &str| {
            let family = Kind::from_name(physics).unwrap().family.name().to_owned();
            Hypothesis { family: Some(family), ..said(physics, 0.95, 2.5) }
        };
        assert!(is_family(&joint[0], &of("rail_cross_section")));
        assert!(!is_family(&joint[0], &of("squat")));
        let absorber = Hidden::RailAbsorber {
            x_m: [2.5, 2.5],
            mass_kg: 1.0,
            frequency_hz: 900.0,
            damping_ratio: 0.05,
        };
        assert!(!is_family(&absorber, &said("squat", 0.95, 2.5)));
        assert!(is_family(&absorber, &said(UNKNOWN, 0.95, 2.5)));
    }
}
