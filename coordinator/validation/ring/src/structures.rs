//! Statements about clamps, the missing railpad, gaps and bolts (paper, sections 5.1 to 5.3).

use crate::estimates::{mean, median, sd_share};
use crate::statement::{Found, Statement, percent, sure};
use crate::{Estimated, Method, SleeperTruth, Study};
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;

/// Least share of clamps, or of gaps, that must be seen.
const SEEN: f64 = 0.8;
/// Sleepers on either side of a gap whose mean is compared, and how many of them must be valid.
const BESIDE_GAP: usize = 5;
const VALID_LEAST: usize = 3;
/// Largest error of a step over its size.
const STEP_ERROR: f64 = 0.5;
/// Least ratio of the estimated to the true bending stiffness: the paper's 5000 over 2300 N m2 is 2.2.
const RAISED: f64 = 2.0;

pub(crate) fn statements(study: &Study, method: Method, estimated: &Estimated) -> Vec<Statement> {
    let is_inversion = matches!(method, Method::Inversion | Method::InversionWithDiagnosis);
    let shift = usize::from(!is_inversion);
    let place = if shift == 0 { "at the sleeper itself" } else { "within one sleeper" };
    let alike = if shift == 0 { "" } else { ", all shifted alike" };
    let clamps = "Clamps are local peaks of the railpad stiffness";
    let mut all = Vec::new();
    // With bolts in the model nothing is to raise it.
    if method != Method::InversionWithDiagnosis {
        all.push(Statement::of(
            ("Fig. 20", method),
            [
                "Bolts raise the sleeper bending stiffness",
                "about 5000 N m2, more than twice the nominal 2300 N m2 (here 2362 N m2)",
                &sure("median at least twice the truth"),
            ],
            bending(study, estimated),
        ));
    }
    all.extend([
        Statement::of(
            ("Fig. 22", method),
            [
                clamps,
                "at the clamps, in places shifted by one sleeper",
                &format!("at least 80 % of the clamps {place}{alike}"),
            ],
            peaks(study, estimated, shift),
        ),
        Statement::of(
            ("Fig. 23", method),
            [
                "The missing railpad is the lowest railpad stiffness",
                "a dip, shifted by one sleeper (SN90 for SN91)",
                &format!("lowest estimate {place}"),
            ],
            missing(study, estimated, shift),
        ),
    ]);
    all.push(Statement::of(
        ("Fig. 22", method),
        [
            "Gaps of the plywood are steps of the ballast stiffness",
            "steps at the gaps, a large one between SN94 and SN95",
            "at least 80 % of the steps have at most half their size in error",
        ],
        steps(study, estimated),
    ));
    all
}

fn bending(study: &Study, estimated: &Estimated) -> Option<Found> {
    let parameter = Parameter::SleeperBendingStiffness;
    let bolted = study.truth.sleepers.iter().filter(|it| it.bolt);
    let found = bolted.filter_map(|it| Some((it, estimated.any(&it.id, parameter)?)));
    let found: Vec<_> = found.collect();
    let ratio = median(found.iter().map(|(it, of)| of.mean / it.values[&parameter]))?;
    let middle = median(found.iter().map(|(_, of)| of.mean))?;
    let sd = median(found.iter().map(|(_, of)| of.sd))?;
    let text = format!(
        "{} ± {} N m2, {} times the truth",
        rounded(middle, 3),
        rounded(sd, 2),
        rounded(ratio, 3)
    );
    let sds = found.iter().map(|(_, of)| sd_share(*of, parameter));
    Some(Found::new(ratio >= RAISED, text).if_sure(sds))
}

fn railpad(estimated: &Estimated, sleeper: &SleeperTruth) -> Option<f64> {
    Some(estimated.any(&sleeper.id, Parameter::RailpadStiffness)?.mean)
}

/// Indices at which the estimate is above that of both neighbours.
fn local_peaks(estimates: &[Option<f64>]) -> Vec<usize> {
    let is_peak =
        |window: &[Option<f64>]| matches!(window, [Some(a), Some(b), Some(c)] if b > a && b > c);
    let windows = estimates.windows(3).enumerate();
    windows.filter(|(_, window)| is_peak(window)).map(|(index, _)| index + 1).collect()
}

/// How many clamps have a peak so many sleepers further, all shifted alike.
fn hits(clamps: &[usize], peaks: &[usize], shift: isize) -> usize {
    let shifted = clamps.iter().filter_map(|clamp| clamp.checked_add_signed(shift));
    shifted.filter(|index| peaks.contains(index)).count()
}

/// Clamps at local peaks, for the one shift up to `most` by which most of them are.
fn peaks(study: &Study, estimated: &Estimated, most: usize) -> Option<Found> {
    let sleepers = &study.truth.sleepers;
    let values: Vec<_> = sleepers.iter().map(|it| railpad(estimated, it)).collect();
    let peaks = local_peaks(&values);
    // At the ends there is no neighbour to be above.
    let inner = 1 + most..sleepers.len().saturating_sub(1 + most);
    let clamps: Vec<usize> = inner.filter(|&index| sleepers[index].clamp).collect();
    let count = clamps.len();
    if count == 0 {
        return None;
    }
    let shifts = -most.cast_signed()..=most.cast_signed();
    let seen = shifts.map(|shift| (hits(&clamps, &peaks, shift), shift));
    let (seen, shift) = seen.max_by_key(|(seen, shift)| (*seen, -shift.abs()))?;
    let is_clamp = |peak: &&usize| {
        let index = peak.checked_add_signed(-shift);
        index.and_then(|index| sleepers.get(index)).is_some_and(|it| it.clamp)
    };
    let elsewhere = peaks.len() - peaks.iter().filter(is_clamp).count();
    let exact = hits(&clamps, &peaks, 0);
    let shifted = match shift {
        0 => String::new(),
        _ => format!(" shifted by {shift:+} sleeper ({exact} not shifted)"),
    };
    let text = format!("{seen} of {count}{shifted}; {elsewhere} peaks without a clamp");
    Some(Found::new(seen as f64 >= SEEN * count as f64, text))
}

fn missing(study: &Study, estimated: &Estimated, shift: usize) -> Option<Found> {
    let missing = study.truth.sleepers.iter().find(|it| it.missing_railpad)?;
    let values = study.truth.sleepers.iter().filter_map(|it| Some((it, railpad(estimated, it)?)));
    let (lowest, _) = values.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let estimate = estimated.any(&missing.id, Parameter::RailpadStiffness)?;
    let text = format!(
        "lowest at {}; {} there is {} ± {} MN/m, truth {} MN/m",
        lowest.id,
        missing.id,
        rounded(estimate.mean / 1e6, 3),
        rounded(estimate.sd / 1e6, 2),
        rounded(missing.values[&Parameter::RailpadStiffness] / 1e6, 3)
    );
    Some(Found::new(lowest.number.abs_diff(missing.number) <= shift, text))
}

/// Logarithm of the ratio of the ballast stiffness behind a gap to that before it: estimated and true.
pub(crate) fn step(study: &Study, estimated: &Estimated, gap: usize) -> Option<[f64; 2]> {
    let parameter = Parameter::BallastStiffness;
    let side = |numbers: std::ops::RangeInclusive<usize>| {
        let some = study.truth.sleepers.iter().filter(|it| numbers.contains(&it.number));
        let pairs = some.filter_map(|it| {
            let found = estimated.valid(&it.id, parameter)?.mean;
            Some((found.ln(), it.values[&parameter].ln()))
        });
        let pairs: Vec<_> = pairs.collect();
        if pairs.len() < VALID_LEAST {
            return None;
        }
        Some([mean(pairs.iter().map(|it| it.0))?, mean(pairs.iter().map(|it| it.1))?])
    };
    let before = side(gap + 1 - BESIDE_GAP.min(gap)..=gap)?;
    let behind = side(gap + 1..=gap + BESIDE_GAP)?;
    Some([behind[0] - before[0], behind[1] - before[1]])
}

fn steps(study: &Study, estimated: &Estimated) -> Option<Found> {
    let gaps = study.truth.gaps.iter();
    let steps: Vec<_> = gaps.filter_map(|&gap| Some((gap, step(study, estimated, gap)?))).collect();
    let is_right = |[found, truth]: [f64; 2]| (found - truth).abs() <= STEP_ERROR * truth.abs();
    let right = steps.iter().filter(|(_, step)| is_right(*step)).count();
    let change = |logarithm: f64| format!("{:+.0} %", 100.0 * logarithm.exp_m1());
    let texts = steps.iter().map(|(gap, [found, truth])| {
        format!("SN{gap}: {} (truth {})", change(*found), change(*truth))
    });
    let texts: Vec<_> = texts.collect();
    (!steps.is_empty()).then(|| {
        let share = right as f64 / steps.len() as f64;
        let text =
            format!("{right} of {} ({}); behind {}", steps.len(), percent(share), texts.join(", "));
        Found::new(share >= SEEN, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn the_truth_shows_clamps_railpad_and_gaps_but_no_raised_bending_stiffness() {
        let study = study();
        let truth = estimated(&study, |_, _, truth| (truth, 0.1 * truth));
        let all = statements(&study, Method::Inversion, &truth);
        let verdicts: Vec<_> = all.iter().map(|it| it.verdict).collect();
        let (yes, no) = (ClaimVerdict::Reproduced, ClaimVerdict::Differs);
        assert_eq!(verdicts, [no, yes, yes, yes], "{all:#?}");
        assert!(all[2].found.starts_with("lowest at SN91"), "{}", all[2].found);
        assert!(all[3].found.starts_with("6 of 6"), "{}", all[3].found);
    }

    #[test]
    fn the_middle_of_the_range_does_not_show_that_bolts_raise_the_bending_stiffness() {
        let study = study();
        let verdict = |sd_share: f64| {
            let middle = estimated(&study, |_, parameter, _| {
                let [low, high] = parameter.range();
                (0.5 * (low + high), sd_share * (high - low))
            });
            statements(&study, Method::GaussianProcesses, &middle)[0].verdict
        };
        assert_eq!(verdict(0.05), ClaimVerdict::Reproduced);
        assert_eq!(verdict(0.25), ClaimVerdict::CannotTell);
    }

    #[test]
    fn estimates_that_are_shifted_by_a_sleeper_count_for_the_models_only() {
        let study = study();
        let shifted = |sleeper: &SleeperTruth, parameter: Parameter, truth: f64| {
            let next = study.truth.sleepers.get(sleeper.number);
            let value = next.map_or(truth, |next| next.values[&parameter]);
            (value, 0.1 * value)
        };
        let shifted = estimated(&study, shifted);
        let verdict = |method: Method| {
            let all = statements(&study, method, &shifted);
            [all[1].verdict, all[2].verdict]
        };
        assert_eq!(verdict(Method::Inversion), [ClaimVerdict::Differs; 2]);
        assert_eq!(verdict(Method::GaussianProcesses), [ClaimVerdict::Reproduced; 2]);
    }

    #[test]
    fn peaks_on_either_side_of_the_clamps_are_not_shifted_alike() {
        let study = study();
        let clamped: Vec<usize> =
            study.truth.sleepers.iter().filter(|it| it.clamp).map(|it| it.number).collect();
        // One clamp appears a sleeper later, the next a sleeper earlier.
        let is_peak = |number: usize| {
            (0_usize..).zip(&clamped).any(|(index, clamp)| number + 2 * (index % 2) == clamp + 1)
        };
        let scattered = estimated(&study, |sleeper, _, truth| {
            (if is_peak(sleeper.number) { 1.5e8 } else { 8e7 }, 0.1 * truth)
        });
        let all = statements(&study, Method::GaussianProcesses, &scattered);
        assert_eq!(all[1].verdict, ClaimVerdict::Differs, "{:?}", all[1]);
    }

    #[test]
    fn a_peak_is_above_both_neighbours() {
        let values = [1.0, 3.0, 2.0, 2.5, 2.5, 0.0, 4.0].map(Some);
        assert_eq!(local_peaks(&values), [1]);
        assert!(local_peaks(&[Some(1.0), None, Some(0.5)]).is_empty());
    }
}
