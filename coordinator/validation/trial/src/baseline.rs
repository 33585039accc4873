//! The fitted baseline: errors of its stiffnesses, and whether it looks well.

use crate::known::is_artefact;
use crate::place::near;
use serde::{Deserialize, Serialize};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_parameters::{Parameter, Preset};
use tracktwin_reference_simulator::{Hidden, Scene};

/// Deviations of the null simulations above which a cell is visibly anomalous.
const CELL_DEVIATIONS: f64 = 3.5;

/// Mean absolute error of the logarithms of railpad and ballast stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bias {
    /// Error of the fitted baseline.
    pub before: f64,
    /// Error with the accepted hypotheses in the model.
    pub after: f64,
}

/// Errors at the sleepers next to hidden effects; the truth of a missing railpad is what is left of it. All sleepers
/// count if an effect acts everywhere.
pub(crate) fn bias(scene: &Scene, diagnosis: &Diagnosis) -> Option<Bias> {
    if scene.left_out.iter().all(is_artefact) {
        return None;
    }
    let spacing_m = scene.spacing_m();
    let (mut before, mut after, mut count) = (0.0, 0.0, 0.0);
    for sleeper in diagnosis.track.iter().filter(|sleeper| near(scene, sleeper.x_m)) {
        let number = (sleeper.x_m / spacing_m).round() as usize;
        let Some(truth) = number.checked_sub(1).and_then(|n| scene.sleepers.get(n)) else {
            continue;
        };
        let error = |value: f64, truth: f64| (value / truth).ln().abs();
        let (railpad, ballast) = (&sleeper.railpad_stiffness, &sleeper.ballast_stiffness);
        let left = scene.left_out.iter().find_map(|it| left_of_railpad(it, number - 1));
        let true_railpad = left.unwrap_or(truth.railpad_stiffness_n_m);
        before += error(railpad.before.mean, true_railpad)
            + error(ballast.before.mean, truth.ballast_stiffness_n_m);
        after += error(railpad.after.mean, true_railpad)
            + error(ballast.after.mean, truth.ballast_stiffness_n_m);
        count += 2.0;
    }
    (count > 0.0).then(|| Bias { before: before / count, after: after / count })
}

/// What a hidden effect leaves of the railpad stiffness of a sleeper, in N/m.
fn left_of_railpad(hidden: &Hidden, sleeper: usize) -> Option<f64> {
    match hidden {
        Hidden::MissingRailpad { sleepers, stiffness_n_per_m } => {
            sleepers.contains(&sleeper).then_some(*stiffness_n_per_m)
        }
        _ => None,
    }
}

/// Whether the baseline of every sleeper lies inside the usual ranges of the track: of V-Track, Table D1 of
/// the paper.
pub(crate) fn parameters_inside(preset: Preset, diagnosis: &Diagnosis) -> bool {
    let track = preset.track();
    let inside = |parameter: Parameter, value: f64| {
        let [low, high] = track.ranges[parameter.index()];
        (low..=high).contains(&value)
    };
    diagnosis.track.iter().all(|sleeper| {
        inside(Parameter::RailpadStiffness, sleeper.railpad_stiffness.before.mean)
            && inside(Parameter::BallastStiffness, sleeper.ballast_stiffness.before.mean)
    })
}

/// Whether no level of the fitted baseline is far beyond the random variation.
pub(crate) fn cells_inside(diagnosis: &Diagnosis) -> bool {
    let levels = &diagnosis.levels;
    let speeds = levels.measured_db.iter().zip(&levels.before_db).zip(&levels.scatter_db);
    speeds.into_iter().all(|((measured, before), scatter)| {
        measured.iter().zip(before).all(|(measured, before)| {
            let cells = measured.iter().zip(before).zip(scatter);
            let is_inside = |m: f64, b: f64, sd: f64| (m - b).abs() <= CELL_DEVIATIONS * sd;
            cells.into_iter().all(|((m, b), sd)| sd.is_none_or(|sd| is_inside(*m, *b, sd)))
        })
    })
}
