//! Sleepers with so little stiffness that the levels near the even track do not show it.
//!
//! The variation along the track is estimated from derivatives at the fitted values. Those of a stiffness that is a fifth of
//! its neighbours' are others than those at the neighbours' value. So each sleeper is also tried with a fifth.

use nalgebra::DVector;
use rayon::prelude::*;
use tracktwin_diagnosis::{
    Calibration, CalibrationError, Candidate, EXCEPTION_NATS, Exception, Forward, Observation, Own,
    Problem,
};

/// Natural logarithm of the tried share of a stiffness.
const TRIED_LOG: f64 = -1.6;

/// Largest number of sleepers that are found, and number of them that are fitted in each round.
const FOUND_MAX: usize = 3;
const FITTED: usize = 2;

/// Number of sleepers on either side from which the usual stiffness is taken.
const NEIGHBOURS: usize = 4;

/// Loss of log likelihood in nats up to which a trial is fitted; all other values are those of the fit without it.
const LOSS_MAX: f64 = 10.0;

/// Adds exceptions for soft sleepers to the unknowns of `forward` while they raise the log evidence of its `calibration`
/// enough. `known` physics is part of the model.
///
/// # Errors
/// [`CalibrationError`] if no track model exists for the fitted values.
pub(crate) fn add_soft_sleepers(
    observation: &Observation,
    known: &[Candidate],
    forward: &mut Forward,
    calibration: &mut Calibration,
) -> Result<(), CalibrationError> {
    for _ in 0..FOUND_MAX {
        let problem = Problem { forward, observation, candidates: known };
        let tried: Vec<_> = promising(&problem, calibration)?
            .into_par_iter()
            .filter_map(|exception| fitted_with(&problem, exception, calibration))
            .collect();
        let better = |(_, one): &(Forward, Calibration), (_, other): &(Forward, Calibration)| {
            one.log_evidence.total_cmp(&other.log_evidence)
        };
        let Some((found, fitted)) = tried.into_iter().max_by(better) else { break };
        if fitted.log_evidence - calibration.log_evidence < EXCEPTION_NATS {
            break;
        }
        *forward = found;
        *calibration = fitted;
    }
    Ok(())
}

/// The exceptions that lose least log likelihood with a small share of the stiffness, the best first.
fn promising(
    problem: &Problem<'_>,
    calibration: &Calibration,
) -> Result<Vec<Exception>, CalibrationError> {
    let Problem { forward, observation, .. } = problem;
    let extensions = problem.extensions(&calibration.values)?;
    let half_square = |values: &DVector<f64>| -> Option<f64> {
        let predicted = forward.log_power(values, &extensions).ok()?;
        Some(0.5 * observation.fitted(&observation.residual(&predicted)).norm_squared())
    };
    let present = 0.5 * calibration.residual.norm_squared();
    let unknowns = &forward.unknowns;
    let fields = [Own::BallastStiffness, Own::RailpadStiffness];
    let all = fields.into_iter().flat_map(|field| {
        (0..forward.section.sleepers()).map(move |sleeper| Exception { field, sleeper })
    });
    let new: Vec<Exception> = all.filter(|it| !unknowns.exceptions.contains(it)).collect();
    let loss = |&exception: &Exception| {
        let values = with_little(problem, exception, &calibration.values);
        Some((half_square(&values)? - present, exception))
    };
    let mut ranked: Vec<(f64, Exception)> = new.par_iter().filter_map(loss).collect();
    ranked.sort_by(|one, other| one.0.total_cmp(&other.0));
    let near = ranked.into_iter().take_while(|(loss, _)| *loss < LOSS_MAX);
    Ok(near.take(FITTED).map(|(_, exception)| exception).collect())
}

/// The values with a small share of the usual stiffness at a sleeper. Its neighbours have the usual stiffness, for a smooth
/// fit gives them a part of what the sleeper lacks.
fn with_little(
    problem: &Problem<'_>,
    Exception { field, sleeper }: Exception,
    values: &DVector<f64>,
) -> DVector<f64> {
    let unknowns = &problem.forward.unknowns;
    let near = |reach: usize| {
        let last = problem.forward.section.sleepers() - 1;
        sleeper.saturating_sub(reach)..=(sleeper + reach).min(last)
    };
    let beside = near(NEIGHBOURS).filter(|other| !near(1).contains(other));
    let mut all: Vec<f64> = beside.map(|other| values[unknowns.at(field, other)]).collect();
    all.sort_by(f64::total_cmp);
    let usual = all[all.len() / 2];
    let mut values = values.clone();
    near(1).for_each(|other| values[unknowns.at(field, other)] = usual);
    values[unknowns.at(field, sleeper)] = usual + TRIED_LOG;
    values
}

/// A fit with an exception, from a small share of the stiffness. `None` if it fails.
fn fitted_with(
    problem: &Problem<'_>,
    exception: Exception,
    calibration: &Calibration,
) -> Option<(Forward, Calibration)> {
    let mut forward = problem.forward.clone();
    forward.unknowns.exceptions.push(exception);
    let start = with_little(problem, exception, &calibration.values);
    let fitted = Problem { forward: &forward, ..*problem }.calibrate(start).ok()?;
    Some((forward, fitted))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use tracktwin_diagnosis::{Bands, Section, Variation};
    use tracktwin_parameters::TrackDesign;

    const SLEEPERS: usize = 12;

    /// The exceptions that are found where the ballast of one sleeper has a share of its usual stiffness, and what is found
    /// of it. The other sleepers have told that the track is even.
    fn found(share: f64) -> (Vec<Exception>, f64) {
        let section = Section::new(TrackDesign::v_track(), SLEEPERS, 1.0);
        let mut forward =
            Forward::new(section, Bands::new(80.0, 2000.0), &[7.0, 13.0], vec![0.0; 2]);
        let even = Variation { smooth: 0.03, length: 3.0, independent: 0.03 };
        forward.unknowns.variation = [even; 3];
        let ballast = forward.unknowns.at(Own::BallastStiffness, 5);
        let mut truth = forward.unknowns.typical();
        truth[ballast] += share.ln();
        let log_power = forward.log_power(&truth, &[]).unwrap();
        let covariance = DMatrix::identity(forward.per_sleeper(), forward.per_sleeper()) * 0.02;
        let observation = Observation::new(log_power, &covariance, |_| false).unwrap();
        let problem = Problem { forward: &forward, observation: &observation, candidates: &[] };
        let mut calibration = problem.calibrate(forward.unknowns.typical()).unwrap();
        add_soft_sleepers(&observation, &[], &mut forward, &mut calibration).unwrap();
        (forward.unknowns.exceptions, (calibration.values[ballast] - truth[ballast]).exp())
    }

    #[test]
    fn a_sleeper_on_a_tenth_of_its_ballast_is_found() {
        let (exceptions, ratio) = found(0.1);
        assert_eq!(exceptions, [Exception { field: Own::BallastStiffness, sleeper: 5 }]);
        assert!((ratio - 1.0).abs() < 0.3, "{ratio}");
    }

    #[test]
    fn an_even_track_has_none() {
        assert_eq!(found(1.0).0, []);
    }
}
