//! Tracks and surfaces within the paper's parameter ranges.

use tracktwin_parameters::{Parameter, ParameterSet, Sequence, TrackDesign};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::Pass;

/// Length and mesh of a track.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    /// Number of sleeper spans.
    pub spans: usize,
    /// Number of rail elements per span.
    pub rail_elements: usize,
    /// Number of elements of a half sleeper.
    pub sleeper_elements: usize,
}

impl Track {
    /// A pass at 13 km/h over this number of spans in the middle of the track.
    pub fn pass(self, spans: f64) -> Pass {
        let spacing_m = TrackDesign::v_track().sleeper.spacing_m;
        let start_m = (self.spans as f64 - spans) / 2.0 * spacing_m;
        Pass {
            speed_m_s: 13.0 / 3.6,
            start_m,
            end_m: start_m + spans * spacing_m,
            time_step_s: 1e-5,
            local_flexibility: true,
        }
    }
}

/// Tracks of `count` parameter sets (Sobol points in the ranges of Table D1), with a surface for each.
///
/// # Panics
/// Panics if the points cannot be computed, which does not happen with a fixed seed and few points.
pub fn cases(track: Track, count: u32) -> (Vec<TrackModel>, Vec<Surface>) {
    let design = TrackDesign::v_track();
    let mesh = Mesh::uniform(track.spans, track.rail_elements, track.sleeper_elements);
    let points = Sequence::OwenScrambled.points(0..count, Parameter::ALL.len(), 1);
    let model = |point: &Vec<f64>| {
        let supports = vec![Support::from(&parameters(point)); track.spans - 1];
        TrackModel::build(&design, &mesh, &supports, &[]).expect("the paper's ranges are physical")
    };
    let models = points.expect("few points on six axes").iter().map(model).collect();
    let length_m = track.spans as f64 * design.sleeper.spacing_m;
    let surface = |seed| Surface::rough(u64::from(seed), 3.0, length_m);
    (models, (0..count).map(surface).collect())
}

/// The parameters of the paper's Table D1 at a point of the unit cube.
pub(crate) fn parameters(point: &[f64]) -> ParameterSet {
    let axes = Parameter::ALL.iter().zip(point);
    axes.fold(ParameterSet::nominal(), |set, (&parameter, x)| {
        let [low, high] = parameter.range();
        set.with(parameter, low + x * (high - low))
    })
}
