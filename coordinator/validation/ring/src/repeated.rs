//! Repeated laps and speeds (paper, section 5.4 and Figs. 22 and 24).

use crate::methods::{agreed, agreement};
use crate::statement::{Found, Statement, percent};
use crate::{Method, Study};
use tracktwin_parameters::Parameter;

/// Least share of sleepers and pairs of laps that agree: their intervals are of 90 %.
const LAPS_AGREE: f64 = 0.9;

/// The parameters of the paper's Fig. 24.
const SHOWN: [Parameter; 3] =
    [Parameter::IrregularityLevel, Parameter::RailpadStiffness, Parameter::BallastStiffness];

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    let mut all = Vec::new();
    for parameter in SHOWN {
        if study.laps.len() > 1 {
            all.push(Statement::of(
                ("Fig. 22", Method::Inversion),
                [
                    &format!("Laps agree about the {}", parameter.label()),
                    "repeated measurements agree",
                    "difference of two laps inside its 90 % interval at 90 % of the valid sleepers",
                ],
                laps(study, parameter),
            ));
        }
        all.extend(speeds(study, parameter));
    }
    all
}

fn laps(study: &Study, parameter: Parameter) -> Option<Found> {
    let laps = &study.laps;
    let pairs =
        (0..laps.len()).flat_map(|one| (one + 1..laps.len()).map(move |other| (one, other)));
    let counts = pairs.map(|(one, other)| agreed(study, [&laps[one], &laps[other]], parameter));
    let (yes, count) = counts.fold((0, 0), |all, it| (all.0 + it.0, all.1 + it.1));
    let share = yes as f64 / count as f64;
    let text = || format!("{} ({yes} of {count}, {} laps)", percent(share), laps.len());
    (count > 0).then(|| Found::new(share >= LAPS_AGREE, text()))
}

/// Every lower speed beside the highest one.
fn speeds(study: &Study, parameter: Parameter) -> Vec<Statement> {
    let Some(((fastest, by_fastest), slower)) = study.speeds.split_last() else {
        return Vec::new();
    };
    let compared = slower.iter().map(|(speed, by_speed)| {
        Statement::of(
            ("Fig. 24", Method::Inversion),
            [
                &format!("{speed} and {fastest} km/h agree about the {}", parameter.label()),
                "13 and 10 km/h agree; at 7 km/h stiffnesses deviate in places",
                "difference inside its 90 % interval at 80 % of the valid sleepers",
            ],
            agreement(study, [by_speed, by_fastest], parameter),
        )
    });
    compared.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn laps_and_speeds_are_compared_pair_by_pair() {
        let mut study = study();
        assert!(statements(&study).is_empty());
        let [same, other] =
            [1.0, 1.5].map(|factor| estimated(&study, |_, _, truth| (factor * truth, 0.1 * truth)));
        study.laps = vec![same.clone(), same.clone(), other.clone()];
        study.speeds = vec![(7.0, other), (10.0, same.clone()), (13.0, same)];
        let all = statements(&study);
        let verdicts: Vec<_> = all[..3].iter().map(|it| it.verdict).collect();
        let (yes, no) = (ClaimVerdict::Reproduced, ClaimVerdict::Differs);
        // Of three pairs of laps one agrees.
        assert_eq!((verdicts, all.len()), (vec![no, no, yes], 9));
        assert!(all[0].found.starts_with("33 % (100 of 300, 3 laps)"), "{}", all[0].found);
    }
}
