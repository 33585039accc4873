//! Simulated passes over the tracks of the examples.

use crate::example::{Example, examples};
use crate::spectrum::SPEED_KM_H;
use crate::{Error, Figure};
use std::collections::BTreeMap;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::{Parameter, ParameterSet};
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_track::model::{Mesh, ModelError, Roughness, Support, Surface, TrackModel};
use tracktwin_track::time;

/// An example and its passes.
pub type RecordedExample = (Example, Recording);

/// Recordings of examples by figure.
pub type Recordings = BTreeMap<Figure, Vec<RecordedExample>>;

/// Spans from the first of nine sleepers to the last.
const SECTION_SPANS: usize = 8;

/// Spans between the examples' outer sleepers and the ends of the rail, at least: windows, margins
/// and the run-in fit in, and the ends are about as far off as in the library.
const END_SPANS: usize = 8;

/// Smallest number of spans of the track of a campaign that contains an example.
pub const EXAMPLE_SPANS: usize = SECTION_SPANS + 2 * END_SPANS;

/// Recordings of the examples of these figures. Each example has one surface from its seed, the same at
/// all speeds. Figures that use models have the speeds of the experiment, other figures the speed of the
/// paper. `at` receives the completed share, 0 to 1.
///
/// # Errors
/// [`Error::Model`], [`Error::Pass`] or [`Error::Signal`] if a track, a pass or a signal is invalid.
pub fn recordings(
    figures: &[Figure],
    experiment: &Experiment,
    at: &mut dyn FnMut(f64),
) -> Result<Recordings, Error> {
    let examples = figures.iter().flat_map(|&figure| examples(figure));
    let (evaluated, alone): (Vec<_>, Vec<_>) = examples.partition(|of| of.figure.needs_models());
    let alone_km_h = [SPEED_KM_H];
    let parts = [(evaluated, &experiment.speeds_km_h[..]), (alone, &alone_km_h[..])];
    let total: usize = parts.iter().map(|(of, speeds)| of.len() * speeds.len()).sum();
    let mut done = 0;
    let mut out = Recordings::new();
    for (examples, speeds_km_h) in parts.into_iter().filter(|part| !part.0.is_empty()) {
        let count = examples.len();
        let recorded = simulated(examples, experiment, speeds_km_h, &mut || {
            done += count;
            at(done as f64 / total as f64);
        })?;
        for (example, recording) in recorded {
            out.entry(example.figure).or_default().push((example, recording));
        }
    }
    Ok(out)
}

/// Recordings of these examples at these speeds; `next` is called after each speed.
fn simulated(
    examples: Vec<Example>,
    experiment: &Experiment,
    speeds_km_h: &[f64],
    next: &mut dyn FnMut(),
) -> Result<Vec<RecordedExample>, Error> {
    let example_track = ExampleTrack::new(experiment);
    let tracks = examples
        .iter()
        .map(|example| example_track.track(example))
        .collect::<Result<Vec<_>, _>>()?;
    let surfaces: Vec<Surface> = tracks
        .iter()
        .zip(&examples)
        .map(|(track, example)| example_track.surface(track, example))
        .collect();
    let mut passes = vec![Vec::new(); examples.len()];
    for &speed_km_h in speeds_km_h {
        let records = time::passes(&tracks, &example_track.pass(speed_km_h), &surfaces)?;
        for (passes, record) in passes.iter_mut().zip(records) {
            passes.push(recorded(record, speed_km_h)?);
        }
        next();
    }
    let recording = |(example, passes): (Example, Vec<Pass>)| {
        let recording = example_track.recording(&example.name, passes);
        (example, recording)
    };
    Ok(examples.into_iter().zip(passes).map(recording).collect())
}

/// Nine sleepers in the middle of the campaign's own track.
pub(crate) struct ExampleTrack<'a> {
    experiment: &'a Experiment,
    /// Span at whose end the first of the nine stands, counted from 1.
    first: usize,
}

impl<'a> ExampleTrack<'a> {
    pub(crate) fn new(experiment: &'a Experiment) -> Self {
        Self { experiment, first: (experiment.spans - SECTION_SPANS) / 2 }
    }

    fn spacing_m(&self) -> f64 {
        self.experiment.design.sleeper.spacing_m
    }

    /// Where a sleeper of the section stands, counted from 1.
    pub(crate) fn x_m(&self, sleeper: usize) -> f64 {
        (self.first + sleeper - 1) as f64 * self.spacing_m()
    }

    /// The track: what lies before the section is as its first sleeper, what lies behind as its
    /// last.
    pub(crate) fn track(&self, example: &Example) -> Result<TrackModel, ModelError> {
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

    fn surface(&self, track: &TrackModel, example: &Example) -> Surface {
        let level = example.sleepers[0][Parameter::IrregularityLevel];
        track.surface(&Roughness::between(level, self.experiment.wavelengths_m), example.seed)
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

fn recorded(record: time::PassRecord, speed_km_h: f64) -> Result<Pass, Error> {
    let position_m =
        (0..record.acceleration_m_s2.len()).map(|index| record.position_m(index)).collect();
    let signal = Signal::new(1.0 / record.time_step_s, record.acceleration_m_s2)?;
    Ok(Pass {
        file: format!("{speed_km_h} km/h"),
        speed_km_h,
        axle: None,
        signal,
        position_m,
        contact_loss_share: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::TrackDesign;

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
}
