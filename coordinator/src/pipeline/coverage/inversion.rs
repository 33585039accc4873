//! Accuracy of the inversion on uneven tracks recorded by another simulator.

use crate::pipeline::compute::compute;
use crate::pipeline::invert::{InvertingError, invert};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_inversion::Inversion;
use tracktwin_library::Library;
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::{Parameter, Preset};
use tracktwin_reference_simulator::{Scene, SleeperTruth, TruthError};
use tracktwin_ring::correlation;
use tracktwin_trial::Making;

/// Unevenness: standard deviation of the logarithm of a stiffness from sleeper to sleeper.
const SCATTER: [f64; 3] = [0.05, 0.15, 0.3];

/// Reads the true value of a parameter at a sleeper of a scene.
type TruthOf = fn(&Scene, &SleeperTruth) -> f64;

/// The estimated parameters, with access to their true values.
const COMPARED: [(Parameter, TruthOf); 6] = [
    (Parameter::RailpadStiffness, |_, sleeper| sleeper.railpad_stiffness_n_m),
    (Parameter::BallastStiffness, |_, sleeper| sleeper.ballast_stiffness_n_m),
    (Parameter::IrregularityLevel, |scene, _| scene.irregularity_level),
    (Parameter::SleeperBendingStiffness, |_, sleeper| sleeper.sleeper_ei_n_m2),
    (Parameter::RailpadDamping, |scene, _| scene.railpad_damping_n_s_m),
    (Parameter::BallastDamping, |scene, _| scene.ballast_damping_n_s_m),
];

/// Number of sleepers at either end of a recording that are not scored, because of the run-in.
const ENDS: usize = 1;

/// Errors of measuring the coverage of the inversion.
#[derive(Debug, thiserror::Error)]
pub enum InversionCoverageError {
    /// A track can't be simulated.
    #[error("cannot simulate a track: {0}")]
    Track(#[from] TruthError),
    /// A recording can't be evaluated.
    #[error("cannot evaluate a simulated recording: {0}")]
    Inverting(#[from] InvertingError),
}

/// Result for all tracks of one unevenness.
#[derive(Clone, Debug, Serialize)]
pub struct InversionRow {
    /// Unevenness of railpad and ballast stiffness from sleeper to sleeper.
    pub scatter: f64,
    /// Number of tracks.
    pub tracks: u32,
    /// Share of the sleepers with estimates that are not valid, 0 to 1.
    pub invalid: f64,
    /// Comparison of the estimates with the true values, by parameter.
    pub estimates: BTreeMap<Parameter, InversionScore>,
}

/// Comparison of one parameter's estimates with the true values, over the sleepers of all tracks.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct InversionScore {
    /// Number of sleepers compared.
    pub sleepers: usize,
    /// Median absolute error of the natural logarithm.
    pub median_log_error: f64,
    /// Share of the true values inside the 90 % interval, 0 to 1.
    pub holds_90: f64,
    /// Correlation of the logarithms of estimates and true values along a track. It is the mean over the
    /// tracks where both vary; `None` if there is none.
    pub correlation: Option<f64>,
}

/// Simulates and evaluates `tracks` tracks for each unevenness. All makings record the same scenes. Progress is
/// reported as number of completed tracks and total number.
///
/// # Errors
/// Returns the [`InversionCoverageError`] of the first track that fails.
pub async fn inversion_rows(
    tracks: u32,
    seed: u64,
    making: Making,
    library: Option<&Library>,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Vec<InversionRow>, InversionCoverageError> {
    let total = SCATTER.len() as u64 * u64::from(tracks);
    let mut done = 0;
    let mut rows = Vec::new();
    for scatter in SCATTER {
        let mut scores = Scores::default();
        for number in 0..tracks {
            let scene = Scene::uneven(seed.wrapping_mul(1000) + u64::from(number), scatter);
            let mut recording = compute(|| making.simulate(&scene))?;
            recording.name = format!("track {number}");
            let track = Preset::VTrack.track();
            let inversion = invert(&recording, &track, None, library, &|_, _| ()).await?;
            scores.add(&scene, &inversion);
            done += 1;
            progress(done, total);
        }
        rows.push(scores.row(scatter, tracks));
    }
    Ok(rows)
}

/// The estimates of all tracks so far.
#[derive(Default)]
struct Scores {
    errors: BTreeMap<Parameter, Vec<f64>>,
    held: BTreeMap<Parameter, usize>,
    correlations: BTreeMap<Parameter, Vec<f64>>,
    sleepers: usize,
    invalid: usize,
}

impl Scores {
    fn add(&mut self, scene: &Scene, inversion: &Inversion) {
        let inner = ENDS..inversion.sleepers.len().saturating_sub(ENDS);
        let sleepers = &inversion.sleepers[inner];
        self.sleepers += sleepers.len();
        self.invalid += sleepers.iter().filter(|sleeper| !sleeper.is_valid()).count();
        for (parameter, truth_of) in COMPARED {
            let mut pairs = Vec::new();
            for sleeper in sleepers {
                let estimate = sleeper.estimates[&parameter];
                let truth = truth_of(scene, &scene.sleepers[number(&sleeper.id)]);
                let error = (estimate.mean / truth).ln();
                self.errors.entry(parameter).or_default().push(error.abs());
                let holds = (estimate.mean - truth).abs() <= NORMAL_90 * estimate.sd;
                *self.held.entry(parameter).or_default() += usize::from(holds);
                pairs.push((estimate.mean.ln(), truth.ln()));
            }
            self.correlations.entry(parameter).or_default().extend(correlation(&pairs));
        }
    }

    fn row(mut self, scatter: f64, tracks: u32) -> InversionRow {
        let mut estimates = BTreeMap::new();
        for (&parameter, errors) in &mut self.errors {
            errors.sort_by(f64::total_cmp);
            let correlations = &self.correlations[&parameter];
            let score = InversionScore {
                sleepers: errors.len(),
                median_log_error: errors[errors.len() / 2],
                holds_90: self.held[&parameter] as f64 / errors.len() as f64,
                correlation: (!correlations.is_empty())
                    .then(|| correlations.iter().sum::<f64>() / correlations.len() as f64),
            };
            estimates.insert(parameter, score);
        }
        let invalid = self.invalid as f64 / self.sleepers.max(1) as f64;
        InversionRow { scatter, tracks, invalid, estimates }
    }
}

/// Number in the name of a sleeper (`SN` and its number).
fn number(id: &str) -> usize {
    id.trim_start_matches("SN").parse().expect("the reference simulator numbers its sleepers")
}
