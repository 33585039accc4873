//! Simulation of a case: parameters, track model, one pass per speed, signal, features.

use crate::ExperimentError;
use crate::experiment::{Experiment, Stretch, metres_per_second};
use crate::outcome::{Outcome, PassFeatures};
use std::ops::Range;
use tracktwin_parameters::{Case, Parameter};
use tracktwin_signal::{Extractor, FeatureError, Features, Signal, SignalError};
use tracktwin_track::extension::{InstanceError, Measured};
use tracktwin_track::model::{Mesh, ModelError, Roughness, Support, Surface, TrackModel};
use tracktwin_track::time::{self, Pass, PassError, PassRecord};

/// Simulator of cases: the track model, or a substitute in tests of the farm.
pub trait Simulate: Send + Sync {
    /// Returns one outcome per case, in the order of the cases.
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome>;
}

/// Function that creates a simulator for an experiment.
pub type Prepare = fn(&Experiment) -> Result<Box<dyn Simulate>, ExperimentError>;

/// A simulator of one experiment, for any number of cases.
///
/// The outcome of a case depends, to the bit, only on the case and the experiment. It does not depend on
/// other cases simulated in the same call.
pub struct Simulation {
    experiment: Experiment,
    extractor: Extractor,
}

/// Creates a [`Simulation`] as a boxed [`Simulate`].
///
/// # Errors
/// The errors of [`Simulation::new`].
pub fn prepare_simulation(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Simulation::new(experiment)?))
}

/// Why a case has no result.
#[derive(Debug, thiserror::Error)]
enum CaseError {
    #[error("track model: {0}")]
    Model(#[from] ModelError),
    #[error("extension: {0}")]
    Extension(#[from] InstanceError),
    #[error("pass at {speed_km_h} km/h: {source}")]
    Pass { speed_km_h: f64, source: PassError },
    #[error("acceleration at {speed_km_h} km/h: {source}")]
    Signal { speed_km_h: f64, source: SignalError },
    #[error("features at {speed_km_h} km/h: {source}")]
    Features { speed_km_h: f64, source: FeatureError },
    #[error("features at {speed_km_h} km/h are not finite: the accelerations diverge")]
    NotFinite { speed_km_h: f64 },
}

impl Simulate for Simulation {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        let separately =
            || cases.iter().flat_map(|case| self.simulate(std::slice::from_ref(case))).collect();
        if cases.len() > 1 && self.experiment.varies_spacing() {
            return separately();
        }
        match self.together(cases) {
            Ok(outcomes) => outcomes,
            // One spoils it for the others: each for itself.
            Err(_) if cases.len() > 1 => separately(),
            Err(error) => vec![Outcome::Failed { reason: error.to_string() }; cases.len()],
        }
    }
}

impl Simulation {
    /// Prepares the data that all cases share.
    ///
    /// # Errors
    /// [`ExperimentError`] if the experiment is not possible.
    pub fn new(experiment: &Experiment) -> Result<Self, ExperimentError> {
        let experiment = experiment.clone().checked()?;
        let extractor = Extractor::new(&experiment.features)?;
        Ok(Self { experiment, extractor })
    }

    /// Simulates all cases together, one speed after another. All have the same sleeper spacing.
    fn together(&self, cases: &[Case]) -> Result<Vec<Outcome>, CaseError> {
        let Some(first) = cases.first() else { return Ok(Vec::new()) };
        let design = self.experiment.design_of(first);
        let models = cases.iter().map(|case| self.model(case)).collect::<Result<Vec<_>, _>>()?;
        let pairs = cases.iter().zip(&models);
        let surfaces: Vec<_> = pairs.map(|(case, model)| self.surface(case, model)).collect();
        let mut passes = vec![Vec::new(); cases.len()];
        for &speed_km_h in &self.experiment.speeds_km_h {
            let stretch = self.experiment.stretch(&design, speed_km_h);
            let records = time::passes(&models, &self.pass(stretch, speed_km_h), &surfaces)
                .map_err(|source| CaseError::Pass { speed_km_h, source })?;
            for ((passes, record), model) in passes.iter_mut().zip(records).zip(&models) {
                let kept = samples(stretch, &record)[0].start;
                let contact_loss_share = Some(record.contact_loss_share(kept));
                let features = self.features(&measured(record, model), stretch, speed_km_h)?;
                passes.push(PassFeatures { speed_km_h, features, contact_loss_share });
            }
        }
        Ok(passes.into_iter().map(Outcome::Finished).collect())
    }

    /// The track model of a case, with equal sleepers, and the design and extensions of the case.
    fn model(&self, case: &Case) -> Result<TrackModel, CaseError> {
        let Experiment { spans, rail_elements_per_span, sleeper_elements, .. } = &self.experiment;
        let design = &self.experiment.design_of(case);
        let mesh = Mesh::uniform(*spans, *rail_elements_per_span, *sleeper_elements);
        let supports = vec![Support::from(&case.parameters); spans - 1];
        let extensions = self.experiment.extensions_of(case);
        let built = extensions.iter().map(|extension| extension.build(design, *spans));
        let extensions = built.collect::<Result<Vec<_>, _>>()?;
        Ok(TrackModel::build(design, &mesh, &supports, &extensions)?)
    }

    /// The surface of the case, the same at every speed.
    fn surface(&self, case: &Case, model: &TrackModel) -> Surface {
        let level = case.parameters[Parameter::IrregularityLevel];
        let roughness = Roughness::between(level, self.experiment.wavelengths_m);
        model.surface(&roughness, case.surface_seed)
    }

    fn pass(&self, stretch: Stretch, speed_km_h: f64) -> Pass {
        Pass {
            speed_m_s: metres_per_second(speed_km_h),
            start_m: stretch.start_m,
            end_m: stretch.end_m,
            time_step_s: self.experiment.time_step_s,
            local_flexibility: self.experiment.local_flexibility,
        }
    }

    fn features(
        &self,
        record: &PassRecord,
        stretch: Stretch,
        speed_km_h: f64,
    ) -> Result<Features, CaseError> {
        let [kept, window] = samples(stretch, record);
        let samples = record.acceleration_m_s2[kept.start..].to_vec();
        let signal = Signal::new(1.0 / record.time_step_s, samples)
            .map_err(|source| CaseError::Signal { speed_km_h, source })?;
        let window = window.start - kept.start..window.end - kept.start;
        let features = self
            .extractor
            .extract(&signal, window)
            .map_err(|source| CaseError::Features { speed_km_h, source })?;
        // A finite signal may have a power that is not; the coordinator would refuse the message.
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if finite(&features.log_power) && finite(&features.band_levels_db) {
            Ok(features)
        } else {
            Err(CaseError::NotFinite { speed_km_h })
        }
    }
}

/// Samples of the kept stretch and of the window: from the first at or behind its beginning, as many as
/// fit.
fn samples(stretch: Stretch, record: &PassRecord) -> [Range<usize>; 2] {
    let step_m = record.speed_m_s * record.time_step_s;
    let sample = |x_m: f64| ((x_m - record.start_m) / step_m).ceil().max(0.0) as usize;
    let window = sample(stretch.window_m)..sample(stretch.window_end_m);
    [sample(stretch.kept_m)..record.acceleration_m_s2.len(), window]
}

/// The pass as the measuring chain records it, with the true positions of the wheel.
fn measured(mut record: PassRecord, model: &TrackModel) -> PassRecord {
    let mut measured = Measured {
        time_step_s: record.time_step_s,
        position_m: vec![0.0; record.acceleration_m_s2.len()],
        acceleration_m_s2: record.acceleration_m_s2,
        first: 0,
    };
    model.measure(&mut measured);
    record.acceleration_m_s2 = measured.acceleration_m_s2;
    record
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    /// One speed on a coarse mesh: what is tested is the way, not the physics.
    fn simulation() -> Simulation {
        let experiment = Experiment {
            rail_elements_per_span: 2,
            sleeper_elements: 2,
            speeds_km_h: vec![13.0],
            ..Experiment::new(TrackDesign::v_track())
        };
        Simulation::new(&experiment).unwrap()
    }

    fn case(index: u32) -> Case {
        let level = 1.0 + f64::from(index);
        let parameters = ParameterSet::nominal().with(Parameter::IrregularityLevel, level);
        Case { index, parameters, surface_seed: u64::from(index) }
    }

    #[test]
    fn a_case_s_outcome_does_not_depend_on_its_company() {
        let simulation = simulation();
        let cases: Vec<_> = (0..3).map(case).collect();
        let together = simulation.simulate(&cases);
        let alone: Vec<_> = cases.chunks(1).flat_map(|case| simulation.simulate(case)).collect();
        assert_eq!(together, alone);
        assert!(matches!(&together[0], Outcome::Finished(passes) if passes.len() == 1));
        assert_ne!(together[0], together[1]);
    }

    #[test]
    fn a_case_tells_for_how_long_its_wheel_was_in_the_air() {
        let share = |level: f64| {
            let parameters = ParameterSet::nominal().with(Parameter::IrregularityLevel, level);
            let outcomes = simulation().simulate(&[Case { parameters, ..case(1) }]);
            let Outcome::Finished(passes) = &outcomes[0] else { panic!("{outcomes:?}") };
            passes[0].contact_loss_share.unwrap()
        };
        assert_eq!(share(1.0), 0.0);
        let flying = share(3000.0);
        assert!(0.05 < flying && flying < 0.95, "{flying}");
    }

    #[test]
    fn half_of_the_cases_have_an_extension_and_it_changes_them() {
        let bolts = r#"{"physics": "sleeper_bolt", "share": 0.5, "stiffness_N_per_m": [1e7, 5e7]}"#;
        let mut experiment = simulation().experiment;
        experiment.extensions = vec![serde_json::from_str(bolts).unwrap()];
        let extended = Simulation::new(&experiment).unwrap();
        let with = |case: &Case| !experiment.extensions_of(case).is_empty();
        let cases: Vec<_> = (0..20).map(case).collect();
        let chosen = [cases.iter().find(|case| with(case)), cases.iter().find(|case| !with(case))];
        let chosen = chosen.map(|case| case.unwrap().clone());
        let (plain, bolted) = (simulation().simulate(&chosen), extended.simulate(&chosen));
        assert_ne!(plain[0], bolted[0]);
        assert_eq!(plain[1], bolted[1]);
    }

    #[test]
    fn cases_whose_design_differs_do_not_depend_on_their_company() {
        let mass = r#"{"number": "vehicle.mass_kg", "low": 40.0, "high": 48.0}"#;
        let spacing = r#"{"number": "track.sleeper.spacing_m", "low": 0.11, "high": 0.14}"#;
        for axes in [vec![mass], vec![mass, spacing]] {
            let mut experiment = simulation().experiment;
            experiment.design_axes =
                axes.iter().map(|axis| serde_json::from_str(axis).unwrap()).collect();
            let varied = Simulation::new(&experiment).unwrap();
            let cases: Vec<_> = (0..3).map(case).collect();
            let together = varied.simulate(&cases);
            for (case, outcome) in cases.iter().zip(&together) {
                let design = experiment.design_of(case);
                let alone = Experiment { design, design_axes: Vec::new(), ..experiment.clone() };
                let alone = Simulation::new(&alone).unwrap();
                assert_eq!(&alone.simulate(std::slice::from_ref(case))[0], outcome);
                assert!(matches!(outcome, Outcome::Finished(_)), "{outcome:?}");
            }
        }
    }

    #[test]
    fn a_case_that_cannot_be_is_a_result_and_spoils_no_other() {
        let impossible = ParameterSet::nominal().with(Parameter::RailpadStiffness, -1.0);
        let cases = [case(0), Case { parameters: impossible, ..case(1) }, case(2)];
        let outcomes = simulation().simulate(&cases);
        assert!(matches!(&outcomes[0], Outcome::Finished(_)));
        let Outcome::Failed { reason } = &outcomes[1] else { panic!("{:?}", outcomes[1]) };
        assert!(reason.starts_with("track model: "), "{reason}");
        assert_eq!(outcomes[2], simulation().simulate(&[case(2)])[0]);
    }

    #[test]
    fn the_window_is_one_spacing_centred_at_the_middle_sleeper() {
        let simulation = simulation();
        let stretch = simulation.experiment.stretch(&TrackDesign::v_track(), 13.0);
        let pass = simulation.pass(stretch, 13.0);
        let length = pass.steps() + 1;
        let record = PassRecord {
            time_step_s: pass.time_step_s,
            start_m: pass.start_m,
            speed_m_s: pass.speed_m_s,
            acceleration_m_s2: vec![0.0; length],
            contact_force_n: vec![0.0; length],
        };
        let [kept, window] = samples(stretch, &record);
        let step_m = pass.speed_m_s * pass.time_step_s;
        let centre = (window.start + window.end) as f64 / 2.0;
        // Within the half sample that whole samples allow at either end.
        assert!((pass.position_m(0) + step_m * centre - 2.5).abs() <= step_m);
        assert!((window.len() as f64 - 0.125 / step_m).abs() <= 1.0);
        // The margin is real signal: 0.06 s at 100 kHz.
        assert!((window.start - kept.start).abs_diff(6000) <= 1);
        assert!((kept.end - window.end).abs_diff(6000) <= 1);
        // Two spans of run-in.
        assert!((kept.start as f64 - 0.25 / step_m).abs() <= 1.0);
    }
}
