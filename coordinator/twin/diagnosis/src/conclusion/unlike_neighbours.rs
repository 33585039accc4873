//! Sleepers whose fitted stiffness differs much from that of their neighbours.
//!
//! The baseline has a stiffness of its own at every sleeper. It fits a railpad that is nearly missing, and nothing is
//! then left out. Such a sleeper is stated beside the verdict.

use crate::estimate::Estimate;
use crate::neighbours::{FAR, usual_near};
use crate::outcome::{Hypothesis, SleeperValues, Verdict};
use tracktwin_number::rounded;

/// Smallest log ratio in its own standard deviations.
const DEVIATIONS: f64 = 3.0;

/// Sentence on single sleepers unlike their neighbours, away from accepted hypotheses, with a space before it; `None` if
/// there is none. Unknown physics and faults of the chain may be imitated by a stiffness, so that nothing is said then.
pub(super) fn unlike_neighbours(
    track: &[SleeperValues],
    verdict: Verdict,
    hypotheses: &[Hypothesis],
) -> Option<String> {
    if matches!(verdict, Verdict::UnknownPhysics | Verdict::MeasurementChain) {
        return None;
    }
    let places = hypotheses.iter().filter(|it| it.accepted).filter_map(|it| it.location.as_ref());
    let is_explained = |id: &String| places.clone().any(|place| place.sleepers.contains(id));
    let railpads = of("railpad", track, |sleeper| sleeper.railpad_stiffness.after);
    let ballast = of("ballast", track, |sleeper| sleeper.ballast_stiffness.after);
    let found = railpads.into_iter().chain(ballast);
    let named: Vec<String> = found.filter(|(id, _)| !is_explained(id)).map(|it| it.1).collect();
    (!named.is_empty())
        .then(|| format!(" Fitted stiffness unlike that of the neighbours: {}.", named.join("; ")))
}

/// Ids and descriptions of the sleepers whose stiffness differs much from the median of their neighbours.
fn of(
    name: &str,
    track: &[SleeperValues],
    stiffness: impl Fn(&SleeperValues) -> Estimate,
) -> Vec<(String, String)> {
    let means: Vec<f64> = track.iter().map(|values| stiffness(values).mean).collect();
    let one = |(sleeper, values): (usize, &SleeperValues)| {
        let usual = usual_near(&means, sleeper);
        let Estimate { mean, sd } = stiffness(values);
        let log_ratio = (mean / usual).ln();
        (log_ratio.abs() > FAR.max(DEVIATIONS * sd / mean)).then(|| {
            let ratio = rounded(mean / usual, 2);
            let said = format!(
                "{name} of {}, {} ± {} MN/m ({ratio} times theirs)",
                values.id,
                rounded(1e-6 * mean, 2),
                rounded(1e-6 * sd, 1)
            );
            (values.id.clone(), said)
        })
    };
    track.iter().enumerate().filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::{BeforeAfter, Location};

    fn track(railpads: &[f64]) -> Vec<SleeperValues> {
        let both = |mean: f64| {
            let estimate = Estimate { mean, sd: 0.1 * mean };
            BeforeAfter { before: estimate, after: estimate }
        };
        let of = |(number, &railpad): (usize, &f64)| SleeperValues {
            id: format!("SN{number}"),
            x_m: number as f64,
            railpad_stiffness: both(railpad),
            ballast_stiffness: both(5e7),
            irregularity_level: both(1.0),
            flags: Vec::new(),
        };
        railpads.iter().enumerate().map(of).collect()
    }

    #[test]
    fn a_railpad_of_a_third_is_stated_unless_something_is_named_there() {
        let alike = track(&[1.2e8, 1.5e8, 1.65e8, 1e8, 1.57e8, 1.3e8, 1.8e8]);
        assert_eq!(unlike_neighbours(&alike, Verdict::Consistent, &[]), None);
        let soft = track(&[1.2e8, 1.5e8, 1.65e8, 1e8, 5.1e7, 1.57e8, 1.3e8, 1.8e8]);
        let said = " Fitted stiffness unlike that of the neighbours: railpad of SN4, 51 ± 5 MN/m (0.32 times theirs).";
        assert_eq!(unlike_neighbours(&soft, Verdict::Consistent, &[]).as_deref(), Some(said));
        assert_eq!(unlike_neighbours(&soft, Verdict::UnknownPhysics, &[]), None);
        let place = Location { x_m: [4.0, 4.0], sleepers: vec!["SN4".to_owned()] };
        let named = [Hypothesis::accepted("missing_railpad", Some(place))];
        assert_eq!(unlike_neighbours(&soft, Verdict::LeftOutPhysics, &named), None);
    }
}
