//! A spectrum of the irregularity other than eq. B.6.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening,
};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "roughness_spectrum",
    summary: "an irregularity whose spectrum has another shape than eq. B.6",
    family: EffectFamily::SurfaceWaves,
    group: LookAlikeGroup::RailSurface,
    classes: &[Class::Wavelength, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("slope_dB_per_octave", "dB", "added for every halving of wavelength")
            .ranges([-3.0, 3.0], [-3.0, 3.0], 1.0)
            .bound(Bound::Any)
            .or(0.0),
        KindParameter::new("level_dB", "dB", "added at all wavelengths")
            .ranges([-6.0, 6.0], [-6.0, 6.0], 0.0)
            .bound(Bound::Any)
            .or(0.0),
        KindParameter::new("pivot_wavelength_m", "m", "wavelength at which the slope adds nothing")
            .ranges([1e-3, 1e-1], [5e-3, 0.5], 1e-2)
            .or(1e-2),
        KindParameter::new("bump_dB", "dB", "height of a broad bump of the spectrum")
            .ranges([-10.0, 10.0], [-10.0, 10.0], 6.0)
            .bound(Bound::Any)
            .or(0.0),
        KindParameter::new("bump_wavelength_m", "m", "wavelength in the middle of the bump")
            .ranges([1e-3, 5e-2], [5e-3, 0.25], 8e-3)
            .or(8e-3),
        KindParameter::new("bump_octaves", "1", "standard deviation of the bump in octaves")
            .ranges([0.3, 1.5], [0.3, 1.5], 0.5)
            .or(0.5),
    ],
    look_alikes: &["contact_patch_filter", "corrugation"],
    would_separate: "a measurement of the railhead's roughness, or a second wheel load",
    screening: Screening::not_tried("the baseline fits the spectrum of the surface itself"),
    build: |inputs| {
        Ok(Arc::new(RoughnessSpectrum {
            level_db: inputs.value("level_dB"),
            slope_db: inputs.value("slope_dB_per_octave"),
            pivot: TAU / inputs.value("pivot_wavelength_m"),
            bump_db: inputs.value("bump_dB"),
            bump: TAU / inputs.value("bump_wavelength_m"),
            bump_octaves: inputs.value("bump_octaves"),
        }))
    },
};

/// A straight line and a bump in dB over the logarithm of wave number, on top of eq. B.6.
#[derive(Debug)]
struct RoughnessSpectrum {
    level_db: f64,
    slope_db: f64,
    /// Wave number in rad/m.
    pivot: f64,
    bump_db: f64,
    /// Wave number in rad/m.
    bump: f64,
    bump_octaves: f64,
}

impl Extension for RoughnessSpectrum {
    fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        let octaves = (wave_number_rad_m / self.pivot).log2();
        let from_bump = (wave_number_rad_m / self.bump).log2() / self.bump_octaves;
        let bump_db = self.bump_db * (-0.5 * from_bump * from_bump).exp();
        10.0_f64.powf(0.1 * (self.level_db + self.slope_db * octaves + bump_db))
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{extension, instance, track};
    use crate::model::{Roughness, Surface};
    use std::f64::consts::TAU;

    #[test]
    fn level_slope_and_bump_add_up_in_decibels() {
        let spectrum = instance("roughness_spectrum").with("level_dB", 1.0);
        let spectrum = spectrum.with("slope_dB_per_octave", 2.0).with("bump_dB", 5.0);
        let spectrum = spectrum.with("pivot_wavelength_m", 1e-2).with("bump_wavelength_m", 5e-3);
        let spectrum = extension(&spectrum.with("bump_octaves", 0.1));
        let level_db =
            |wavelength_m: f64| 10.0 * spectrum.roughness_gain(TAU / wavelength_m).log10();
        // The bump is ten standard deviations off at its neighbours' octaves.
        for (wavelength_m, expected) in [(1e-2, 1.0), (5e-3, 8.0), (2.5e-3, 5.0), (2e-2, -1.0)] {
            assert!((level_db(wavelength_m) - expected).abs() < 1e-9, "{wavelength_m}");
        }
    }

    #[test]
    fn four_times_the_power_is_twice_the_height_everywhere() {
        let louder = instance("roughness_spectrum").with("level_dB", 10.0 * 4.0_f64.log10());
        let (louder, plain) = (track(&[louder]), Surface::rough(3, 2.0, 1.5));
        let louder = louder.surface(&Roughness::new(2.0), 3);
        for x_m in [0.1, 0.5, 1.234] {
            assert!((louder.height(x_m) / plain.height(x_m) - 2.0).abs() < 1e-9, "{x_m}");
        }
        assert_eq!(track(&[]).surface(&Roughness::new(2.0), 3), plain);
    }
}
