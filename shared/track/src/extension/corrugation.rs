//! Corrugation: waves of one length on the railhead.

use super::kind::DEPTH_DEVIATION;
use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening,
};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "corrugation",
    summary: "waves of nearly one length on the railhead",
    family: EffectFamily::SurfaceWaves,
    group: LookAlikeGroup::RailSurface,
    classes: &[Class::Wavelength, Class::Global],
    place: PlaceKind::Stretch,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("wavelength_m", "m", "length of the waves").ranges(
            [2e-3, 3e-2],
            [2e-2, 0.15],
            5.7e-3,
        ),
        KindParameter::new("amplitude_m", "m", "amplitude, half of crest to trough")
            .ranges([2e-7, 5e-6], [5e-6, 1e-4], 8e-7)
            .form_deviation(DEPTH_DEVIATION),
        KindParameter::new("bandwidth", "1", "width of the band of wave numbers over its middle")
            .ranges([0.0, 0.3], [0.0, 0.3], 0.0)
            .bound(Bound::Share)
            .or(0.0),
    ],
    look_alikes: &["roughness_spectrum", "wheel_out_of_round"],
    would_separate: "passes at another speed: the peak stays at one wavelength",
    screening: Screening::tried(&[]).suggested(&["wavelength_m", "amplitude_m"]),
    build: |inputs| {
        let middle = TAU / inputs.value("wavelength_m");
        let width = inputs.value("bandwidth") * middle;
        Ok(Arc::new(Corrugation {
            stretch_m: inputs.stretch_m(),
            amplitude_m: inputs.value("amplitude_m"),
            wave_numbers: wave_numbers(middle, width),
        }))
    },
};

/// Number of waves in a band.
const WAVES: usize = 16;

/// Golden section. Its multiples spread evenly between whole numbers and repeat nowhere.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Length in wavelengths over which the waves grow and fade at the ends of the stretch.
const FADE_WAVES: f64 = 2.0;

/// `A sin(2 pi x / L)` on a stretch, or a band of such waves with the same mean square.
#[derive(Debug)]
struct Corrugation {
    stretch_m: [f64; 2],
    amplitude_m: f64,
    /// Wave numbers in rad/m.
    wave_numbers: Vec<f64>,
}

/// Wave numbers of a band, at unequal distances, so that the waves together do not repeat.
fn wave_numbers(middle: f64, width: f64) -> Vec<f64> {
    if width == 0.0 {
        return vec![middle];
    }
    let place = |wave: usize| wave as f64 + (GOLDEN * (wave + 1) as f64).fract();
    let share = |wave: usize| place(wave) / WAVES as f64 - 0.5;
    (0..WAVES).map(|wave| middle + share(wave) * width).collect()
}

/// Phase of a wave in rad. Phases that grew by equal steps would let all waves coincide at equal distances: a train
/// of short bursts.
fn phase(wave: usize) -> f64 {
    TAU * (GOLDEN * (wave * wave) as f64).fract()
}

impl Corrugation {
    /// From 0 outside the stretch to 1 inside.
    fn fade(&self, x_m: f64) -> f64 {
        let [from_m, to_m] = self.stretch_m;
        let fade_m = FADE_WAVES * TAU / self.wave_numbers[0];
        let inside = ((x_m - from_m).min(to_m - x_m) / fade_m).clamp(0.0, 1.0);
        0.5 * (1.0 - (PI * inside).cos())
    }
}

impl Extension for Corrugation {
    fn is_averaged(&self) -> bool {
        true
    }

    fn profile_m(&self, x_m: f64) -> f64 {
        let wave = |(index, wave_number): (usize, &f64)| (wave_number * x_m + phase(index)).sin();
        let fade = self.fade(x_m);
        if fade == 0.0 {
            return 0.0;
        }
        let sum: f64 = self.wave_numbers.iter().enumerate().map(wave).sum();
        fade * self.amplitude_m * sum / (self.wave_numbers.len() as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, assert_followed, extension, instance,
    };
    use crate::model::{ContactPatch, Mesh, Support, TrackModel};
    use std::f64::consts::TAU;
    use tracktwin_parameters::{Preset, TrackDesign};

    /// Mean square of the profile from 0.7 m to 0.9 m.
    fn mean_square(bandwidth: f64) -> f64 {
        let waves = instance("corrugation").at([0.5, 1.0]).with("bandwidth", bandwidth);
        let waves = extension(&waves.with("wavelength_m", 2e-3).with("amplitude_m", 1e-6));
        let height = |point: u32| waves.profile_m(0.7 + 1e-5 * f64::from(point));
        (0..20_000).map(|point| height(point).powi(2)).sum::<f64>() / 20_000.0
    }

    #[test]
    fn waves_at_a_point_are_refused() {
        let waves = instance("corrugation").at([0.5, 0.5]).with("wavelength_m", 2e-3);
        let refusal = waves.with("amplitude_m", 1e-6).build(&TrackDesign::v_track(), 12);
        let message = refusal.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(message.contains("a stretch of the rail"), "{message}");
    }

    #[test]
    fn a_single_wave_has_half_the_square_of_its_amplitude() {
        // A hundred whole waves of two hundred points.
        assert!((mean_square(0.0) / 0.5e-12 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_band_of_waves_has_as_much() {
        // 0.2 m resolve wave numbers that differ by 1 in 100; the waves differ by 0.3 / 16, so
        // that neighbours still correlate a little.
        let ratio = mean_square(0.3) / 0.5e-12;
        assert!((0.7..1.3).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_band_of_waves_is_no_train_of_bursts() {
        for bandwidth in [0.1, 0.3] {
            let waves = instance("corrugation").at([0.1, 1.4]).with("bandwidth", bandwidth);
            let waves = extension(&waves.with("wavelength_m", 2e-3).with("amplitude_m", 1e-6));
            let height = |point: u32| waves.profile_m(0.1 + 2e-5 * f64::from(point)).abs();
            let heights = (0..65_000).map(height);
            let highest = heights.fold(0.0, f64::max);
            assert!((1e-6..2e-6).contains(&highest), "{bandwidth}: {highest}");
        }
    }

    #[test]
    fn outside_its_stretch_the_rail_is_as_it_was() {
        let waves = instance("corrugation").at([0.5, 1.0]).with("wavelength_m", 8.5e-3);
        let waves = extension(&waves.with("amplitude_m", 8e-7));
        assert_eq!([0.49, 0.5, 1.0, 1.2].map(|x_m| waves.profile_m(x_m)), [0.0; 4]);
        assert!((0..100).any(|point| waves.profile_m(0.7 + 1e-4 * f64::from(point)) > 7.9e-7));
    }

    #[test]
    fn a_slow_wheel_follows_long_waves() {
        let waves = instance("corrugation").with("wavelength_m", 0.15).with("amplitude_m", 1e-6);
        let shape = extension(&waves);
        assert_followed(&waves, |x_m| shape.profile_m(x_m));
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let waves = instance("corrugation").with("wavelength_m", 8.5e-3);
        assert_felt_alike_in_both_solvers(&waves.with("amplitude_m", 8e-7));
    }

    #[test]
    fn the_contact_patch_of_a_line_averages_it() {
        let design = Preset::Concrete60E1.design();
        let waves = instance("corrugation").with("wavelength_m", 0.045).with("amplitude_m", 1e-5);
        let built = waves.build(&design, 5).unwrap();
        let supports = vec![Support::from(&Preset::Concrete60E1.track().nominal); 4];
        let model =
            TrackModel::build(&design, &Mesh::uniform(5, 2, 2), &supports, &[built]).unwrap();
        // Over whole waves in the middle.
        let power = |height_m: &dyn Fn(f64) -> f64| -> f64 {
            (0..450).map(|point| height_m(1.2 + 1e-3 * f64::from(point)).powi(2)).sum()
        };
        let gain = power(&|x_m| model.felt_profile_m(x_m)) / power(&|x_m| model.profile_m(x_m));
        let expected = ContactPatch::new(&design).gain(TAU / 0.045);
        assert!(expected < 0.8 && (gain / expected - 1.0).abs() < 0.03, "{gain} {expected}");
    }
}
