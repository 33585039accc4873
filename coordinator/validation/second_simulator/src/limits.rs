//! Limits of the hidden effects of this simulator.

use tracktwin_reference_simulator::{Hidden, Scene, TruthError};

/// Largest stiffness in N/m between two sleepers: its force is taken a step ahead.
const LINK_MAX: f64 = 4e8;
/// Largest resonance in Hz.
const RESONANCE_MAX_HZ: f64 = 20_000.0;
/// No largest value.
const ANY: f64 = f64::MAX;

/// Checks that the values of every hidden effect are within their limits.
///
/// # Errors
/// [`TruthError`] names the effect and its value.
pub(crate) fn check(scene: &Scene) -> Result<(), TruthError> {
    for (field, value, most) in scene.left_out.iter().flat_map(sizes) {
        if value.is_nan() || value <= 0.0 {
            return Err(TruthError::Value { field, value, form: "a positive number" });
        }
        if value > most {
            return Err(TruthError::TooLarge { field, value, most });
        }
    }
    Ok(())
}

/// Values of an effect that must be positive, with their names and the largest that can be.
fn sizes(hidden: &Hidden) -> Vec<(&'static str, f64, f64)> {
    match *hidden {
        Hidden::RailJoint { length_m, bending_factor, .. } => vec![
            ("rail_joint.length_m", length_m, ANY),
            ("rail_joint.bending_factor", bending_factor, 1.0),
        ],
        Hidden::Squat { length_m, .. } => vec![("squat.length_m", length_m, ANY)],
        Hidden::Corrugation { wavelength_m: wave, .. } => {
            vec![("corrugation.wavelength_m", wave, ANY)]
        }
        Hidden::MissingRailpad { stiffness_n_per_m: stiffness, .. } => {
            vec![("missing_railpad.stiffness_N_per_m", stiffness, ANY)]
        }
        Hidden::SubgradeLayer { mass_kg, stiffness_n_per_m, .. } => vec![
            ("subgrade_layer.mass_kg", mass_kg, ANY),
            ("subgrade_layer.stiffness_N_per_m", stiffness_n_per_m, ANY),
        ],
        Hidden::FrequencyDependentRailpad { stiffness_ratio: ratio, relaxation_time_s } => vec![
            ("frequency_dependent_railpad.stiffness_ratio", ratio, ANY),
            ("frequency_dependent_railpad.relaxation_time_s", relaxation_time_s, ANY),
        ],
        Hidden::LoadDependentRailpad { exponent, reference_load_n, .. } => vec![
            ("load_dependent_railpad.exponent", exponent, 1.0),
            ("load_dependent_railpad.reference_load_N", reference_load_n, ANY),
        ],
        Hidden::RailCrossSection { frequency_hz, stiffness_n_per_m, .. } => vec![
            ("rail_cross_section.frequency_Hz", frequency_hz, RESONANCE_MAX_HZ),
            ("rail_cross_section.stiffness_N_per_m", stiffness_n_per_m, ANY),
        ],
        Hidden::RailAbsorber { mass_kg, frequency_hz, .. } => vec![
            ("rail_absorber.mass_kg", mass_kg, ANY),
            ("rail_absorber.frequency_Hz", frequency_hz, RESONANCE_MAX_HZ),
        ],
        Hidden::CrackedSleeper { bending_factor, .. } => {
            vec![("cracked_sleeper.bending_factor", bending_factor, 1.0)]
        }
        Hidden::LinkedSleepers { stiffness_n_per_m: stiffness, .. } => {
            vec![("linked_sleepers.stiffness_N_per_m", stiffness, LINK_MAX)]
        }
        Hidden::FasteningClamp { .. }
        | Hidden::SleeperBolt { .. }
        | Hidden::HangingSleeper { .. } => Vec::new(),
        Hidden::WheelFlat { .. }
        | Hidden::WheelOutOfRound { .. }
        | Hidden::WheelMode { .. }
        | Hidden::FlexibleAxleBox { .. }
        | Hidden::SensorMountResonance { .. }
        | Hidden::Clipping { .. }
        | Hidden::GainError { .. }
        | Hidden::PositionError { .. }
        | Hidden::ElectricalHum { .. } => sizes_beside_the_track(hidden),
    }
}

/// The same of effects of vehicle and measuring chain.
fn sizes_beside_the_track(hidden: &Hidden) -> Vec<(&'static str, f64, f64)> {
    match *hidden {
        Hidden::WheelFlat { length_m } => vec![("wheel_flat.length_m", length_m, ANY)],
        Hidden::FlexibleAxleBox { mass_kg, stiffness_n_per_m, .. } => vec![
            ("flexible_axle_box.mass_kg", mass_kg, ANY),
            ("flexible_axle_box.stiffness_N_per_m", stiffness_n_per_m, ANY),
        ],
        Hidden::SensorMountResonance { frequency_hz, .. } => {
            vec![("sensor_mount_resonance.frequency_Hz", frequency_hz, RESONANCE_MAX_HZ)]
        }
        Hidden::Clipping { limit_m_s2 } => vec![("clipping.limit_m_s2", limit_m_s2, ANY)],
        Hidden::WheelMode { mass_kg, frequency_hz, .. } => vec![
            ("wheel_mode.mass_kg", mass_kg, ANY),
            ("wheel_mode.frequency_Hz", frequency_hz, RESONANCE_MAX_HZ),
        ],
        _ => Vec::new(),
    }
}
