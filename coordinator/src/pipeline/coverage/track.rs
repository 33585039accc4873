//! A simulated track with separate parameters at every sleeper, and its recording.

use serde_json::Map;
use std::ops::Range;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::{Parameter, ParameterSet};
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_signal::{Signal, SignalError};
use tracktwin_track::model::{Mesh, ModelError, Roughness, Support, TrackModel};
use tracktwin_track::time::{self, PassError};

/// Number of spans between the recorded part and the fixed ends of the rail.
const END_SPANS: usize = 8;
/// Conversion factor from m/s to km/h.
const KM_H: f64 = 3.6;

/// A track to be simulated.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// Parameters of every recorded sleeper.
    pub(super) sleepers: Vec<ParameterSet>,
    /// Seed of the surface.
    pub(super) surface_seed: u64,
}

/// Reasons for not simulating a track.
#[derive(Debug, thiserror::Error)]
pub enum TrackError {
    /// The track model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The pass over the track cannot be simulated.
    #[error(transparent)]
    Pass(#[from] PassError),
    /// The acceleration is not finite.
    #[error(transparent)]
    Signal(#[from] SignalError),
}

/// Position of the recorded part on the rail. It is equal for all tracks of one length.
struct Place {
    spans: usize,
    /// Numbers of the recorded sleepers. Sleeper `n` is at the end of `n` spans.
    numbers: Range<usize>,
    /// Length of the signal beyond the outer windows, in spans.
    margin_spans: usize,
}

impl Place {
    fn of(experiment: &Experiment, sleepers: usize) -> Self {
        let fastest_m_s = experiment.speeds_km_h.iter().copied().fold(0.0, f64::max) / KM_H;
        let margin_m = experiment.features.margin_s * fastest_m_s;
        let spacing_m = experiment.design.sleeper.spacing_m;
        let margin_spans = (margin_m / spacing_m).ceil() as usize + 1;
        let beside = END_SPANS + margin_spans + experiment.run_in_spans.ceil() as usize;
        let numbers = beside + 1..beside + 1 + sleepers;
        Self { spans: sleepers + 1 + 2 * beside, numbers, margin_spans }
    }
}

/// Records tracks of equal length, with one pass at each speed of the experiment.
///
/// Beyond the recorded sleepers, a track continues with the parameters of the outer ones.
///
/// # Errors
/// Returns the [`TrackError`] of a track that cannot be simulated.
pub(super) fn record(
    experiment: &Experiment,
    tracks: &[Track],
) -> Result<Vec<Recording>, TrackError> {
    let place = Place::of(experiment, tracks[0].sleepers.len());
    let models = tracks
        .iter()
        .map(|track| model(experiment, track, &place))
        .collect::<Result<Vec<_>, _>>()?;
    let surface = |(track, model): (&Track, &TrackModel)| {
        let level = track.sleepers[0][Parameter::IrregularityLevel];
        let roughness = Roughness::between(level, experiment.wavelengths_m);
        model.surface(&roughness, track.surface_seed)
    };
    let surfaces: Vec<_> = tracks.iter().zip(&models).map(surface).collect();
    let mut recordings = vec![empty(experiment, &place); tracks.len()];
    for &speed_km_h in &experiment.speeds_km_h {
        let (pass, from_m) = way(experiment, &place, speed_km_h);
        let records = time::passes(&models, &pass, &surfaces)?;
        for (recording, record) in recordings.iter_mut().zip(records) {
            let position = |index: usize| record.position_m(index);
            let count = record.acceleration_m_s2.len();
            let first = (0..count).find(|&index| position(index) >= from_m).unwrap_or(count);
            let samples = record.acceleration_m_s2[first..].to_vec();
            recording.passes.push(Pass {
                file: format!("simulated at {speed_km_h} km/h"),
                speed_km_h,
                axle: None,
                signal: Signal::new(recording.sample_rate_hz, samples)?,
                position_m: (first..count).map(position).collect(),
                contact_loss_share: None,
            });
        }
    }
    Ok(recordings)
}

fn model(experiment: &Experiment, track: &Track, place: &Place) -> Result<TrackModel, ModelError> {
    let Experiment { design, rail_elements_per_span, sleeper_elements, .. } = experiment;
    let mesh = Mesh::uniform(place.spans, *rail_elements_per_span, *sleeper_elements);
    let last = track.sleepers.len() - 1;
    let support = |number: usize| {
        let index = number.saturating_sub(place.numbers.start).min(last);
        Support::from(&track.sleepers[index])
    };
    let supports: Vec<_> = (1..place.spans).map(support).collect();
    TrackModel::build(design, &mesh, &supports, &[])
}

/// The wheel's pass at a speed, and the position at which the recording begins.
fn way(experiment: &Experiment, place: &Place, speed_km_h: f64) -> (time::Pass, f64) {
    let spacing_m = experiment.design.sleeper.spacing_m;
    let from_m = (place.numbers.start - 1 - place.margin_spans) as f64 * spacing_m;
    let pass = time::Pass {
        speed_m_s: speed_km_h / KM_H,
        start_m: from_m - experiment.run_in_spans * spacing_m,
        end_m: (place.numbers.end + place.margin_spans) as f64 * spacing_m,
        time_step_s: experiment.time_step_s,
        local_flexibility: experiment.local_flexibility,
    };
    (pass, from_m)
}

fn empty(experiment: &Experiment, place: &Place) -> Recording {
    let spacing_m = experiment.design.sleeper.spacing_m;
    let sleeper =
        |number: usize| Sleeper { id: format!("SN{number}"), x_m: number as f64 * spacing_m };
    Recording {
        name: "simulated".to_owned(),
        sample_rate_hz: 1.0 / experiment.time_step_s,
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: Vec::new(),
        sleepers: place.numbers.clone().map(sleeper).collect(),
        nominal: Map::new(),
        spacing_m,
        doubts: Vec::new(),
    }
}
