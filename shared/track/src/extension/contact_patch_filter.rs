//! The contact patch, which averages the irregularity over its length.

use super::{
    Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind, Screening,
};
use crate::model::ContactPatch;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "contact_patch_filter",
    summary: "the contact patch averages short waves of the irregularity",
    family: EffectFamily::SurfaceWaves,
    group: LookAlikeGroup::Contact,
    classes: &[Class::Wavelength, Class::Global, Class::Load],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[KindParameter::new("half_length_m", "m", "half the length of the contact patch")
        .ranges([5e-4, 2e-3], [4e-3, 7e-3], 1.2e-3)],
    look_alikes: &["roughness_spectrum"],
    would_separate: "a measurement of the railhead's roughness, or a second wheel load",
    screening: Screening::not_tried(
        "the baseline fits the spectrum of the surface, and a patch changes nothing else",
    ),
    build: |inputs| {
        let patch = ContactPatch { half_length_m: inputs.value("half_length_m") };
        let of_design =
            inputs.design.contact_patch_filter.then(|| ContactPatch::new(inputs.design));
        Ok(Arc::new(ContactPatchFilter { patch, of_design }))
    },
};

/// A contact patch in place of that of the design, if the design has one. The patch filters the random
/// irregularity only, not the profiles that other kinds add to the surface.
#[derive(Debug)]
struct ContactPatchFilter {
    patch: ContactPatch,
    of_design: Option<ContactPatch>,
}

impl Extension for ContactPatchFilter {
    fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        let replaced = self.of_design.map_or(1.0, |patch| patch.gain(wave_number_rad_m));
        self.patch.gain(wave_number_rad_m) / replaced
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{extension, instance, track};
    use crate::model::{ContactPatch, Roughness, Surface};
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn waves_much_longer_than_the_patch_pass_and_short_ones_do_not() {
        let filter = extension(&instance("contact_patch_filter").with("half_length_m", 1e-3));
        assert!((filter.roughness_gain(1.0) - 1.0).abs() < 1e-8);
        // At kappa a = 1 the gain is 1 / (1 + pi / 4).
        assert!((filter.roughness_gain(1e3) - 0.560_099).abs() < 1e-6);
        // Far above, eight times less for an octave.
        let octave = filter.roughness_gain(1e5) / filter.roughness_gain(2e5);
        assert!((octave - 8.0).abs() < 1e-4, "{octave}");
    }

    #[test]
    fn a_patch_replaces_that_of_the_design() {
        let design = TrackDesign { contact_patch_filter: true, ..TrackDesign::v_track() };
        let own_m = ContactPatch::new(&design).half_length_m;
        let same = instance("contact_patch_filter").with("half_length_m", own_m);
        let same = same.build(&design, 12).unwrap();
        assert!((same.roughness_gain(1e3) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_filtered_surface_bends_less_and_keeps_its_long_waves() {
        let filter = instance("contact_patch_filter").with("half_length_m", 1.2e-3);
        let filtered = track(&[filter]).surface(&Roughness::new(3.0), 1);
        let plain = Surface::rough(1, 3.0, 1.5);
        let bend = |surface: &Surface, step_m: f64| -> f64 {
            let height = |x_m: f64| surface.height(x_m);
            let second = |x_m: f64| height(x_m - step_m) - 2.0 * height(x_m) + height(x_m + step_m);
            (2_000..12_000).map(|point| second(1e-4 * f64::from(point)).powi(2)).sum()
        };
        assert!(bend(&filtered, 2e-4) < 0.2 * bend(&plain, 2e-4));
        assert!((bend(&filtered, 0.1) / bend(&plain, 0.1) - 1.0).abs() < 0.02);
    }
}
