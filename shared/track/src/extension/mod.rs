//! Extensions: physics beyond the model of the paper. Solvers, library and report use the same
//! definition.
//!
//! This module contains the trait, the registry of kinds and one file per kind. An extension adds itself
//! to the [`TrackModel`](crate::model::TrackModel). Solvers read the model and do not depend on the
//! kinds. The diagnosis decides which extension explains a recording.

mod instance;
mod kind;
mod kind_parameter;
mod measured;
mod registry;
mod sampled;
mod screening;
mod text;

mod clipping;
mod contact_patch_filter;
mod corrugation;
mod cracked_sleeper;
mod electrical_hum;
mod fastening_clamp;
mod flexible_axle_box;
mod frequency_dependent_railpad;
mod gain_error;
mod hanging_sleeper;
mod load_dependent_railpad;
mod missing_railpad;
mod position_error;
mod rail_cross_section;
mod rail_joint;
mod roughness_spectrum;
mod second_wheel;
mod sensor_mount_resonance;
mod sleeper_bolt;
mod squat;
mod subgrade_layer;
mod support_variation;
#[cfg(test)]
mod testing;
mod wheel_flat;
mod wheel_out_of_round;

pub use instance::{ExtensionInstance, Inputs, InstanceError, check_together};
pub use kind::{Class, EffectFamily, Kind, LookAlikeGroup, PlaceKind};
pub use kind_parameter::{Bound, KindParameter};
pub use measured::Measured;
pub use registry::{
    CLIPPING, CORRUGATION, CRACKED_SLEEPER, ELECTRICAL_HUM, FASTENING_CLAMP, FLEXIBLE_AXLE_BOX,
    GAIN_ERROR, POSITION_ERROR, RAIL_JOINT, SENSOR_MOUNT_RESONANCE, SQUAT, SUBGRADE_LAYER,
    WHEEL_FLAT, WHEEL_OUT_OF_ROUND,
};
pub use sampled::{SampledExtension, SampledValue};
pub use screening::{Family, Places, Screening, Trials};
pub use text::InstanceTextError;

use crate::model::{Assembly, Vehicle};
use num_complex::Complex64;
use std::fmt::Debug;

/// Stage of the assembly at which an extension is added: what uses the values of the supports comes after what changes
/// them. Extensions of one stage are added in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// It varies the supports of many sleepers.
    Variation,
    /// It states a value of some supports.
    Statement,
    /// It adds to the track.
    Addition,
    /// It replaces a railpad or ballast by a force law.
    ForceLaw,
}

/// Physics that the model of the paper leaves out, or a fault of the measuring chain.
///
/// The default of every method changes nothing. A kind overrides the methods that it needs.
pub trait Extension: Debug + Send + Sync {
    /// Adds its linear terms, degrees of freedom and force laws to the track being assembled.
    fn assemble(&self, _assembly: &mut Assembly) {}

    /// When it is added to the track.
    fn stage(&self) -> Stage {
        Stage::Addition
    }

    /// Changes the vehicle.
    fn equip(&self, _vehicle: &mut Vehicle) {}

    /// Height in m that the extension adds to the surface at `x_m`, positive downwards: a dip is
    /// positive.
    fn profile_m(&self, _x_m: f64) -> f64 {
        0.0
    }

    /// Whether the contact patch of a track averages the profile, as it averages the irregularity. The blow at
    /// a kink is not linear and has the high frequencies that the patch would take from the profile.
    fn is_averaged(&self) -> bool {
        false
    }

    /// Height in m that the shape of the wheel adds, positive downwards: a flat is positive. `rolled_m`
    /// is the distance that the wheel has rolled from the origin of the track.
    fn wheel_profile_m(&self, _rolled_m: f64) -> f64 {
        0.0
    }

    /// Factor on the spectral density of the irregularity at a wave number in rad/m.
    fn roughness_gain(&self, _wave_number_rad_m: f64) -> f64 {
        1.0
    }

    /// Transfer function of the measuring chain for a harmonic acceleration at a frequency in Hz: ratio of
    /// recorded to true amplitude.
    fn sensor_transfer(&self, _frequency_hz: f64) -> Complex64 {
        Complex64::ONE
    }

    /// Applies the effect of the measuring chain to a pass.
    fn measure(&self, _measured: &mut Measured) {}
}
