//! Hidden physics of a scene: kinds, places and sizes, as in the files of truth.
//!
//! This module contains the list of effects. Other modules apply each effect to track, vehicle, surface
//! or recording.

use serde::{Deserialize, Serialize};

/// One hidden effect.
///
/// In JSON the name is the field `physics` of the object with the values. Names and meanings are those
/// of the catalogue of extensions:
/// `{"physics": "sleeper_bolt", "sleepers": [8], "stiffness_N_per_m": 3e7}`. Sleeper `i`, from 0, is at
/// `(i + 1)` spacings. A point of the rail has two equal values of `x_m`.
#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
#[serde(tag = "physics", rename_all = "snake_case", deny_unknown_fields)]
pub enum Hidden {
    /// Dip `d exp(-|x - x0| / l)` of the surface over a rail that bends more easily.
    RailJoint {
        /// Position in m; both values are equal.
        x_m: [f64; 2],
        /// Depth `d` of the dip in m.
        dip_m: f64,
        /// Distance `l` in m over which the dip falls to 1/e.
        length_m: f64,
        /// Ratio of the bending stiffness at the joint to that of the rail, 0 to 1.
        bending_factor: f64,
        /// Length in m of the softened part of the rail.
        #[serde(default = "joint_bending_length_m")]
        bending_length_m: f64,
    },
    /// Hollow `d/2 (1 + cos 2 pi (x - x0) / l)` of the railhead over the length `l`.
    Squat {
        /// Position in m; both values are equal.
        x_m: [f64; 2],
        /// Depth `d` in m.
        depth_m: f64,
        /// Length `l` in m.
        length_m: f64,
    },
    /// Waves `A sin(2 pi x / L)` of the surface on a stretch, faded over two waves at its ends.
    Corrugation {
        /// Start and end of the stretch in m.
        x_m: [f64; 2],
        /// Wavelength `L` in m.
        wavelength_m: f64,
        /// Amplitude `A` in m.
        amplitude_m: f64,
    },
    /// Worn flat of length `l` on the tread, `l² / (16 R)` deep, met once a turn; every pass begins
    /// with another side of the wheel down.
    WheelFlat {
        /// Length in m.
        length_m: f64,
    },
    /// Waves `a cos(n x / R + phi)` around the tread, `phi` another in every pass.
    WheelOutOfRound {
        /// Number of waves per revolution.
        order: u32,
        /// Amplitude in m.
        amplitude_m: f64,
    },
    /// Springs beside the railpad and against the rail's rotation at some sleepers.
    FasteningClamp {
        /// Indices of the sleepers, from 0.
        sleepers: Vec<usize>,
        /// Stiffness beside the railpad in N/m.
        #[serde(rename = "vertical_N_per_m")]
        vertical_n_per_m: f64,
        /// Stiffness against rotation in N m/rad.
        #[serde(rename = "rotational_N_m_per_rad")]
        rotational_n_m_per_rad: f64,
    },
    /// Railpads that have lost most of their stiffness, and damping in proportion.
    MissingRailpad {
        /// Indices of the sleepers, from 0.
        sleepers: Vec<usize>,
        /// Remaining stiffness in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
    },
    /// Springs that hold the free ends of sleepers to the ground.
    SleeperBolt {
        /// Indices of the sleepers, from 0.
        sleepers: Vec<usize>,
        /// Stiffness of a bolt in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
    },
    /// Sleepers with a gap between them and the ballast, which only pushes.
    HangingSleeper {
        /// Indices of the sleepers, from 0.
        sleepers: Vec<usize>,
        /// Gap of the unloaded track in m.
        gap_m: f64,
    },
    /// A mass under the ballast of a half sleeper, on a spring and damper of its own.
    SubgradeLayer {
        /// Indices of the sleepers, from 0. `None`: all sleepers.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sleepers: Option<Vec<usize>>,
        /// Mass in kg.
        mass_kg: f64,
        /// Stiffness to the ground in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
        /// Damping to the ground in N s/m.
        #[serde(rename = "damping_N_s_per_m")]
        damping_n_s_per_m: f64,
    },
    /// Part of the unsprung mass, with the sensor, on a spring beside the wheel.
    FlexibleAxleBox {
        /// Mass of the axle box in kg.
        mass_kg: f64,
        /// Stiffness in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
        /// Damping in N s/m.
        #[serde(rename = "damping_N_s_per_m")]
        damping_n_s_per_m: f64,
    },
    /// Railpads `k_p + k_1 i w tau / (1 + i w tau)`, all of them.
    FrequencyDependentRailpad {
        /// `k_1 / k_p`.
        stiffness_ratio: f64,
        /// `tau` in s.
        relaxation_time_s: f64,
    },
    /// Railpads of tangent stiffness `k_p (T / T_0)^gamma` under the load `T`, all of them.
    LoadDependentRailpad {
        /// `gamma`.
        exponent: f64,
        /// Load in N, beyond the toe load, at which the stiffness is `k_p`.
        #[serde(rename = "reference_load_N")]
        reference_load_n: f64,
        /// Load in N without any wheel.
        #[serde(rename = "toe_load_N")]
        toe_load_n: f64,
    },
    /// Compliance `1 / (k (1 - (f/f_c)² + i eta f/f_c))` in series with the contact.
    RailCrossSection {
        /// Resonance `f_c` in Hz.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Stiffness `k` in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
        /// Loss factor `eta` at the resonance.
        loss_factor: f64,
    },
    /// The sensor as an oscillator shaken at its foot.
    SensorMountResonance {
        /// Resonance in Hz.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Damping ratio.
        damping_ratio: f64,
    },
    /// Accelerations beyond a limit are recorded as the limit.
    Clipping {
        /// The limit in m/s2.
        limit_m_s2: f64,
    },
    /// A wrong gain: ratio of recorded to true acceleration.
    GainError {
        /// The factor.
        factor: f64,
        /// Index of the pass. `None`: all passes.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pass: Option<usize>,
    },
    /// Positions that are shifted, or stretched from the first sample on.
    PositionError {
        /// Recorded minus true position at the first sample in m.
        offset_m: f64,
        /// Ratio of recorded to true distance, minus one.
        scale: f64,
        /// Index of the pass. `None`: all passes.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pass: Option<usize>,
    },
    /// Hum of the electrical mains, with another phase in every pass.
    ElectricalHum {
        /// Its frequency in Hz.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Its amplitude in m/s2.
        amplitude_m_s2: f64,
    },
    /// A mass on a damped spring under the rail. Not in the catalogue.
    RailAbsorber {
        /// Position in m; both values are equal.
        x_m: [f64; 2],
        /// Mass in kg.
        mass_kg: f64,
        /// Frequency in Hz to which it is tuned.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Damping ratio.
        damping_ratio: f64,
    },
    /// Sleepers that are cracked under the rail: 20 mm of them keep a share of their bending
    /// stiffness.
    CrackedSleeper {
        /// Indices of the sleepers, from 0.
        sleepers: Vec<usize>,
        /// Ratio of the bending stiffness at the crack to that of the sleeper, 0 to 1.
        bending_factor: f64,
    },
    /// A spring between the rail seats of two sleepers. Not in the catalogue.
    LinkedSleepers {
        /// Indices of the two sleepers, from 0.
        sleepers: [usize; 2],
        /// Stiffness in N/m.
        #[serde(rename = "stiffness_N_per_m")]
        stiffness_n_per_m: f64,
    },
    /// A vibration mode of the wheel's disc: the rim, which bears the contact, as an oscillator on
    /// the rest of the wheel. Not in the catalogue.
    WheelMode {
        /// Frequency in Hz.
        #[serde(rename = "frequency_Hz")]
        frequency_hz: f64,
        /// Modal mass at the contact in kg.
        mass_kg: f64,
        /// Damping ratio.
        damping_ratio: f64,
    },
}

/// Default length in m of the softened part of the rail at a joint.
const fn joint_bending_length_m() -> f64 {
    0.025
}

impl Hidden {
    /// Name of the effect in files.
    pub const fn physics(&self) -> &'static str {
        match self {
            Self::RailJoint { .. } => "rail_joint",
            Self::Squat { .. } => "squat",
            Self::Corrugation { .. } => "corrugation",
            Self::WheelFlat { .. } => "wheel_flat",
            Self::WheelOutOfRound { .. } => "wheel_out_of_round",
            Self::FasteningClamp { .. } => "fastening_clamp",
            Self::MissingRailpad { .. } => "missing_railpad",
            Self::SleeperBolt { .. } => "sleeper_bolt",
            Self::HangingSleeper { .. } => "hanging_sleeper",
            Self::SubgradeLayer { .. } => "subgrade_layer",
            Self::FlexibleAxleBox { .. } => "flexible_axle_box",
            Self::FrequencyDependentRailpad { .. } => "frequency_dependent_railpad",
            Self::LoadDependentRailpad { .. } => "load_dependent_railpad",
            Self::RailCrossSection { .. } => "rail_cross_section",
            Self::SensorMountResonance { .. } => "sensor_mount_resonance",
            Self::Clipping { .. } => "clipping",
            Self::GainError { .. } => "gain_error",
            Self::PositionError { .. } => "position_error",
            Self::ElectricalHum { .. } => "electrical_hum",
            Self::RailAbsorber { .. } => "rail_absorber",
            Self::CrackedSleeper { .. } => "cracked_sleeper",
            Self::LinkedSleepers { .. } => "linked_sleepers",
            Self::WheelMode { .. } => "wheel_mode",
        }
    }

    /// Indices of the sleepers of the effect, if it acts at sleepers.
    pub fn sleepers(&self) -> Option<&[usize]> {
        match self {
            Self::FasteningClamp { sleepers, .. }
            | Self::MissingRailpad { sleepers, .. }
            | Self::SleeperBolt { sleepers, .. }
            | Self::HangingSleeper { sleepers, .. }
            | Self::CrackedSleeper { sleepers, .. } => Some(sleepers),
            Self::SubgradeLayer { sleepers, .. } => sleepers.as_deref(),
            Self::LinkedSleepers { sleepers, .. } => Some(sleepers),
            _ => None,
        }
    }

    /// Start and end of the effect along a track of this sleeper spacing, in m, if it has a place: the
    /// stretch of rail, or the distance from its first to its last sleeper.
    pub fn place(&self, spacing_m: f64) -> Option<[f64; 2]> {
        match self {
            Self::RailJoint { x_m, .. }
            | Self::Squat { x_m, .. }
            | Self::Corrugation { x_m, .. }
            | Self::RailAbsorber { x_m, .. } => Some(*x_m),
            _ => {
                let sleepers = self.sleepers()?;
                let x_m = |number: &usize| (number + 1) as f64 * spacing_m;
                Some([x_m(sleepers.iter().min()?), x_m(sleepers.iter().max()?)])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_the_names_of_the_catalogue() {
        let text = r#"{"physics":"fastening_clamp","sleepers":[10,14],"vertical_N_per_m":1.5e8,
                       "rotational_N_m_per_rad":3e5}"#;
        let hidden: Hidden = serde_json::from_str(text).unwrap();
        assert_eq!(hidden.physics(), "fastening_clamp");
        assert_eq!(hidden.sleepers(), Some(&[10, 14][..]));
        assert_eq!(hidden.place(0.125), Some([1.375, 1.875]));
        let back: serde_json::Value = serde_json::to_value(&hidden).unwrap();
        assert_eq!(back["physics"], hidden.physics());
        assert_eq!(back["rotational_N_m_per_rad"], 3e5);
    }

    #[test]
    fn a_value_that_is_not_known_is_refused() {
        let text = r#"{"physics":"squat","x_m":[2.0,2.0],"depth_m":1e-5,"width_m":0.1}"#;
        let error = serde_json::from_str::<Hidden>(text).unwrap_err().to_string();
        assert!(error.contains("width_m"), "{error}");
    }

    #[test]
    fn a_joint_has_the_usual_softened_length_where_nothing_is_said() {
        let text = r#"{"physics":"rail_joint","x_m":[2.4,2.4],"dip_m":8e-5,"length_m":0.02,
                       "bending_factor":0.15}"#;
        let Hidden::RailJoint { bending_length_m, .. } = serde_json::from_str(text).unwrap() else {
            panic!("another effect");
        };
        assert_eq!(bending_length_m, 0.025);
    }
}
