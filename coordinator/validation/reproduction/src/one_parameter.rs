//! Fig. 17 and 18: one parameter differs between examples, the others are equal.

use crate::agreement::{Agreement, picture};
use crate::average::{Average, all};
use crate::example::{SLEEPERS, smallest_step};
use crate::{Compared, EvaluatedExample, Figure};
use tracktwin_parameters::Parameter::{
    self, BallastStiffness, IrregularityLevel, RailpadStiffness, SleeperBendingStiffness,
};

/// Stiffness that is the same in all examples.
const SAME: [Parameter; 2] = [RailpadStiffness, BallastStiffness];

/// Sleepers inside the fine mesh and inside the coarse one.
const FINE: std::ops::RangeInclusive<usize> = 1..=4;
const COARSE: std::ops::RangeInclusive<usize> = 6..=9;

/// Comparison of three levels of irregularity with the paper's Fig. 17.
pub(crate) fn irregularity(told: &[EvaluatedExample]) -> Compared {
    let caption = "Truth and estimates at irregularity levels 2, 3 and 4; parameter set A2.";
    let mut compared = one_parameter(Figure::Fig17, caption, told, IrregularityLevel);
    for parameter in SAME {
        mesh(&mut compared, told, parameter);
    }
    compared
}

/// Comparison of three bending stiffnesses of the sleepers with the paper's Fig. 18.
pub(crate) fn bending_stiffness(told: &[EvaluatedExample]) -> Compared {
    let caption = "Truth and estimates at three bending stiffnesses of the sleepers, 4000, 5000 \
                   and 6000 N m²; parameter set A2.";
    let mut compared = one_parameter(Figure::Fig18, caption, told, SleeperBendingStiffness);
    for row in &mut compared.rows {
        row.why.push_str("; the paper's bending stiffnesses stand in its picture only, 4000, 5000 and 6000 N m2 were taken");
    }
    compared
}

fn one_parameter(
    figure: Figure,
    caption: &str,
    told: &[EvaluatedExample],
    changed: Parameter,
) -> Compared {
    let mut compared = Compared::new(figure, caption);
    let sleepers: Vec<usize> = (1..=SLEEPERS).collect();
    let symbol = changed.symbol();
    let correct = format!("{symbol} is told correctly");
    Agreement::new(told, &sleepers, changed).row(&mut compared, correct, "correctly evaluated");
    apart(&mut compared, told, changed);
    for parameter in SAME {
        let claim = format!("{} is told correctly whatever {symbol} is", parameter.symbol());
        Agreement::new(told, &sleepers, parameter).row(&mut compared, claim, "correctly evaluated");
    }
    for parameter in SAME {
        unbiased(&mut compared, told, parameter, changed);
    }
    for parameter in [changed, RailpadStiffness, BallastStiffness] {
        compared.pictures.extend(told.iter().map(|of| picture(of, parameter)));
    }
    compared
}

fn mean(of: &EvaluatedExample, parameter: Parameter) -> Average {
    Average::of_estimates(&of.estimates(1..=SLEEPERS, parameter))
}

fn apart(compared: &mut Compared, told: &[EvaluatedExample], changed: Parameter) {
    let means: Vec<Average> = told.iter().map(|of| mean(of, changed)).collect();
    let steps = means.windows(2).map(|pair| pair[1].less(pair[0]).is_positive());
    let decimals = if means.iter().any(|of| of.mean > 100.0) { 0 } else { 2 };
    let ours = means.iter().zip(told).map(|(of, told)| {
        let truth = told.truth(1, changed);
        format!("{:.decimals$} ± {:.decimals$} for {truth}", of.mean, of.error)
    });
    compared.row(
        format!("Three values of {} are told apart", changed.symbol()),
        ["correctly evaluated".to_owned(), ours.collect::<Vec<_>>().join(", ")],
        all(steps),
        "means over the nine sleepers rise by more than two standard deviations; the sleepers of an \
         example share their error, so that of the mean is the standard deviation of one sleeper",
    );
}

fn unbiased(
    compared: &mut Compared,
    told: &[EvaluatedExample],
    parameter: Parameter,
    changed: Parameter,
) {
    let (Some(first), Some(last)) = (told.first(), told.last()) else { return };
    let shift = mean(last, parameter).less(mean(first, parameter)).times(1e-6);
    compared.row(
        format!("{} does not bias {}", changed.symbol(), parameter.symbol()),
        [
            "robust".to_owned(),
            format!("{:+.2} ± {:.2} MN/m from lowest to highest", shift.mean, shift.error),
        ],
        shift.is_nothing(1e-6 * smallest_step(parameter)),
        "mean over the nine sleepers, which share their error; within two standard deviations, which \
         must be less than the smallest step of Table 4.1",
    );
}

fn mesh(compared: &mut Compared, told: &[EvaluatedExample], parameter: Parameter) {
    let shift = |of: &EvaluatedExample| {
        let mean = |sleepers| Average::of_estimates(&of.estimates(sleepers, parameter));
        mean(COARSE).less(mean(FINE))
    };
    let shift = Average::sum(told.iter().map(shift)).times(1e-6 / told.len() as f64);
    compared.row(
        format!("The rail's coarser mesh does not bias {}", parameter.symbol()),
        [
            "negligible".to_owned(),
            format!("{:+.2} ± {:.2} MN/m, sleepers 6-9 less 1-4", shift.mean, shift.error),
        ],
        shift.is_nothing(1e-6 * smallest_step(parameter)),
        "section 4.3.3: elements of 0.3 mm up to sleeper 5, of 6.3 mm behind; within two standard \
         deviations, which must be less than the smallest step of Table 4.1; the sleepers of an \
         example share their error, each of the three examples has a surface of its own",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict::{CannotTell, Differs, Reproduced};
    use crate::testing::{told, verdicts};

    #[test]
    fn estimates_of_the_truth_are_reproduced() {
        let exact = |figure| told(figure, 0.02, |of, at, parameter| of.sleepers[at - 1][parameter]);
        assert_eq!(verdicts(&irregularity(&exact(Figure::Fig17))), [Reproduced; 8]);
        let bending = bending_stiffness(&exact(Figure::Fig18));
        assert_eq!(verdicts(&bending), [Reproduced; 6], "{:#?}", bending.rows);
        assert!(bending.rows[0].why.contains("4000"));
    }

    #[test]
    fn estimates_that_know_little_more_than_the_range_cannot_tell() {
        let unsure = told(Figure::Fig17, 0.2, |of, at, parameter| of.sleepers[at - 1][parameter]);
        let found = irregularity(&unsure);
        let verdict =
            |words: &str| found.rows.iter().find(|row| row.claim.contains(words)).unwrap().verdict;
        assert_eq!(verdict("k_p is told correctly"), CannotTell);
        // Nine sleepers of one surface are not nine independent estimates.
        assert_eq!(verdict("told apart"), CannotTell);
        assert_eq!(verdict("A_irr does not bias k_p"), CannotTell);
    }

    #[test]
    fn a_stiffness_that_follows_the_level_or_the_mesh_differs() {
        let told = told(Figure::Fig17, 0.02, |of, at, parameter| {
            let set = of.sleepers[at - 1];
            let coarse = if at > 5 { 1.2 } else { 1.0 };
            match parameter {
                BallastStiffness => set[parameter] * set[IrregularityLevel] / 3.0,
                RailpadStiffness => set[parameter] * coarse,
                IrregularityLevel => 3.0,
                _ => set[parameter],
            }
        });
        let found = irregularity(&told);
        let verdict =
            |words: &str| found.rows.iter().find(|row| row.claim.contains(words)).unwrap().verdict;
        assert_eq!(verdict("A_irr is told correctly"), Differs);
        assert_eq!(verdict("A_irr does not bias k_b"), Differs);
        assert_eq!(verdict("A_irr does not bias k_p"), Reproduced);
        assert_eq!(verdict("mesh does not bias k_p"), Differs);
    }
}
