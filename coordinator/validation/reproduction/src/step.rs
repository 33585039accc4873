//! Fig. 16: railpads and ballast that soften from sleeper 5 on.

use crate::agreement::{Agreement, picture};
use crate::average::{Average, all};
use crate::{Compared, EvaluatedExample, Figure};
use tracktwin_parameters::Parameter::{self, BallastStiffness, RailpadStiffness};

/// Sleepers away from the step between 4 and 5, on either side.
const BEFORE: [usize; 3] = [1, 2, 3];
const BEHIND: [usize; 4] = [6, 7, 8, 9];

/// Comparison of the three steps with the paper's Fig. 16.
pub(crate) fn step(told: &[EvaluatedExample]) -> Compared {
    let caption = "Truth and estimates, mean with two standard deviations, sleeper by sleeper: \
                   parameter set A0 up to sleeper 4, A1, A2 and A3 from sleeper 5 on.";
    let mut compared = Compared::new(Figure::Fig16, caption);
    let away = [&BEFORE[..], &BEHIND].concat();
    for parameter in [RailpadStiffness, BallastStiffness] {
        let claim = format!("{} agrees with the truth away from the step", parameter.label());
        let claim = claim[..1].to_uppercase() + &claim[1..];
        Agreement::new(told, &away, parameter).row(&mut compared, claim, "agrees well");
    }
    for parameter in [RailpadStiffness, BallastStiffness] {
        gradual(&mut compared, told, parameter);
    }
    for parameter in [RailpadStiffness, BallastStiffness] {
        compared.pictures.extend(told.iter().map(|of| picture(of, parameter)));
    }
    compared
}

fn gradual(compared: &mut Compared, told: &[EvaluatedExample], parameter: Parameter) {
    let side = |of: &EvaluatedExample, at: &[usize]| {
        Average::of_estimates(&of.estimates(at.iter().copied(), parameter))
    };
    let whole = |of: &EvaluatedExample| side(of, &BEFORE).less(side(of, &BEHIND));
    let between = |of: &EvaluatedExample| side(of, &[4]).less(side(of, &[5]));
    let change = Average::sum(told.iter().map(whole));
    let rest = Average::sum(told.iter().map(|of| whole(of).less(between(of))));
    let share = 100.0 * (1.0 - rest.mean / change.mean);
    let size = 100.0 * rest.error / change.mean.abs();
    compared.row(
        format!("{} changes gradually between sleepers 4 and 5", parameter.symbol()),
        [
            "gradual, not abrupt".to_owned(),
            format!("{share:.0} ± {size:.0} % of the change lie between the two"),
        ],
        all([change.is_positive(), rest.is_positive()]),
        "all of the change between the two would be abrupt; less by more than two standard \
         deviations, over the three examples together; the sleepers of an example share their error, \
         each example has a surface of its own",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict::{CannotTell, Differs, Reproduced};
    use crate::testing::{told, verdicts};

    /// Estimates that see this share of either neighbour.
    fn smoothed(share: f64, bias: f64) -> Vec<EvaluatedExample> {
        told(Figure::Fig16, 0.02, |example, at, parameter| {
            let truth = |at: usize| example.sleepers[at.clamp(1, 9) - 1][parameter];
            let mean = (1.0 - 2.0 * share) * truth(at) + share * (truth(at - 1) + truth(at + 1));
            mean * (1.0 + bias)
        })
    }

    #[test]
    fn an_average_over_neighbours_is_the_paper_s() {
        assert_eq!(verdicts(&step(&smoothed(0.25, 0.0))), [Reproduced; 4]);
    }

    #[test]
    fn biased_estimates_differ_and_an_abrupt_step_cannot_be_called_gradual() {
        assert_eq!(verdicts(&step(&smoothed(0.25, 0.5)))[..2], [Differs, Differs]);
        assert_eq!(verdicts(&step(&smoothed(0.0, 0.0)))[2..], [CannotTell, CannotTell]);
        assert_eq!(verdicts(&step(&smoothed(-0.25, 0.0)))[2..], [Differs, Differs]);
    }
}
