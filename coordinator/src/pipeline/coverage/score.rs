//! Evaluations of tracks compared with the truth.

use super::plan::Kind;
use super::track::Track;
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_evaluation::Evaluation;
use tracktwin_parameters::Parameter;

/// Standard deviations on either side that hold 90 % of a normal distribution.
pub(super) const WIDTH_90: f64 = 1.644_853_626_951_472_7;

/// Result of the tracks of one row.
#[derive(Clone, Debug, Serialize)]
pub struct CoverageRow {
    /// Their kind.
    #[serde(flatten)]
    pub kind: Kind,
    /// How many there are.
    pub tracks: usize,
    /// Share of the tracks with any sleeper called outside.
    pub any_outside: f64,
    /// Share of the tracks with most sleepers called outside.
    pub most_outside: f64,
    /// Share of all sleepers called outside.
    pub sleepers_outside: f64,
    /// How often each parameter was named first as the one to widen, as a share of the tracks.
    pub widen: BTreeMap<Parameter, f64>,
    /// Scatter that the evaluations assumed, mean over the tracks.
    pub assumed_scatter: f64,
    /// How the estimates of sleepers that were not called outside compare with the truth.
    pub estimates: BTreeMap<Parameter, Compared>,
    /// The same for all sleepers; where the two differ much, refusals matter.
    pub estimates_of_all: BTreeMap<Parameter, Compared>,
}

/// Estimates of one parameter against the truth.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Compared {
    /// Sleepers compared.
    pub sleepers: usize,
    /// Mean of the estimates, in the parameter's unit.
    pub mean: f64,
    /// Mean standard deviation over the truth.
    pub relative_sd: f64,
    /// Mean absolute error over the truth.
    pub relative_error: f64,
    /// Share of truths inside the 90 % interval.
    pub holds_90: f64,
    /// The same with the standard deviations of an even track.
    pub holds_90_if_even: f64,
    /// Part of a sleeper's own deviation from its track's mean that its estimate lacks; none where
    /// sleepers are alike.
    pub missed: Option<f64>,
    /// Standard deviation of the estimates along a track, in the logarithm.
    pub along: f64,
}

/// A track and its evaluation.
pub(super) type Answer = (Track, Evaluation);

/// The row of these answers.
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

/// Sums over sleepers, on their way to means.
#[derive(Default)]
struct Sums {
    sleepers: f64,
    mean: f64,
    sd: f64,
    error: f64,
    held: f64,
    held_without_unevenness: f64,
    /// Own deviation times itself, and times what the estimate lacks of it.
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
            let held = |sd: f64| f64::from(u8::from(error <= WIDTH_90 * sd));
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
