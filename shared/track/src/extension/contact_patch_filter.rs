//! The contact patch, which averages the irregularity over its length.

use super::{Class, Extension, Kind, KindParameter, PlaceKind};
use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "contact_patch_filter",
    summary: "the contact patch averages short waves of the irregularity",
    classes: &[Class::Wavelength, Class::Global, Class::Load],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[KindParameter::new("half_length_m", "m", "half the length of the contact patch")
        .ranges([5e-4, 2e-3], [4e-3, 7e-3], 1.2e-3)],
    look_alikes: &["roughness_spectrum"],
    would_separate: "a measurement of the railhead's roughness, or a second wheel load",
    build: |inputs| {
        Ok(Arc::new(ContactPatchFilter { half_length_m: inputs.value("half_length_m") }))
    },
};

/// `|H|² = 1 / (1 + pi/4 (kappa a)³)` for a patch of half length `a` (Remington 1976, as in
/// mismatch catalogue 21). It filters the random irregularity, not what other kinds add to it.
#[derive(Debug)]
struct ContactPatchFilter {
    half_length_m: f64,
}

impl Extension for ContactPatchFilter {
    fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        1.0 / (1.0 + FRAC_PI_4 * (wave_number_rad_m * self.half_length_m).powi(3))
    }
}
