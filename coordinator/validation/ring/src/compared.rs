//! Comparison of estimates with the truth: error, interval and place. The paper had no truth for this
//! comparison.

use crate::estimates::{correlation, correlation_by_chance, holds, median, sd_share};
use crate::parameters::STIFFNESSES;
use crate::statement::{Found, Statement, each, percent, sure};
use crate::{Estimated, Method, Study};
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;

/// Largest median of the absolute error of the logarithm.
const ERROR: f64 = 0.15;
/// Least share of truths inside the 90 % interval.
const HOLDS: f64 = 0.8;
/// Sleepers by which estimates may be shifted against the truth.
const SHIFTS: [isize; 3] = [-1, 0, 1];

pub(crate) fn statements(study: &Study, method: Method, estimated: &Estimated) -> Vec<Statement> {
    let mut all = each(
        ("truth", method),
        &STIFFNESSES,
        |label| format!("The {label} is accurate"),
        [
            "the truth at every valid sleeper",
            "median of the absolute error of the logarithm at most 0.15",
        ],
        |parameter| error(study, estimated, parameter),
    );
    all.extend(each(
        ("truth", method),
        &STIFFNESSES,
        |label| format!("The 90 % interval of the {label} holds the truth"),
        ["90 % of the valid sleepers", &sure("at least 80 % of the valid sleepers")],
        |parameter| interval(study, estimated, parameter),
    ));
    all.push(Statement::of(
        ("section 5.3", method),
        [
            "Railpad stiffness is not shifted along the track",
            "shifted by one sleeper in places",
            "correlation with the truth larger than with the truth of the next sleeper on either side; \
             undecided if it differs from the larger of these by at most two standard errors (2 over \
             the root of the number of sleepers)",
        ],
        shift(study, estimated),
    ));
    all
}

/// Estimate and truth at every valid sleeper.
fn pairs<'a>(
    study: &'a Study,
    estimated: &'a Estimated,
    parameter: Parameter,
) -> impl Iterator<Item = (tracktwin_evaluation::Estimate, f64)> + 'a {
    study
        .truth
        .sleepers
        .iter()
        .filter_map(move |it| Some((estimated.valid(&it.id, parameter)?, it.values[&parameter])))
}

fn error(study: &Study, estimated: &Estimated, parameter: Parameter) -> Option<Found> {
    let errors = pairs(study, estimated, parameter).map(|(of, truth)| (of.mean / truth).ln());
    let errors: Vec<f64> = errors.collect();
    let median_error = median(errors.iter().map(|error| error.abs()))?;
    let bias = median(errors.iter().copied())?;
    let text = format!(
        "error of the logarithm: absolute median {}, median {}, at {} of {} sleepers",
        rounded(median_error, 2),
        rounded(bias, 2),
        errors.len(),
        study.truth.sleepers.len()
    );
    Some(Found::new(median_error <= ERROR, text))
}

fn interval(study: &Study, estimated: &Estimated, parameter: Parameter) -> Option<Found> {
    let pairs: Vec<_> = pairs(study, estimated, parameter).collect();
    let count = pairs.iter().filter(|(of, truth)| holds(*of, *truth)).count();
    let share = count as f64 / pairs.len() as f64;
    let text = || format!("{} ({count} of {})", percent(share), pairs.len());
    let sds = pairs.iter().map(|(of, _)| sd_share(*of, parameter));
    (!pairs.is_empty()).then(|| Found::new(share >= HOLDS, text()).if_sure(sds))
}

fn shift(study: &Study, estimated: &Estimated) -> Option<Found> {
    let parameter = Parameter::RailpadStiffness;
    let sleepers = &study.truth.sleepers;
    let with = |shift: isize| {
        let pairs = sleepers.iter().enumerate().filter_map(|(index, it)| {
            let other = sleepers.get(index.checked_add_signed(shift)?)?;
            let found = estimated.any(&it.id, parameter)?.mean;
            Some((found.ln(), other.values[&parameter].ln()))
        });
        let pairs: Vec<_> = pairs.collect();
        Some((correlation(&pairs)?, pairs.len()))
    };
    let [before, own, behind] = SHIFTS.map(with);
    let ((before, _), (own, count), (behind, _)) = (before?, own?, behind?);
    let text = format!(
        "correlation {own:.2} with the sleeper itself, {before:.2} and {behind:.2} with its neighbours"
    );
    let by_chance = correlation_by_chance(count);
    let difference = own - before.max(behind);
    if difference.abs() <= by_chance {
        return Some(Found::undecided(format!(
            "{text}; a difference of {by_chance:.2} may be chance"
        )));
    }
    Some(Found::new(difference > 0.0, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn the_truth_is_accurate_inside_its_interval_and_in_place() {
        let study = study();
        let truth = estimated(&study, |_, _, truth| (truth, 0.1 * truth));
        let all = statements(&study, Method::Inversion, &truth);
        assert!(all.iter().all(|it| it.verdict == ClaimVerdict::Reproduced), "{all:#?}");
        assert!(
            all[0].found.ends_with("absolute median 0, median 0, at 100 of 100 sleepers"),
            "{}",
            all[0].found
        );
    }

    #[test]
    fn estimates_half_as_large_again_are_neither() {
        let study = study();
        let wrong = estimated(&study, |_, _, truth| (1.5 * truth, 0.1 * truth));
        let all = statements(&study, Method::Inversion, &wrong);
        assert!(all[..4].iter().all(|it| it.verdict == ClaimVerdict::Differs), "{all:#?}");
    }

    #[test]
    fn noise_does_not_tell_whether_estimates_are_shifted() {
        let study = study();
        let noise = |number: usize| (12.9898 * number as f64).sin();
        // So much of the truth's logarithm, and noise that is independent of it.
        let verdict = |share: f64| {
            let some = estimated(&study, |sleeper, _, truth| {
                let mean = (truth / 8e7).powf(share) * (0.3 * noise(sleeper.number)).exp();
                (mean, 0.1 * mean)
            });
            let found = shift(&study, &some);
            Statement::of(("section 5.3", Method::Inversion), [""; 3], found).verdict
        };
        assert_eq!(verdict(1.0), ClaimVerdict::Reproduced);
        assert_eq!(verdict(0.0), ClaimVerdict::CannotTell);
    }

    #[test]
    fn an_interval_as_wide_as_the_range_decides_nothing() {
        let study = study();
        let wide = estimated(&study, |_, parameter, truth| {
            let [low, high] = parameter.range();
            (truth, 0.3 * (high - low))
        });
        let all = statements(&study, Method::Inversion, &wide);
        assert!(all[2..4].iter().all(|it| it.verdict == ClaimVerdict::CannotTell), "{all:#?}");
    }
}
