//! The way of a case: parameters, track model, a pass a speed, signal, features.

use crate::experiment::{Experiment, ExperimentError, metres_per_second};
use std::ops::Range;
use tracktwin_parameters::{Case, Parameter};
use tracktwin_protocol::{Outcome, PassFeatures};
use tracktwin_signal::{Extractor, FeatureError, Features, Signal, SignalError};
use tracktwin_track::model::{Mesh, ModelError, Roughness, Support, Surface, TrackModel};
use tracktwin_track::time::{self, Pass, PassError, PassRecord};

/// What turns cases into outcomes: the track model, or a stand-in where the farm is tested.
pub trait Simulate: Send + Sync {
    /// One outcome a case, in their order.
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome>;
}

/// How something that simulates is made for an experiment.
pub type Prepare = fn(&Experiment) -> Result<Box<dyn Simulate>, ExperimentError>;

/// An experiment, ready for any number of cases.
///
/// Pure: a case's outcome depends on the case and the experiment, to the bit, and on nothing else;
/// in particular not on the cases it is simulated with.
pub struct Simulation {
    experiment: Experiment,
    extractor: Extractor,
}

/// A [`Simulation`] as something that simulates.
///
/// # Errors
/// As [`Simulation::new`].
pub fn prepare_simulation(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Simulation::new(experiment)?))
}

/// Why a case has no result.
#[derive(Debug, thiserror::Error)]
enum CaseError {
    #[error("track model: {0}")]
    Model(#[from] ModelError),
    #[error("pass at {speed_km_h} km/h: {source}")]
    Pass { speed_km_h: f64, source: PassError },
    #[error("acceleration at {speed_km_h} km/h: {source}")]
    Signal { speed_km_h: f64, source: SignalError },
    #[error("features at {speed_km_h} km/h: {source}")]
    Features { speed_km_h: f64, source: FeatureError },
}

impl Simulate for Simulation {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        match self.together(cases) {
            Ok(outcomes) => outcomes,
            // One spoils it for the others: each for itself.
            Err(_) if cases.len() > 1 => {
                cases.iter().flat_map(|case| self.simulate(std::slice::from_ref(case))).collect()
            }
            Err(error) => vec![Outcome::Failed { reason: error.to_string() }; cases.len()],
        }
    }
}

impl Simulation {
    /// Prepares what all cases share.
    ///
    /// # Errors
    /// [`ExperimentError`] when it can't be done.
    pub fn new(experiment: &Experiment) -> Result<Self, ExperimentError> {
        let experiment = experiment.clone().checked()?;
        let extractor = Extractor::new(&experiment.features).map_err(|error| match error {
            FeatureError::Definition(error) => ExperimentError::Features(error),
            other => ExperimentError::Json { message: other.to_string() },
        })?;
        Ok(Self { experiment, extractor })
    }

    /// The cases side by side, a speed at a time.
    fn together(&self, cases: &[Case]) -> Result<Vec<Outcome>, CaseError> {
        let models = cases.iter().map(|case| self.model(case)).collect::<Result<Vec<_>, _>>()?;
        let surfaces: Vec<_> = cases.iter().map(|case| self.surface(case)).collect();
        let mut passes = vec![Vec::new(); cases.len()];
        for &speed_km_h in &self.experiment.speeds_km_h {
            let records = time::passes(&models, &self.pass(speed_km_h), &surfaces)
                .map_err(|source| CaseError::Pass { speed_km_h, source })?;
            for (passes, record) in passes.iter_mut().zip(&records) {
                let features = self.features(record, speed_km_h)?;
                passes.push(PassFeatures { speed_km_h, features });
            }
        }
        Ok(passes.into_iter().map(Outcome::Finished).collect())
    }

    /// The track, every sleeper alike.
    fn model(&self, case: &Case) -> Result<TrackModel, ModelError> {
        let Experiment { design, spans, rail_elements_per_span, sleeper_elements, .. } =
            &self.experiment;
        let mesh = Mesh::uniform(*spans, *rail_elements_per_span, *sleeper_elements);
        let supports = vec![Support::from(&case.parameters); spans - 1];
        TrackModel::build(design, &mesh, &supports, &[])
    }

    /// The surface that the wheel meets at every speed.
    fn surface(&self, case: &Case) -> Surface {
        let [shortest_m, longest_m] = self.experiment.wavelengths_m;
        let level = case.parameters[Parameter::IrregularityLevel];
        let length_m = self.experiment.spans as f64 * self.experiment.design.sleeper.spacing_m;
        Roughness { level, shortest_m, longest_m }.surface(case.surface_seed, length_m)
    }

    fn pass(&self, speed_km_h: f64) -> Pass {
        let stretch = self.experiment.stretch(speed_km_h);
        Pass {
            speed_m_s: metres_per_second(speed_km_h),
            start_m: stretch.start_m,
            end_m: stretch.end_m,
            time_step_s: self.experiment.time_step_s,
            local_flexibility: self.experiment.local_flexibility,
        }
    }

    fn features(&self, record: &PassRecord, speed_km_h: f64) -> Result<Features, CaseError> {
        let [kept, window] = self.samples(record, speed_km_h);
        let samples = record.acceleration_m_s2[kept.start..].to_vec();
        let signal = Signal::new(1.0 / record.time_step_s, samples)
            .map_err(|source| CaseError::Signal { speed_km_h, source })?;
        let window = window.start - kept.start..window.end - kept.start;
        self.extractor
            .extract(&signal, window)
            .map_err(|source| CaseError::Features { speed_km_h, source })
    }

    /// Samples of the kept stretch and of the window: from the first at or behind its beginning, as
    /// many as fit.
    fn samples(&self, record: &PassRecord, speed_km_h: f64) -> [Range<usize>; 2] {
        let stretch = self.experiment.stretch(speed_km_h);
        let step_m = record.speed_m_s * record.time_step_s;
        let sample = |x_m: f64| ((x_m - record.start_m) / step_m).ceil().max(0.0) as usize;
        let window = sample(stretch.window_m)..sample(stretch.window_end_m);
        [sample(stretch.kept_m)..record.acceleration_m_s2.len(), window]
    }
}
