//! Whether the paper's own pipeline looks content with a recording in which something is hidden.

use crate::score::near;
use serde::{Deserialize, Serialize};
use tracktwin_evaluation::{Evaluation, SleeperEvaluation};
use tracktwin_parameters::{Axis, Preset};
use tracktwin_truth::Scene;

/// What surrogates and model selector say next to what is hidden; everywhere if it is everywhere, or
/// nothing is hidden.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paper {
    /// Mean absolute percentage error of each sleeper's best match (paper, eq. 10; 0.05 is 5 %),
    /// ascending; of one sleeper at least.
    pub mape: Vec<f64>,
    /// Whether all six parameters of every sleeper lie inside Table D1 of the paper.
    pub inside: bool,
}

impl Paper {
    /// Of an evaluation; none where no sleeper next to it was evaluated.
    pub fn of(scene: &Scene, evaluation: &Evaluation) -> Option<Self> {
        let near: Vec<&SleeperEvaluation> =
            evaluation.sleepers.iter().filter(|sleeper| near(scene, sleeper.x_m)).collect();
        let best = near.iter().filter_map(|sleeper| sleeper.selector.mape.first().copied());
        let mut mape: Vec<f64> = best.collect();
        mape.sort_by(f64::total_cmp);
        (!mape.is_empty()).then(|| Self { mape, inside: near.into_iter().all(is_inside) })
    }

    /// Whether it looks content where an error of a single sleeper is usual up to this.
    pub fn is_content(&self, usual: f64) -> bool {
        self.inside && self.mape[self.mape.len() / 2] <= usual
    }
}

fn is_inside(sleeper: &SleeperEvaluation) -> bool {
    sleeper.estimates.iter().all(|(&parameter, estimate)| {
        let Axis { low, high, .. } = Preset::VTrack.axis(parameter);
        (low..=high).contains(&estimate.mean)
    })
}
