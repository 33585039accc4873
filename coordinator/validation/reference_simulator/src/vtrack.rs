//! The numbers of the test rig V-Track: rail S7, half sleepers, wheel.
//!
//! Copied from their sources, not from the twin: Shen et al. 2023 (Mech. Syst. Signal Process. 204,
//! 110730), section 2.4.1, appendix B.3 to B.5 and Table D1. One rail, half sleepers.

use crate::{Scene, TruthError};
use tracktwin_parameters::Preset;

/// Distance of the sleepers in m.
pub const SPACING_M: f64 = 0.125;

/// Young's modulus of steel in Pa.
pub(crate) const YOUNG_PA: f64 = 210e9;
/// Poisson's ratio of steel.
pub(crate) const POISSON: f64 = 0.3;
/// Density of steel in kg/m3.
pub(crate) const DENSITY_KG_M3: f64 = 7800.0;

/// Cross-section of the rail in m2.
pub(crate) const RAIL_AREA_M2: f64 = 8.65e-4;
/// Second moment of the rail's section in m4.
pub(crate) const RAIL_SECOND_MOMENT_M4: f64 = 5.15e-7;
/// Timoshenko shear coefficient of the rail.
pub(crate) const RAIL_SHEAR_COEFFICIENT: f64 = 0.34;
/// Lateral radius of the railhead in m.
pub(crate) const RAILHEAD_RADIUS_M: f64 = 0.06;

/// Length of a half sleeper in m; the rail seat lies at the symmetry plane.
pub(crate) const SLEEPER_HALF_LENGTH_M: f64 = 0.24;
/// Cross-section of a sleeper in m2.
pub(crate) const SLEEPER_AREA_M2: f64 = 6e-4;
/// Second moment of a sleeper's section in m4, for its rotary inertia and its shear stiffness,
/// which grows with the bending stiffness from here.
pub(crate) const SLEEPER_SECOND_MOMENT_M4: f64 = 1.125e-8;
/// Timoshenko shear coefficient of a sleeper, that of a rectangle.
pub(crate) const SLEEPER_SHEAR_COEFFICIENT: f64 = 5.0 / 6.0;

/// Unsprung mass in kg.
pub(crate) const WHEEL_MASS_KG: f64 = 44.0;
/// Load of the wheel in N, its weight included.
pub(crate) const WHEEL_LOAD_N: f64 = 4500.0;
/// Rolling radius in m.
pub(crate) const WHEEL_RADIUS_M: f64 = 0.065;

/// Shear modulus of steel in Pa.
pub(crate) const fn shear_modulus_pa() -> f64 {
    YOUNG_PA / (2.0 * (1.0 + POISSON))
}

/// Checks a scene, and that it is of V-Track.
pub(crate) fn check(scene: &Scene) -> Result<(), TruthError> {
    if scene.preset != Preset::VTrack {
        return Err(TruthError::NoTrack { preset: scene.preset.name() });
    }
    scene.check()
}
