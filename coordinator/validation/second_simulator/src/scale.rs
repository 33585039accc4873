//! What depends on the kind of track: the test rig at 1:5, or a line.
//!
//! This module contains lengths, grids and rates. Other modules contain the equations.

use crate::recorder;
use crate::scheme::STEP_S;
use tracktwin_parameters::{Preset, TrackDesign};
use tracktwin_reference_simulator::Scene;

/// Sizes of a simulation.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    /// Whether the track is a line.
    pub(crate) is_line: bool,
    /// Distance of the sleepers in m.
    pub(crate) spacing_m: f64,
    /// Cells of the rail's grid in a span.
    pub(crate) cells: usize,
    /// Viscous damping of the rail's bending in s.
    pub(crate) rail_damping_s: f64,
    /// Distance in m before the recorded stretch.
    pub(crate) run_in_m: f64,
    /// Way in m over which the surface rises from a plane as the wheels set off.
    pub(crate) fade_m: f64,
    /// Largest change of the speed within a pass, of its mean.
    pub(crate) speed_drift: f64,
    /// Distance of the surface's samples in m.
    pub(crate) grid_m: f64,
    /// Wave number in rad/m below which waves of the surface fade.
    pub(crate) leak: f64,
    /// Way in m between places where the odometer's error is drawn anew.
    pub(crate) wander_m: f64,
    /// Way in m over which ballast under a gap comes to its full stiffness.
    pub(crate) closing_m: f64,
    /// Samples per second.
    pub(crate) sample_rate_hz: f64,
}

/// Damping of the rig's rail in s: 0.06 % of critical damping at 1 kHz.
const RIG_DAMPING_S: f64 = 2e-7;

impl Scale {
    /// Of a scene's track.
    pub(crate) fn of(scene: &Scene) -> Self {
        let design = scene.design();
        match scene.preset {
            Preset::VTrack => Self::rig(&design),
            _ => Self::line(&design),
        }
    }

    /// Whether every step is a sample.
    pub(crate) fn is_sample_step(&self) -> bool {
        self.sample_rate_hz * STEP_S == 1.0
    }

    /// Steps after the recorded ones that the recorder's filter needs.
    pub(crate) fn steps_beyond(&self) -> usize {
        if self.is_sample_step() { 0 } else { recorder::REACH + 1 }
    }

    fn rig(design: &TrackDesign) -> Self {
        Self {
            is_line: false,
            spacing_m: design.sleeper.spacing_m,
            cells: 12,
            rail_damping_s: RIG_DAMPING_S,
            run_in_m: 0.4,
            fade_m: 0.15,
            speed_drift: 0.0,
            grid_m: 2e-5,
            leak: 3.0,
            wander_m: 0.7,
            closing_m: 2e-5,
            sample_rate_hz: 100_000.0,
        }
    }

    fn line(design: &TrackDesign) -> Self {
        let spacing_m = design.sleeper.spacing_m;
        Self {
            is_line: true,
            spacing_m,
            // A bending wave of 4 kHz has a length of 12 of them.
            cells: 16,
            rail_damping_s: design.rail_damping_s,
            // At 80 km/h, 0.16 s: ten periods of wheel and track against each other.
            run_in_m: 6.0 * spacing_m,
            fade_m: 2.0 * spacing_m,
            speed_drift: 0.03,
            // The contact patch leaves nothing of waves below 2 mm.
            grid_m: 2e-4,
            // Half of the power of waves of 3 m.
            leak: 2.1,
            wander_m: 6.0 * spacing_m,
            // Stones under a sleeper that was lifted settle over a tenth of a millimetre.
            closing_m: 1e-4,
            sample_rate_hz: 25_600.0,
        }
    }
}
