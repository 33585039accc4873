//! From a library and models to the paper's figures: simulates its examples, asks the models.

use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::train;
use std::collections::BTreeMap;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};
use tracktwin_reproduction::{
    Compared, Error, EvaluatedExample, Example, Figure, Predictions, Results, SPEED_KM_H, Source,
};
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_signal::{FeatureSet, Signal};
use tracktwin_surrogate::{Tested, Trained, TrainingSet};
use tracktwin_track::model::{Mesh, Roughness, Support, Surface, TrackModel};
use tracktwin_track::time;

/// Why a figure can't be reproduced.
#[derive(Debug, thiserror::Error)]
pub enum ReproducingError {
    /// The library or the models lack something.
    #[error(transparent)]
    Figure(#[from] Error),
    /// The campaign's track is not the paper's.
    #[error(
        "the paper's figures are of V-Track, but the campaign's track has another design: use a \
             library of the built-in campaign"
    )]
    OtherTrack,
    /// The track of the campaign is too short for the examples.
    #[error(
        "the examples need {needed} spans, but the campaign's track has {spans}: use a \
             library of the built-in campaign, or omit fig16 to fig19"
    )]
    TooShort {
        /// Spans of the campaign's track.
        spans: usize,
        /// How many it takes.
        needed: usize,
    },
    /// An example can't be driven over.
    #[error("an example's pass: {0}")]
    Pass(#[from] time::PassError),
    /// Its acceleration is no signal.
    #[error("an example's acceleration: {0}")]
    Signal(#[from] tracktwin_signal::SignalError),
    /// It can't be evaluated.
    #[error(transparent)]
    Evaluation(#[from] tracktwin_evaluation::Error),
    /// Models and library don't fit.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
}

/// Spans between the examples' outer sleepers and the ends of the rail, at least: windows, margins
/// and the run-in fit in, and the ends are about as far off as in the library.
const END_SPANS: usize = 8;

/// Spans from the first of nine sleepers to the last.
const SECTION_SPANS: usize = 8;

/// Seed of the first example's surface; every other has the next.
const SEED: u64 = 1;

/// Refuses a campaign on another track than the paper's.
///
/// # Errors
/// [`ReproducingError::OtherTrack`] or [`ReproducingError::TooShort`].
pub fn check(experiment: &Experiment, figures: &[Figure]) -> Result<(), ReproducingError> {
    if experiment.design != TrackDesign::v_track() {
        return Err(ReproducingError::OtherTrack);
    }
    let (spans, needed) = (experiment.spans, SECTION_SPANS + 2 * END_SPANS);
    if spans < needed && figures.iter().any(|figure| figure.is_example()) {
        return Err(ReproducingError::TooShort { spans, needed });
    }
    Ok(())
}

/// A figure beside the paper's; none where it asks models and there are none.
///
/// # Errors
/// [`ReproducingError`].
pub fn compared(
    figure: Figure,
    results: &Results<'_>,
    evaluator: Option<&Evaluator>,
    recordings: Vec<(Example, Recording)>,
) -> Result<Option<Compared>, ReproducingError> {
    Ok(match (figure.source(), evaluator) {
        (Source::Results(compare), _) => Some(compare(results)?),
        (Source::Models(_) | Source::Examples(_), None) => None,
        (Source::Models(compare), Some(evaluator)) => {
            let models = evaluator.models();
            let tested = &tested(results.set, models)?;
            Some(compare(&Predictions { results, models, tested })?)
        }
        (Source::Examples(compare), Some(evaluator)) => {
            Some(compare(&evaluated(evaluator, recordings)?))
        }
    })
}

/// True and predicted values by the global feature at the paper's speed; none without its models.
fn tested(set: &TrainingSet, models: &Trained) -> Result<Vec<Tested>, ReproducingError> {
    let single = models.group(&[SPEED_KM_H], FeatureSet::Gf.name());
    let tested = single.map(|group| train::tested_by(set, models, group)).transpose()?;
    Ok(tested.unwrap_or_default())
}

/// Evaluations of the examples' recordings.
fn evaluated(
    evaluator: &Evaluator,
    recordings: Vec<(Example, Recording)>,
) -> Result<Vec<EvaluatedExample>, ReproducingError> {
    let told = |(example, recording)| {
        Ok(EvaluatedExample::new(example, &evaluator.evaluate(&recording)?)?)
    };
    recordings.into_iter().map(told).collect()
}

/// Recordings of these figures' examples, each example on a separate surface, the same at all
/// speeds; `at` gets the number of speeds done.
///
/// # Errors
/// [`ReproducingError`].
pub fn recordings(
    figures: &[Figure],
    experiment: &Experiment,
    at: &mut dyn FnMut(usize),
) -> Result<BTreeMap<Figure, Vec<(Example, Recording)>>, ReproducingError> {
    // All figures' examples are numbered, so that one alone has the surfaces it has among all.
    let all = Figure::ALL.iter().flat_map(|&figure| tracktwin_reproduction::examples(figure));
    let wanted = |(_, example): &(u64, Example)| figures.contains(&example.figure);
    let examples: Vec<(u64, Example)> = (SEED..).zip(all).filter(wanted).collect();
    let example_track = ExampleTrack::new(experiment);
    let tracks = examples
        .iter()
        .map(|(_, example)| example_track.track(example).map_err(Error::from))
        .collect::<Result<Vec<_>, _>>()?;
    let surfaces: Vec<Surface> = tracks
        .iter()
        .zip(&examples)
        .map(|(track, (seed, example))| example_track.surface(track, example, *seed))
        .collect();
    let mut passes = vec![Vec::new(); examples.len()];
    for (done, &speed_km_h) in experiment.speeds_km_h.iter().enumerate() {
        let records = time::passes(&tracks, &example_track.pass(speed_km_h), &surfaces)?;
        for (passes, record) in passes.iter_mut().zip(records) {
            passes.push(recorded(record, speed_km_h)?);
        }
        at(done + 1);
    }
    let mut out: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for ((_, example), passes) in examples.into_iter().zip(passes) {
        let recording = example_track.recording(&example.name, passes);
        out.entry(example.figure).or_default().push((example, recording));
    }
    Ok(out)
}

/// Nine sleepers in the middle of the campaign's own track.
struct ExampleTrack<'a> {
    experiment: &'a Experiment,
    /// Span at whose end the first of the nine stands, counted from 1.
    first: usize,
}

impl<'a> ExampleTrack<'a> {
    fn new(experiment: &'a Experiment) -> Self {
        Self { experiment, first: (experiment.spans - SECTION_SPANS) / 2 }
    }

    fn spacing_m(&self) -> f64 {
        self.experiment.design.sleeper.spacing_m
    }

    /// Where a sleeper of the section stands, counted from 1.
    fn x_m(&self, sleeper: usize) -> f64 {
        (self.first + sleeper - 1) as f64 * self.spacing_m()
    }

    /// The track: what lies before the section is as its first sleeper, what lies behind as its
    /// last.
    fn track(&self, example: &Example) -> Result<TrackModel, tracktwin_track::model::ModelError> {
        let Experiment { design, spans, sleeper_elements, .. } = self.experiment;
        let count = example.sleepers.len();
        let set_of = |number: usize| -> &ParameterSet {
            &example.sleepers[number.saturating_sub(self.first).min(count - 1)]
        };
        // Supports begin behind the first span.
        let supports: Vec<_> = (1..*spans).map(|number| Support::from(set_of(number))).collect();
        let mesh =
            Mesh { rail_elements: self.rail_elements(), sleeper_elements: *sleeper_elements };
        TrackModel::build(design, &mesh, &supports, &[])
    }

    /// Rail elements span by span: the example's inside the section, the campaign's outside.
    fn rail_elements(&self) -> Vec<usize> {
        let elements = |span: usize| match (span + 1).checked_sub(self.first) {
            Some(sleeper) if (1..=SECTION_SPANS).contains(&sleeper) => {
                Example::elements(sleeper, self.spacing_m())
            }
            _ => self.experiment.rail_elements_per_span,
        };
        (0..self.experiment.spans).map(elements).collect()
    }

    fn surface(&self, track: &TrackModel, example: &Example, seed: u64) -> Surface {
        let level = example.sleepers[0][Parameter::IrregularityLevel];
        track.surface(&Roughness::between(level, self.experiment.wavelengths_m), seed)
    }

    /// From the run-in before the first sleeper's window to the margin behind the last one's.
    fn pass(&self, speed_km_h: f64) -> time::Pass {
        let speed_m_s = speed_km_h / 3.6;
        // A spacing instead of half of one: the margins come out whole.
        let beside_m = self.spacing_m() + self.experiment.features.margin_s * speed_m_s;
        time::Pass {
            speed_m_s,
            start_m: self.x_m(1) - beside_m - self.experiment.run_in_spans * self.spacing_m(),
            end_m: self.x_m(1 + SECTION_SPANS) + beside_m,
            time_step_s: self.experiment.time_step_s,
            local_flexibility: self.experiment.local_flexibility,
        }
    }

    fn recording(&self, name: &str, passes: Vec<Pass>) -> Recording {
        let sleeper = |number| Sleeper { id: Example::sleeper(number), x_m: self.x_m(number) };
        Recording {
            name: name.to_owned(),
            sample_rate_hz: 1.0 / self.experiment.time_step_s,
            channel: String::new(),
            passes,
            sleepers: (1..=1 + SECTION_SPANS).map(sleeper).collect(),
            nominal: serde_json::Map::new(),
            spacing_m: self.spacing_m(),
            doubts: Vec::new(),
        }
    }
}

fn recorded(record: time::PassRecord, speed_km_h: f64) -> Result<Pass, ReproducingError> {
    let position_m =
        (0..record.acceleration_m_s2.len()).map(|index| record.position_m(index)).collect();
    let signal = Signal::new(1.0 / record.time_step_s, record.acceleration_m_s2)?;
    Ok(Pass {
        file: format!("{speed_km_h} km/h"),
        speed_km_h,
        signal,
        position_m,
        contact_loss_share: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_section_lies_in_the_middle_with_its_own_mesh_and_its_own_stiffness() {
        let experiment = Experiment::new(TrackDesign::v_track());
        let example_track = ExampleTrack::new(&experiment);
        assert!((example_track.x_m(5) - 2.5).abs() < 1e-12, "the fifth of nine is in the middle");
        let elements = example_track.rail_elements();
        assert_eq!(elements.len(), 40);
        assert_eq!(elements[15..=24], [4, 417, 417, 417, 417, 20, 20, 20, 20, 4]);
        for speed_km_h in [7.0, 13.0] {
            let pass = example_track.pass(speed_km_h);
            assert!(pass.start_m > 0.0 && pass.end_m < 5.0);
            let margin_m = experiment.features.margin_s * speed_km_h / 3.6;
            assert!(pass.end_m - example_track.x_m(9) > margin_m + 0.5 * example_track.spacing_m());
        }
    }

    #[test]
    fn another_track_and_one_that_is_too_short_are_refused() {
        let other = Experiment::new(TrackDesign::v_track().enlarged(5.0));
        assert!(matches!(check(&other, &[]), Err(ReproducingError::OtherTrack)));
        let short = Experiment { spans: 22, ..Experiment::new(TrackDesign::v_track()) };
        assert!(check(&short, &[Figure::Fig12]).is_ok());
        let message = check(&short, &[Figure::Fig16]).unwrap_err().to_string();
        assert!(message.contains("24 spans"), "{message}");
    }
}
