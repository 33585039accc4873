//! Methods beside each other (paper, section 5.1).

use crate::compared::correlation;
use crate::estimates::{agree, median};
use crate::statement::{Found, Statement, percent};
use crate::{Estimated, Method, Study};
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;

/// Largest median difference of Gaussian processes and selector, over the range of Table D1.
const DIFFERENCE: f64 = 0.1;
/// Least share of sleepers at which inversion and Gaussian processes agree.
const AGREE: f64 = 0.8;

/// The parameters of the paper's Fig. 20.
const SHOWN: [Parameter; 4] = [
    Parameter::IrregularityLevel,
    Parameter::RailpadStiffness,
    Parameter::SleeperBendingStiffness,
    Parameter::BallastStiffness,
];

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    let Some(processes) = study.by(Method::GaussianProcesses) else { return Vec::new() };
    let mut all = Vec::new();
    if let Some(selector) = study.by(Method::Selector) {
        for parameter in SHOWN {
            all.push(Statement::of(
                ("Fig. 20", Method::GaussianProcesses),
                [
                    &format!(
                        "Gaussian processes and model selector agree about the {}",
                        parameter.label()
                    ),
                    "the general trends are in good agreement",
                    "median difference at most a tenth of the range of Table D1",
                ],
                trend(study, [processes, selector], parameter),
            ));
        }
    }
    if let Some(inversion) = study.by(Method::Inversion) {
        for parameter in [Parameter::RailpadStiffness, Parameter::BallastStiffness] {
            all.push(Statement::of(
                ("section 5.1", Method::Inversion),
                [
                    &format!("Inversion and Gaussian processes agree about the {}", parameter.label()),
                    "-",
                    "difference inside its 90 % interval at 80 % of the sleepers that both call valid",
                ],
                agreement(study, [inversion, processes], parameter),
            ));
        }
    }
    all
}

fn trend(study: &Study, [one, other]: [&Estimated; 2], parameter: Parameter) -> Option<Found> {
    let pairs = study.truth.sleepers.iter().filter_map(|it| {
        Some((one.any(&it.id, parameter)?.mean, other.any(&it.id, parameter)?.mean))
    });
    let pairs: Vec<_> = pairs.collect();
    let [low, high] = parameter.range();
    let difference = median(pairs.iter().map(|(a, b)| (a - b).abs() / (high - low)))?;
    let along = correlation(&pairs).map_or_else(|| "-".to_owned(), |it| format!("{it:.2}"));
    let text = format!(
        "median difference {} of the range, correlation along the track {along}",
        rounded(difference, 2)
    );
    Some(Found::new(difference <= DIFFERENCE, text))
}

/// Share of the sleepers at which two evaluations agree, over those that both call valid.
pub(crate) fn agreement(
    study: &Study,
    [one, other]: [&Estimated; 2],
    parameter: Parameter,
) -> Option<Found> {
    let (agreed, count) = agreed(study, [one, other], parameter);
    let share = agreed as f64 / count as f64;
    let text = || format!("{} ({agreed} of {count})", percent(share));
    (count > 0).then(|| Found::new(share >= AGREE, text()))
}

/// At how many sleepers two evaluations agree, of how many that both call valid.
pub(crate) fn agreed(
    study: &Study,
    [one, other]: [&Estimated; 2],
    parameter: Parameter,
) -> (usize, usize) {
    let both = study.truth.sleepers.iter().filter_map(|it| {
        Some(agree(one.valid(&it.id, parameter)?, other.valid(&it.id, parameter)?))
    });
    both.fold((0, 0), |(agreed, count), it| (agreed + usize::from(it), count + 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn methods_that_differ_by_more_than_their_tolerance_do_not_agree() {
        let mut study = study();
        assert!(statements(&study).is_empty());
        let truth = estimated(&study, |_, _, truth| (truth, 0.05 * truth));
        let far = estimated(&study, |_, _, truth| (1.9 * truth, 0.05 * truth));
        study.methods = vec![
            (Method::Inversion, truth.clone()),
            (Method::GaussianProcesses, truth),
            (Method::Selector, far),
        ];
        let all = statements(&study);
        let (yes, no) = (ClaimVerdict::Reproduced, ClaimVerdict::Differs);
        assert_eq!(all.iter().map(|it| it.verdict).collect::<Vec<_>>(), [no, no, no, no, yes, yes]);
    }
}
