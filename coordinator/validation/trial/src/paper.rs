//! Test whether the method of the paper gives usual results for a recording with a hidden effect.

use crate::place::near;
use serde::{Deserialize, Serialize};
use tracktwin_evaluation::Evaluation;
use tracktwin_reference_simulator::Scene;

/// Share of stretches of the controls whose largest error is usual.
const USUAL: f64 = 0.95;

/// Least number of controls for a limit.
const CONTROLS_MIN: usize = 5;

/// Errors of the model selector at sleepers next to hidden effects. All sleepers count if an effect acts
/// everywhere or nothing is hidden.
///
/// The estimates themselves show nothing unusual: surrogates and selector keep their means inside the ranges of
/// the library.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paper {
    /// Mean absolute percentage error of the best match of each sleeper (paper, eq. 10; 0.05 is 5 %), in the
    /// order along the track. Empty in scores of earlier programs, which did not keep this order.
    #[serde(default)]
    pub best_mape: Vec<f64>,
}

impl Paper {
    /// The results of an evaluation. `None` if no sleeper next to a hidden effect was evaluated.
    pub fn of(scene: &Scene, evaluation: &Evaluation) -> Option<Self> {
        let near = evaluation.sleepers.iter().filter(|sleeper| near(scene, sleeper.x_m));
        let best_mape: Vec<f64> =
            near.filter_map(|sleeper| sleeper.selector.mape.first().copied()).collect();
        (!best_mape.is_empty()).then_some(Self { best_mape })
    }
}

/// Errors of the model selector on each control, in the order along the track.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Usual<'a>(Vec<&'a [f64]>);

impl<'a> Usual<'a> {
    /// The errors of controls. `None` with too few controls.
    pub(crate) fn of(controls: impl Iterator<Item = &'a Paper>) -> Option<Self> {
        let tested = controls.map(|paper| &paper.best_mape[..]).filter(|errors| !errors.is_empty());
        let tested: Vec<&[f64]> = tested.collect();
        (tested.len() >= CONTROLS_MIN).then_some(Self(tested))
    }

    /// Whether the largest error is usual for so many neighbouring sleepers. `None` without errors.
    pub(crate) fn is_content(&self, paper: &Paper) -> Option<bool> {
        Some(largest(&paper.best_mape)? <= self.limit(paper.best_mape.len()))
    }

    /// The largest error that 95 % of the stretches of so many neighbouring sleepers do not exceed. A shorter
    /// control is one stretch.
    fn limit(&self, sleepers: usize) -> f64 {
        let stretches = self.0.iter().flat_map(|errors| errors.windows(sleepers.min(errors.len())));
        let mut all: Vec<f64> = stretches.filter_map(largest).collect();
        all.sort_by(f64::total_cmp);
        all[(USUAL * all.len() as f64).ceil() as usize - 1]
    }
}

fn largest(errors: &[f64]) -> Option<f64> {
    errors.iter().copied().max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Tracks of 24 sleepers each, with log-normal errors.
    fn tracks(seed: u64) -> Vec<Paper> {
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut error = || {
            let deviation: f64 = StandardNormal.sample(random);
            0.1 * (0.3 * deviation).exp()
        };
        let mut track = || Paper { best_mape: (0..24).map(|_| error()).collect() };
        (0..400).map(|_| track()).collect()
    }

    #[test]
    fn a_single_unusual_sleeper_beside_an_effect_is_an_alarm() {
        let controls = tracks(1);
        let usual = Usual::of(controls.iter()).unwrap();
        let is_content =
            |best_mape: &[f64]| usual.is_content(&Paper { best_mape: best_mape.to_vec() });
        assert_eq!(is_content(&[0.1, 0.1, 0.1]), Some(true));
        assert_eq!(is_content(&[0.1, 0.3, 0.1]), Some(false));
        assert_eq!(is_content(&[0.1, 0.1, 0.1, 0.3, 0.1]), Some(false));
        // Of one sleeper 95 % are below 0.164, of five neighbours below 0.201, of a track below 0.237.
        assert_eq!(is_content(&[0.18]), Some(false));
        assert_eq!(is_content(&[0.1, 0.18, 0.1, 0.1, 0.1]), Some(true));
        assert_eq!(is_content(&[[0.1; 23].as_slice(), &[0.22]].concat()), Some(true));
        assert_eq!(is_content(&[[0.1; 23].as_slice(), &[0.3]].concat()), Some(false));
        assert_eq!(is_content(&[]), None);
        assert!(Usual::of(controls[..4].iter()).is_none());
    }

    #[test]
    fn results_of_earlier_programs_are_read_and_count_as_not_tested() {
        let stored = r#"{"mape":[0.1,0.2],"inside":true}"#;
        let earlier = vec![serde_json::from_str::<Paper>(stored).unwrap(); 5];
        assert!(Usual::of(earlier.iter()).is_none());
        assert_eq!(Usual::of(tracks(1).iter()).unwrap().is_content(&earlier[0]), None);
    }

    #[test]
    fn five_per_cent_of_usual_stretches_of_any_length_are_alarms() {
        let [controls, others] = [1, 2].map(tracks);
        let usual = Usual::of(controls.iter()).unwrap();
        for sleepers in [1, 2, 3, 5, 24] {
            let stretch = |other: &Paper| Paper { best_mape: other.best_mape[..sleepers].to_vec() };
            let alarms = others.iter().filter(|it| usual.is_content(&stretch(it)) == Some(false));
            let share = alarms.count() as f64 / others.len() as f64;
            // Three standard deviations of the counts of both.
            assert!((share - 0.05).abs() < 0.046, "{sleepers}: {share}");
        }
    }
}
