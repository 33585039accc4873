//! One pass of the wheel: from rest at its start to its end.

use crate::TruthError;
use crate::pass_state::PassState;
use crate::scene::Scene;
use crate::surface::{WheelAngle, shapes};
use crate::track::Track;
use crate::vtrack;
use std::f64::consts::PI;

/// Time in s over which the surface grows from nothing, so that the wheel begins without a jump.
const EASE_S: f64 = 4e-3;

/// Speed and stretch of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// True speed in m/s.
    pub speed_m_s: f64,
    /// Start position of the wheel in m. The wheel starts in static equilibrium.
    pub start_m: f64,
    /// End position of the pass in m.
    pub end_m: f64,
    /// Initial angle of the wheel.
    pub angle: WheelAngle,
}

/// Record of a pass: one sample after every time step.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven {
    /// Time between samples in s.
    pub time_step_s: f64,
    /// Acceleration at the sensor on the axle box in m/s2, positive downwards.
    pub acceleration_m_s2: Vec<f64>,
    /// Contact force in N.
    pub contact_force_n: Vec<f64>,
    /// Position in m of the wheel at every sample.
    pub position_m: Vec<f64>,
}

/// Simulates a pass over the track of a scene. `height_m` returns the height of the surface in m,
/// positive downwards, at a position in m. The function adds the shapes of hidden effects.
///
/// # Errors
/// [`TruthError`] if the scene is invalid or the motion does not remain finite.
pub fn drive(
    scene: &Scene,
    drive: &Drive,
    height_m: impl Fn(f64) -> f64,
) -> Result<Driven, TruthError> {
    vtrack::check(scene)?;
    run(&Track::new(scene), scene, drive, height_m)
}

/// Simulates a pass over an existing track.
pub(crate) fn run(
    track: &Track,
    scene: &Scene,
    drive: &Drive,
    height_m: impl Fn(f64) -> f64,
) -> Result<Driven, TruthError> {
    let step_s = track.step_s;
    let steps = ((drive.end_m - drive.start_m) / (drive.speed_m_s * step_s)).floor() as usize;
    let felt = |x_m: f64| height_m(x_m) + shapes(scene, drive.angle, x_m);
    let first_m = felt(drive.start_m);
    let mut state = PassState::at_rest(track, drive.start_m);
    let mut driven = Driven {
        time_step_s: step_s,
        acceleration_m_s2: Vec::with_capacity(steps),
        contact_force_n: Vec::with_capacity(steps),
        position_m: Vec::with_capacity(steps),
    };
    for step in 1..=steps {
        let time_s = step as f64 * step_s;
        let x_m = drive.start_m + drive.speed_m_s * time_s;
        let ease = 0.5 * (1.0 - (PI * (time_s / EASE_S).min(1.0)).cos());
        let now = state
            .step(x_m, ease * (felt(x_m) - first_m))
            .ok_or(TruthError::Diverged { position_m: x_m })?;
        driven.acceleration_m_s2.push(now.acceleration_m_s2);
        driven.contact_force_n.push(now.force_n);
        driven.position_m.push(x_m);
    }
    Ok(driven)
}
