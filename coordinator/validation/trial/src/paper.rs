//! Test whether the method of the paper gives usual results for a recording with a hidden effect.

use crate::place::near;
use crate::rate::median;
use serde::{Deserialize, Serialize};
use tracktwin_evaluation::{Evaluation, SleeperEvaluation};
use tracktwin_parameters::Track;
use tracktwin_reference_simulator::Scene;

/// Share of the controls on which an error is usual, and how many it takes to say.
const USUAL: f64 = 0.95;
const CONTROLS_MIN: usize = 5;

/// Sleepers from which their median is that of a track.
const TRACK: usize = 10;

/// Results of surrogates and model selector at sleepers next to hidden effects. All sleepers count if an
/// effect acts everywhere or nothing is hidden.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paper {
    /// Mean absolute percentage error of the best match of each sleeper (paper, eq. 10; 0.05 is 5 %),
    /// ascending. There is at least one value.
    pub mape: Vec<f64>,
    /// Whether all six parameters of every sleeper are inside the usual ranges of the track: of V-Track, Table
    /// D1 of the paper.
    pub inside: bool,
}

impl Paper {
    /// The results of an evaluation. `None` if no sleeper next to a hidden effect was evaluated.
    pub fn of(scene: &Scene, evaluation: &Evaluation) -> Option<Self> {
        let near: Vec<&SleeperEvaluation> =
            evaluation.sleepers.iter().filter(|sleeper| near(scene, sleeper.x_m)).collect();
        let best = near.iter().filter_map(|sleeper| sleeper.selector.mape.first().copied());
        let mut mape: Vec<f64> = best.collect();
        mape.sort_by(f64::total_cmp);
        let track = scene.preset.track();
        let inside = near.into_iter().all(|sleeper| is_inside(sleeper, &track));
        (!mape.is_empty()).then_some(Self { mape, inside })
    }

    /// Median of the errors.
    fn median(&self) -> f64 {
        median(self.mape.clone()).expect("there is one sleeper at least")
    }
}

/// Errors of the model selector that are usual for controls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Usual {
    /// Limit for a single sleeper: 95 % of the sleepers of controls have a smaller error.
    sleeper: f64,
    /// Limit for the median of a track: 95 % of the controls have a smaller median.
    track: f64,
}

impl Usual {
    /// The limits from the errors of controls. `None` with too few controls.
    pub(crate) fn of(controls: &[&Paper]) -> Option<Self> {
        let tracks = controls.iter().map(|paper| paper.median()).collect();
        let sleepers = controls.iter().flat_map(|paper| paper.mape.iter().copied()).collect();
        Some(Self { sleeper: most(sleepers, CONTROLS_MIN)?, track: most(tracks, CONTROLS_MIN)? })
    }

    /// Whether the results of the paper's method are usual. A few sleepers are tested singly, more of
    /// them as a track.
    pub(crate) fn is_content(self, paper: &Paper) -> bool {
        let usual = if paper.mape.len() < TRACK { self.sleeper } else { self.track };
        paper.inside && paper.median() <= usual
    }
}

/// What a share of [`USUAL`] of so many values at least does not exceed.
fn most(mut values: Vec<f64>, least: usize) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = (USUAL * values.len() as f64).ceil() as usize;
    (values.len() >= least).then(|| values[last - 1])
}

fn is_inside(sleeper: &SleeperEvaluation, track: &Track) -> bool {
    sleeper.estimates.iter().all(|(&parameter, estimate)| {
        let [low, high] = track.ranges[parameter.index()];
        (low..=high).contains(&estimate.mean)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper(mape: Vec<f64>) -> Paper {
        Paper { mape, inside: true }
    }

    #[test]
    fn a_sleeper_is_judged_by_the_controls_sleepers_and_a_track_by_their_tracks() {
        // Tracks of 20 sleepers each, with medians from 0.11 to 0.15.
        let track = |n: usize| {
            let middle = (0..18).map(|_| 0.1 + 0.01 * n as f64);
            paper([0.05].into_iter().chain(middle).chain([0.4]).collect())
        };
        let tracks: Vec<Paper> = (1..=5).map(track).collect();
        let controls: Vec<&Paper> = tracks.iter().collect();
        let usual = Usual::of(&controls).unwrap();
        assert!(Usual::of(&controls[..4]).is_none());
        // Five of the hundred sleepers have 0.4.
        assert!((usual.sleeper - 0.15).abs() < 1e-12 && (usual.track - 0.15).abs() < 1e-12);
        assert!(usual.is_content(&paper(vec![0.1, 0.14, 0.9])));
        assert!(!usual.is_content(&paper(vec![0.16])));
        assert!(!usual.is_content(&paper(vec![0.2; 24])));
        assert!(!usual.is_content(&Paper { inside: false, ..paper(vec![0.1]) }));
    }
}
