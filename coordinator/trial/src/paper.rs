//! Whether the paper's own pipeline looks content with a recording in which something is hidden.

use crate::score::near;
use serde::{Deserialize, Serialize};
use tracktwin_evaluation::{Evaluation, SleeperEvaluation};
use tracktwin_parameters::{Axis, Preset};
use tracktwin_truth::Scene;

/// What surrogates and model selector say next to what is hidden; everywhere if it is everywhere, or
/// nothing is hidden.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paper {
    /// Median of the best matches' mean absolute percentage error (paper, eq. 10; 0.05 is 5 %).
    pub mape: f64,
    /// Whether all six parameters of every sleeper lie inside Table D1 of the paper.
    pub inside: bool,
}

impl Paper {
    /// Of an evaluation; none where no sleeper next to it was evaluated.
    pub fn of(scene: &Scene, evaluation: &Evaluation) -> Option<Self> {
        let near: Vec<&SleeperEvaluation> =
            evaluation.sleepers.iter().filter(|sleeper| near(scene, sleeper.x_m)).collect();
        let best = near.iter().filter_map(|sleeper| sleeper.selector.mape.first().copied());
        let mut errors: Vec<f64> = best.collect();
        errors.sort_by(f64::total_cmp);
        let mape = *errors.get(errors.len() / 2)?;
        Some(Self { mape, inside: near.into_iter().all(is_inside) })
    }
}

fn is_inside(sleeper: &SleeperEvaluation) -> bool {
    sleeper.estimates.iter().all(|(&parameter, estimate)| {
        let Axis { low, high, .. } = Preset::VTrack.axis(parameter);
        (low..=high).contains(&estimate.mean)
    })
}
