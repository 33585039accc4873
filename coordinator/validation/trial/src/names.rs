//! Names and probabilities of a diagnosis, compared with what is hidden.

use crate::class::Class;
use crate::known::kind;
use crate::place::is_placed;
use tracktwin_diagnosis::{Diagnosis, Hypothesis, UNKNOWN, Verdict};
use tracktwin_reference_simulator::Hidden;

/// Total probability of the set of names.
const SET: f64 = 0.9;

/// Probability above which a wrong member of a family is a wrong statement.
const CERTAIN: f64 = 0.9;

/// Whether a name is correct. For effects that the catalogue lacks, the correct name is "unknown".
pub(crate) fn is_it(hidden: &Hidden, physics: &str) -> bool {
    physics == kind(hidden).map_or(UNKNOWN, |kind| kind.physics)
}

/// Whether a hypothesis is of the family of the hidden effect. For effects that the catalogue lacks, the
/// correct name is "unknown".
pub(crate) fn is_family(hidden: &Hidden, hypothesis: &Hypothesis) -> bool {
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
pub(crate) fn is_member_wrong(
    left_out: &[Hidden],
    hypotheses: &[Hypothesis],
    spacing_m: f64,
) -> bool {
    hypotheses.iter().any(|hypothesis| {
        hypothesis.physics != UNKNOWN
            && hypothesis.probability > CERTAIN
            && !is_there(left_out, hypothesis, spacing_m)
    })
}

/// The smallest set of the most probable hypotheses with a total probability of 90 %.
pub(crate) fn set(hypotheses: &[Hypothesis]) -> &[Hypothesis] {
    let all: f64 = hypotheses.iter().map(|hypothesis| hypothesis.probability).sum();
    let mut held = 0.0;
    let enough = hypotheses.iter().position(|hypothesis| {
        held += hypothesis.probability;
        held >= SET * all
    });
    &hypotheses[..enough.map_or(hypotheses.len(), |last| last + 1)]
}

/// Every probability given, with whether it was so; that of nothing where nothing is said.
pub(crate) fn probabilities(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::hypothesis;
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
            probability,
            ..hypothesis(physics, Some([x_m; 2]))
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
