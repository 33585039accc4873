//! Repeated laps and speeds (paper, section 5.4 and Figs. 22 and 24).

use crate::methods::{Tally, agreement};
use crate::parameters::OWN;
use crate::statement::{Found, Statement, each, sure};
use crate::{Method, Study};
use tracktwin_parameters::Parameter;

/// Least share of sleepers and pairs of laps that agree: their intervals are of 90 %.
const LAPS_AGREE: f64 = 0.9;

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    let mut all = Vec::new();
    if study.laps.len() > 1 {
        all.extend(each(
            ("Fig. 22", Method::Inversion),
            &OWN,
            |label| format!("Laps agree about the {label}"),
            [
                "repeated measurements agree",
                &sure(
                    "difference of two laps inside its 90 % interval at 90 % of the valid sleepers",
                ),
            ],
            |parameter| laps(study, parameter),
        ));
    }
    // Every lower speed beside the highest one.
    let Some(((fastest, by_fastest), slower)) = study.speeds.split_last() else { return all };
    for (speed, by_speed) in slower {
        all.extend(each(
            ("Fig. 24", Method::Inversion),
            &OWN,
            |label| format!("{speed} and {fastest} km/h agree about the {label}"),
            [
                "13 and 10 km/h agree; at 7 km/h stiffnesses deviate in places",
                &sure("difference inside its 90 % interval at 80 % of the valid sleepers"),
            ],
            |parameter| agreement(study, [by_speed, by_fastest], parameter),
        ));
    }
    all
}

fn laps(study: &Study, parameter: Parameter) -> Option<Found> {
    let laps = &study.laps;
    let mut agreed = Tally::default();
    for (index, one) in laps.iter().enumerate() {
        for other in &laps[index + 1..] {
            agreed.add(study, [one, other], parameter);
        }
    }
    agreed.found(LAPS_AGREE, &format!(", {} laps", laps.len()))
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
        // Of each parameter: laps, 7 km/h, 10 km/h.
        let verdicts: Vec<_> = all.iter().step_by(3).map(|it| it.verdict).collect();
        let (yes, no) = (ClaimVerdict::Reproduced, ClaimVerdict::Differs);
        // Of three pairs of laps one agrees.
        assert_eq!((verdicts, all.len()), (vec![no, no, yes], 9));
        assert!(all[0].found.starts_with("33 % (100 of 300, 3 laps)"), "{}", all[0].found);
    }
}
