//! Tracks and surfaces of the paper's ranges.

use tracktwin_parameters::{Parameter, ParameterSet, Sequence, TrackDesign};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::Pass;

/// Length and mesh of a track.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    /// Sleeper spans.
    pub spans: usize,
    /// Rail elements in each.
    pub rail_elements: usize,
    /// Elements of a half sleeper.
    pub sleeper_elements: usize,
}

impl Track {
    /// A pass at 13 km/h over so many spans in the middle.
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

/// Tracks of so many parameter sets (Sobol points of Table D1's ranges), and a surface for each.
///
/// # Panics
/// When the points can't be had, which a fixed seed and few points exclude.
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

/// The paper's Table D1 at a point of the unit cube.
pub(crate) fn parameters(point: &[f64]) -> ParameterSet {
    let axes = Parameter::ALL.iter().zip(point);
    axes.fold(ParameterSet::nominal(), |set, (&parameter, x)| {
        let [low, high] = parameter.range();
        set.with(parameter, low + x * (high - low))
    })
}
