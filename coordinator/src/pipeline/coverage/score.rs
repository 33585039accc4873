//! Comparison of evaluations with the true values.

use super::plan::Kind;
use super::track::Track;
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_evaluation::Evaluation;
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Result for the tracks of one row.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageRow {
    /// Kind of the tracks.
    #[serde(flatten)]
    pub kind: Kind,
    /// Number of tracks.
    pub tracks: usize,
    /// Share of the tracks with at least one sleeper flagged as outside the library.
    pub any_outside: f64,
    /// Share of the tracks with most sleepers flagged as outside the library.
    pub most_outside: f64,
    /// Share of all sleepers flagged as outside the library.
    pub sleepers_outside: f64,
    /// For each parameter: share of the tracks for which it was the first one whose range should be
    /// widened.
    pub widen: BTreeMap<Parameter, f64>,
    /// Unevenness that the evaluations assumed; mean over the tracks.
    pub assumed_scatter: f64,
    /// Comparison of valid estimates with the true values, by parameter.
    pub estimates: BTreeMap<Parameter, Compared>,
    /// As `estimates`, for all sleepers. A large difference between both shows the benefit of the flags.
    pub estimates_of_all: BTreeMap<Parameter, Compared>,
}

/// Comparison of one parameter's estimates with the true values.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Compared {
    /// Number of sleepers compared.
    pub sleepers: usize,
    /// Mean of the estimates, in the parameter's unit.
    pub mean: f64,
    /// Mean of standard deviation divided by true value.
    pub relative_sd: f64,
    /// Mean of absolute error divided by true value.
    pub relative_error: f64,
    /// Share of the true values inside the 90 % interval, 0 to 1.
    pub holds_90: f64,
    /// As `holds_90`, with the standard deviations for a track without unevenness.
    pub holds_90_if_even: f64,
    /// Missed share of the deviation of a sleeper from the mean of its track; 0 if the estimates follow it
    /// completely. `None` if the sleepers of a track are equal.
    pub missed: Option<f64>,
    /// Standard deviation of the logarithm of the estimates along a track.
    pub along: f64,
}

/// A track and its evaluation.
pub(super) type Answer = (Track, Evaluation);

/// Computes the row of these evaluations.
pub(super) fn row(kind: Kind, answers: &[Answer]) -> CoverageRow {
    let tracks = answers.len();
    let share = |of: &dyn Fn(&Evaluation) -> bool| {
        answers.iter().filter(|(_, evaluation)| of(evaluation)).count() as f64 / tracks as f64
    };
    let mean = |of: &dyn Fn(&Evaluation) -> f64| {
        answers.iter().map(|(_, evaluation)| of(evaluation)).sum::<f64>() / tracks as f64
    };
    let mut widen = BTreeMap::new();
    for first in answers.iter().filter_map(|(_, it)| it.outside_library.widen.first()) {
        *widen.entry(*first).or_insert(0.0) += 1.0 / tracks as f64;
    }
    let parameters = answers.first().map(|(_, it)| it.parameters()).unwrap_or_default();
    let compared =
        |all: bool| parameters.iter().map(|&of| (of, compare(of, answers, all))).collect();
    CoverageRow {
        kind,
        tracks,
        any_outside: share(&|it| it.outside_library.share > 0.0),
        most_outside: share(&|it| it.outside_library.is_most()),
        sleepers_outside: mean(&|it| it.outside_library.share),
        widen,
        assumed_scatter: mean(&|it| it.unevenness.scatter),
        estimates: compared(false),
        estimates_of_all: compared(true),
    }
}

/// Sums over sleepers, for computing means.
#[derive(Default)]
struct Sums {
    sleepers: f64,
    mean: f64,
    sd: f64,
    error: f64,
    held: f64,
    held_without_unevenness: f64,
    /// Sums of the squared deviation from the track's mean, and of the deviation times its missed part.
    own: f64,
    lacking: f64,
    along: f64,
    tracks: f64,
}

fn compare(parameter: Parameter, answers: &[Answer], all: bool) -> Compared {
    let mut sums = Sums::default();
    for (track, evaluation) in answers {
        sums.add(parameter, track, evaluation, all);
    }
    let share = |sum: f64| if sums.sleepers > 0.0 { sum / sums.sleepers } else { f64::NAN };
    Compared {
        sleepers: sums.sleepers as usize,
        mean: share(sums.mean),
        relative_sd: share(sums.sd),
        relative_error: share(sums.error),
        holds_90: share(sums.held),
        holds_90_if_even: share(sums.held_without_unevenness),
        missed: (sums.own > 1e-9).then(|| sums.lacking / sums.own),
        along: (sums.along / sums.tracks.max(1.0)).sqrt(),
    }
}

impl Sums {
    fn add(&mut self, parameter: Parameter, track: &Track, evaluation: &Evaluation, all: bool) {
        let truths: Vec<f64> = track.sleepers.iter().map(|set| set[parameter]).collect();
        let middle = truths.iter().map(|truth| truth.ln()).sum::<f64>() / truths.len() as f64;
        let mut logarithms = Vec::new();
        let pairs = evaluation.sleepers.iter().zip(&truths);
        for (sleeper, &truth) in pairs.filter(|(sleeper, _)| all || sleeper.is_valid()) {
            let Some(estimate) = sleeper.estimates.get(&parameter) else { continue };
            let even =
                sleeper.sd_without_unevenness.get(&parameter).copied().unwrap_or(estimate.sd);
            let error = (estimate.mean - truth).abs();
            let held = |sd: f64| f64::from(u8::from(error <= NORMAL_90 * sd));
            self.sleepers += 1.0;
            self.mean += estimate.mean;
            self.sd += estimate.sd / truth;
            self.error += error / truth;
            self.held += held(estimate.sd);
            self.held_without_unevenness += held(even);
            let own = truth.ln() - middle;
            self.own += own * own;
            self.lacking += own * (truth / estimate.mean).ln();
            logarithms.push(estimate.mean.ln());
        }
        if logarithms.len() > 1 {
            let n = logarithms.len() as f64;
            let mean = logarithms.iter().sum::<f64>() / n;
            let squares: f64 = logarithms.iter().map(|value| (value - mean).powi(2)).sum();
            self.along += squares / (n - 1.0);
            self.tracks += 1.0;
        }
    }
}
