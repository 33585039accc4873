//! What the tests of several kinds share.

use super::{Extension, ExtensionInstance};
use crate::frequency::{ReceptancePoint, receptance};
use crate::model::{Mesh, Support, Surface, TrackModel};
use crate::time::{self, Pass};
use num_complex::Complex64;
use std::sync::Arc;
use tracktwin_parameters::{ParameterSet, TrackDesign};

/// Spans of the tracks that are tested on.
pub(super) const SPANS: usize = 12;

/// Frequencies in Hz at which receptances are compared.
pub(super) const FREQUENCIES_HZ: [f64; 4] = [0.0, 120.0, 700.0, 2800.0];

pub(super) fn instance(physics: &str) -> ExtensionInstance {
    ExtensionInstance::new(physics)
}

/// The extension on V-Track.
pub(super) fn extension(instance: &ExtensionInstance) -> Arc<dyn Extension> {
    instance.build(&TrackDesign::v_track(), SPANS).unwrap()
}

/// V-Track with the same support under every rail seat.
pub(super) fn track_on(support: Support, instances: &[ExtensionInstance]) -> TrackModel {
    let supports = vec![support; SPANS - 1];
    let extensions: Vec<_> = instances.iter().map(extension).collect();
    let (design, mesh) = (TrackDesign::v_track(), Mesh::uniform(SPANS, 4, 4));
    TrackModel::build(&design, &mesh, &supports, &extensions).unwrap()
}

/// V-Track at its nominal values.
pub(super) fn track(instances: &[ExtensionInstance]) -> TrackModel {
    track_on(Support::from(&ParameterSet::nominal()), instances)
}

pub(super) fn direct_receptance(model: &TrackModel, place: ReceptancePoint) -> Vec<Complex64> {
    receptance(model, place, place, &FREQUENCIES_HZ).unwrap()
}

/// Largest difference of two spectra, relative to the second, frequency by frequency.
pub(super) fn relative_distance(a: &[Complex64], b: &[Complex64]) -> f64 {
    let each = a.iter().zip(b).map(|(a, b)| (a - b).norm() / b.norm());
    each.fold(0.0, f64::max)
}

/// A pass over the middle of the track.
pub(super) fn pass_at(speed_m_s: f64) -> Pass {
    Pass { speed_m_s, start_m: 0.5, end_m: 0.95, time_step_s: 1e-5, local_flexibility: true }
}

/// Accelerations in m/s2 of a pass over a smooth rail.
pub(super) fn smooth_accelerations(model: &TrackModel, pass: &Pass) -> Vec<f64> {
    time::pass(model, pass, &Surface::smooth()).unwrap().acceleration_m_s2
}

/// Root mean square of the difference, relative to the second's.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    let power = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let difference = power(&mut a.iter().zip(b).map(|(x, y)| x - y));
    (difference / power(&mut b.iter().copied())).sqrt()
}

/// Checks that both solvers give the same pass, and that this pass differs from one without the
/// extension.
pub(super) fn assert_felt_alike_in_both_solvers(instance: &ExtensionInstance) {
    let pass = Pass { end_m: 0.8, ..pass_at(13.0 / 3.6) };
    let surface = Surface::rough(1, 3.0, 1.5);
    let (without, with) = (track(&[]), track(std::slice::from_ref(instance)));
    let run = |model: &TrackModel| time::pass(model, &pass, &surface).unwrap().acceleration_m_s2;
    let (without, reference) = (run(&without), run(&with));
    assert!(with.is_linear(), "{}", instance.physics);
    let fast = &time::passes(&[with], &pass, std::slice::from_ref(&surface)).unwrap()[0];
    let felt = distance(&without, &reference);
    assert!(felt > 0.01, "{}: {felt}", instance.physics);
    // Two roads to one solution: the rounding of 1e4 steps, as in the fast solver's own test.
    let difference = distance(&fast.acceleration_m_s2, &reference);
    assert!(difference < 1e-6, "{}: {difference}", instance.physics);
}

/// Checks that a wheel that rolls slowly over a long shape follows the shape: the acceleration is the
/// square of the speed times the curvature of the shape.
///
/// At 1 m/s a shape of 0.1 m excites the wheel at 10 Hz, far below the resonance of wheel and track at
/// 115 Hz. The dynamic part is below one in a hundred. Jumps of the curvature excite the resonance. The
/// test therefore compares the projection of the acceleration on the curvature, in which this vibration
/// averages out.
pub(super) fn assert_followed(instance: &ExtensionInstance, height_m: impl Fn(f64) -> f64) {
    let pass = Pass { time_step_s: 1e-4, ..pass_at(1.0) };
    let (without, with) = (track(&[]), track(std::slice::from_ref(instance)));
    let plain = smooth_accelerations(&without, &pass);
    let felt = smooth_accelerations(&with, &pass);
    let step_m = 1e-3;
    let curvature = |x: f64| {
        (height_m(x - step_m) - 2.0 * height_m(x) + height_m(x + step_m)) / (step_m * step_m)
    };
    let (mut product, mut square) = (0.0, 0.0);
    // From 0.1 m on: the surface has been eased in.
    for step in 1000..=pass.steps() {
        let expected = curvature(pass.position_m(step));
        product += expected * (felt[step] - plain[step]);
        square += expected * expected;
    }
    let share = product / square;
    assert!((share - 1.0).abs() < 0.05, "{}: {share}", instance.physics);
}
