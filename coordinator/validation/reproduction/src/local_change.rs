//! Fig. 19: stiffness reduced at one, three and five sleepers.

use crate::agreement::picture;
use crate::average::{Average, DEVIATIONS};
use crate::example::REDUCED;
use crate::{ClaimVerdict, Compared, EvaluatedExample, Figure};
use tracktwin_parameters::Parameter::{self, BallastStiffness, RailpadStiffness};

/// What the extracted text of the paper leaves open.
const TAKEN: &str = "the text does not say from which set to which; A2 to A3 was taken";

/// Largest error of a recovered reduction, as a share of the true one.
const RECOVERED: f64 = 0.2;

/// Comparison of the three reductions with the paper's Fig. 19, and the same by inversion.
pub(crate) fn local_change(told: &[EvaluatedExample]) -> Compared {
    let caption = "Truth and estimates where railpads and ballast are reduced from parameter set \
                   A2 to A3 at sleeper 4, at 4 to 6 and at 5 to 9.";
    let mut compared = Compared::new(Figure::Fig19, caption);
    for parameter in [RailpadStiffness, BallastStiffness] {
        one(&mut compared, told, parameter);
    }
    for parameter in [RailpadStiffness, BallastStiffness] {
        closer(&mut compared, told, parameter);
    }
    let inverted: Option<Vec<_>> = told.iter().map(EvaluatedExample::by_inversion).collect();
    let inverted = inverted.unwrap_or_default();
    if !inverted.is_empty() {
        for parameter in [RailpadStiffness, BallastStiffness] {
            recovered(&mut compared, &inverted, parameter);
        }
    }
    for parameter in [RailpadStiffness, BallastStiffness] {
        compared.pictures.extend(told.iter().map(|of| picture(of, parameter)));
        compared.pictures.extend(inverted.iter().map(|of| {
            let mut picture = picture(of, parameter);
            picture.title.push_str(", by inversion");
            picture
        }));
    }
    compared
}

/// A single reduced sleeper is compared with those at least two away.
fn one(compared: &mut Compared, told: &[EvaluatedExample], parameter: Parameter) {
    let Some(single) = told.first() else { return };
    let at = Average::of_estimates(&single.estimates(REDUCED[0].clone(), parameter));
    let others = single.estimates([1, 2, 6, 7, 8, 9], parameter);
    let dip = Average::of_estimates(&others).less(at).times(1e-6);
    let true_dip = 1e-6 * (single.truth(1, parameter) - single.truth(4, parameter));
    compared.row(
        format!(
            "{} is told lower where one sleeper is reduced, with a larger error",
            parameter.symbol()
        ),
        [
            "a local reduction".to_owned(),
            format!("lower by {:.1} ± {:.1} MN/m, the truth by {true_dip:.0}", dip.mean, dip.error),
        ],
        dip.is_positive(),
        format!(
            "sleeper 4 against 1, 2 and 6 to 9, beyond two standard deviations; sleepers share their \
             error, so that of a mean is the standard deviation of one sleeper; {TAKEN}"
        ),
    );
}

/// Share of the true reduction that is missing at the reduced sleepers.
fn missing(
    told: &EvaluatedExample,
    reduced: std::ops::RangeInclusive<usize>,
    parameter: Parameter,
) -> Average {
    let truth = told.truth(*reduced.start(), parameter);
    let whole = if *reduced.start() > 1 { told.truth(1, parameter) - truth } else { f64::NAN };
    let mean = Average::of_estimates(&told.estimates(reduced, parameter));
    mean.plus(-truth).times(1.0 / whole)
}

fn closer(compared: &mut Compared, told: &[EvaluatedExample], parameter: Parameter) {
    let shares: Vec<Average> =
        told.iter().zip(REDUCED).map(|(of, reduced)| missing(of, reduced, parameter)).collect();
    let [first, .., last] = &shares[..] else { return };
    let size = |share: &Average| Average { mean: share.mean.abs(), ..*share };
    let ours = shares.iter().map(|of| format!("{:.0} ± {:.0}", 100.0 * of.mean, 100.0 * of.error));
    compared.row(
        format!("{} is told better the more sleepers are reduced", parameter.symbol()),
        [
            "1, 3, 5 sleepers: ever more accurate".to_owned(),
            format!("{} % of the reduction missing", ours.collect::<Vec<_>>().join(", ")),
        ],
        size(first).less(size(last)).is_positive(),
        format!(
            "error with one sleeper against that with five, beyond two standard deviations; sleepers \
             share their error; {TAKEN}"
        ),
    );
}

/// Share of the true reduction that the inversion finds at the reduced sleepers, a check of this program.
fn recovered(compared: &mut Compared, inverted: &[EvaluatedExample], parameter: Parameter) {
    let shares: Vec<Average> = inverted
        .iter()
        .zip(REDUCED)
        .map(|(of, reduced)| missing(of, reduced, parameter))
        .map(|missing| Average { mean: 1.0 - missing.mean, ..missing })
        .collect();
    let is_found = |share: &Average| (share.mean - 1.0).abs() <= RECOVERED;
    let can_be = |share: &Average| (share.mean - 1.0).abs() <= RECOVERED + DEVIATIONS * share.error;
    let verdict = if shares.iter().all(is_found) {
        ClaimVerdict::Reproduced
    } else if shares.iter().all(can_be) {
        ClaimVerdict::CannotTell
    } else {
        ClaimVerdict::Differs
    };
    let ours = shares.iter().map(|of| format!("{:.0} ± {:.0}", 100.0 * of.mean, 100.0 * of.error));
    compared.check(
        format!(
            "{} by inversion: the true reduction is found at the reduced sleepers",
            parameter.symbol()
        ),
        [
            "100 % (truth)".to_owned(),
            format!("{} % of the reduction", ours.collect::<Vec<_>>().join(", ")),
        ],
        verdict,
        format!(
            "1, 3 and 5 sleepers, each within {:.0} % of the true reduction. A comparison with the \
             truth, not with the paper, whose estimates spread the reduction over the neighbours \
             (section 4.3.2); {TAKEN}",
            100.0 * RECOVERED
        ),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict::{CannotTell, Differs, Fails, Holds, Reproduced};
    use crate::testing::{told, verdicts};

    fn smoothed(share: f64, sd: f64) -> Vec<EvaluatedExample> {
        told(Figure::Fig19, sd, |example, at, parameter| {
            let truth = |at: usize| example.sleepers[at.clamp(1, 9) - 1][parameter];
            (1.0 - 2.0 * share) * truth(at) + share * (truth(at - 1) + truth(at + 1))
        })
    }

    #[test]
    fn averages_over_neighbours_come_closer_with_every_sleeper() {
        let compared = local_change(&smoothed(0.25, 0.01));
        assert_eq!(verdicts(&compared), [Reproduced; 4]);
        assert!(compared.rows[2].ours.starts_with("50 "), "{}", compared.rows[2].ours);
    }

    #[test]
    fn a_reduction_that_the_inversion_finds_has_rows_and_pictures_of_its_own() {
        let inverted = |share: f64| {
            let mut told = smoothed(0.25, 0.01);
            for (of, exact) in told.iter_mut().zip(smoothed(share, 0.01)) {
                of.inverted = Some(exact.sleepers);
            }
            local_change(&told)
        };
        let found = inverted(0.0);
        assert_eq!(verdicts(&found), [[Reproduced; 4].as_slice(), &[Holds; 2]].concat());
        assert!(found.rows[4].ours.starts_with("100 "), "{}", found.rows[4].ours);
        assert_eq!(found.pictures.len(), 12);
        assert_eq!(verdicts(&inverted(0.25))[4..], [Fails; 2]);
    }

    #[test]
    fn a_reduction_that_is_not_heard_differs_and_unsure_estimates_cannot_tell() {
        let mut upside_down = smoothed(0.25, 0.01);
        for (parameter, estimate) in &mut upside_down[0].sleepers[3] {
            estimate.mean = 1.5 * upside_down_truth(*parameter);
        }
        assert_eq!(verdicts(&local_change(&upside_down))[..2], [Differs, Differs]);
        assert_eq!(verdicts(&local_change(&smoothed(0.25, 0.9))), [CannotTell; 4]);
    }

    fn upside_down_truth(parameter: Parameter) -> f64 {
        crate::examples(Figure::Fig19)[0].sleepers[0][parameter]
    }
}
