//! Spectrum, over every sleeper, of the shape that an extension adds to rail or wheel.
//!
//! A shape is not random. Over one sleeper, however, its mean power in a band follows from its spectrum, as
//! for the surface. The two spectra are therefore added. Waves around the whole tread of the wheel are tones:
//! over one sleeper, the spectrum of six waves would be wider than that of the wavelet by a sixth.

use crate::bands::tone_density;
use crate::section::Section;
use num_complex::Complex64;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use tracktwin_fourier::Fft;
use tracktwin_track::model::ContactPatch;

/// Number of samples per sleeper spacing; the shortest compared wave has more than two samples.
const SAMPLES_PER_SPACING: usize = 1250;

/// Number of samples of a transform, including zeros.
const SAMPLES: usize = 4096;

/// Length of the transition between the windows of two sleepers, as a share of the spacing.
const FADE: f64 = 0.3;

/// Number of samples of one turn of a wheel.
const SAMPLES_PER_TURN: usize = 1024;

/// Smallest share of one order, and of all such orders together, in the variance of a profile that is made of tones.
const TONE_SHARE_MIN: [f64; 2] = [0.2, 0.95];

/// Smallest height of a shape in m; a nanometre is below the height of any surface.
const HEIGHT_MIN_M: f64 = 1e-9;

/// Turns of the wheel in every pass.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelTurns {
    /// Position on the model's track in m at which a turn begins, `[speed][pass]`; empty if unknown.
    pub starts_m: Vec<Vec<f64>>,
    /// Circumference of the wheel divided by that of the design.
    pub circumference_ratio: f64,
}

impl Default for WheelTurns {
    fn default() -> Self {
        Self { starts_m: Vec::new(), circumference_ratio: 1.0 }
    }
}

/// Spectrum of a shape over the compared sleepers, `[sleeper][wave]`: squared magnitudes of its Fourier
/// integral in m4, at integer numbers of waves on [`SAMPLES`]; `None` for sleepers without a shape.
pub(crate) struct Shape {
    squares: Vec<Option<Vec<f64>>>,
    tones: Vec<Tone>,
    step_m: f64,
    spacing_m: f64,
    patch: Option<ContactPatch>,
}

/// Waves of one length along the whole track.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tone {
    /// Length of a wave in m.
    length_m: f64,
    /// Mean square of the height in m2.
    square_m2: f64,
}

impl Tone {
    /// The waves that a profile of the wheel, as a function of the angle in turns, consists of; empty if it is anything
    /// else than one or a few orders. `circumference_m` is that of the wheel.
    pub(crate) fn of_wheel(circumference_m: f64, profile_m: impl Fn(f64) -> f64) -> Vec<Self> {
        let transform = tracktwin_fourier::forward(SAMPLES_PER_TURN);
        let count = SAMPLES_PER_TURN as f64;
        let mut samples: Vec<Complex64> =
            (0..SAMPLES_PER_TURN).map(|it| profile_m(it as f64 / count).into()).collect();
        transform.process(&mut samples);
        let squares: Vec<f64> = samples[1..SAMPLES_PER_TURN / 2]
            .iter()
            .map(|value| 2.0 * (value / count).norm_sqr())
            .collect();
        let sum: f64 = squares.iter().sum();
        let [least, together] = TONE_SHARE_MIN;
        let tones: Vec<Self> = (1..)
            .zip(&squares)
            .filter(|(_, square)| **square > least * sum)
            .map(|(order, square)| Self {
                length_m: circumference_m / f64::from(order),
                square_m2: *square,
            })
            .collect();
        let explained: f64 = tones.iter().map(|tone| tone.square_m2).sum();
        if explained < together * sum { Vec::new() } else { tones }
    }

    /// One-sided power spectral density in m2/Hz at a speed, at one of the [`crate::Bands`]' lines.
    fn density(&self, speed_m_s: f64, frequency_hz: f64) -> f64 {
        self.square_m2 * tone_density(frequency_hz, speed_m_s / self.length_m)
    }
}

impl Shape {
    /// The spectrum of these waves over the whole section.
    pub(crate) fn of_tones(section: &Section, tones: &[Tone]) -> Self {
        let spacing_m = section.track.design.sleeper.spacing_m;
        let squares = vec![None; section.sleepers()];
        Self { squares, tones: tones.to_vec(), step_m: spacing_m, spacing_m, patch: None }
    }

    /// The spectrum of a height in m as a function of the position on the model's track in m; `None` if it
    /// is flat. `patch` is the contact patch that averages the shape, if one does.
    pub(crate) fn new(
        section: &Section,
        patch: Option<ContactPatch>,
        height_m: impl Fn(f64) -> f64,
    ) -> Option<Self> {
        let spacing_m = section.track.design.sleeper.spacing_m;
        let step_m = spacing_m / SAMPLES_PER_SPACING as f64;
        let transform = tracktwin_fourier::forward(SAMPLES);
        let of = |sleeper: usize| {
            let middle_m = section.model_x_m(section.x_m(sleeper));
            squares(&transform, step_m, spacing_m, |offset_m| height_m(middle_m + offset_m))
        };
        let squares: Vec<_> = (0..section.sleepers()).map(of).collect();
        let tones = Vec::new();
        squares.iter().any(Option::is_some).then_some(Self {
            squares,
            tones,
            step_m,
            spacing_m,
            patch,
        })
    }

    /// One-sided power spectral density in m2/Hz over a sleeper, at a speed and frequency.
    pub(crate) fn density(&self, sleeper: usize, speed_m_s: f64, frequency_hz: f64) -> f64 {
        let tones = self.tones.iter().map(|tone| tone.density(speed_m_s, frequency_hz)).sum();
        let Some(squares) = &self.squares[sleeper] else { return tones };
        let place = frequency_hz / speed_m_s * self.step_m * SAMPLES as f64;
        let left = place as usize;
        if left + 1 >= squares.len() {
            return tones;
        }
        let share = place - left as f64;
        let square = squares[left] * (1.0 - share) + squares[left + 1] * share;
        let gain = self.patch.map_or(1.0, |patch| patch.gain(TAU * frequency_hz / speed_m_s));
        tones + 2.0 * gain * square / (self.spacing_m * speed_m_s)
    }
}

/// Squared magnitudes of the Fourier integral of a height around a sleeper, in m4.
fn squares(
    transform: &Arc<dyn Fft<f64>>,
    step_m: f64,
    spacing_m: f64,
    height_m: impl Fn(f64) -> f64,
) -> Option<Vec<f64>> {
    let reach = (0.5 * (1.0 + FADE) * SAMPLES_PER_SPACING as f64).ceil() as i32;
    let mut samples: Vec<Complex64> = (-reach..=reach)
        .map(|sample| {
            let offset_m = f64::from(sample) * step_m;
            let height_m = height_m(offset_m);
            // Most of a track is flat.
            let weight = if height_m == 0.0 { 0.0 } else { window(offset_m / spacing_m) };
            Complex64::from(weight * height_m)
        })
        .collect();
    let highest = samples.iter().map(|height| height.re.abs()).fold(0.0, f64::max);
    if highest < HEIGHT_MIN_M {
        return None;
    }
    samples.resize(SAMPLES, Complex64::ZERO);
    transform.process(&mut samples);
    Some(samples[..SAMPLES / 2].iter().map(|value| value.norm_sqr() * step_m * step_m).collect())
}

/// Weight of a height at this distance from the sleeper in spacings; the squared weights of neighbouring
/// sleepers sum to one.
fn window(spacings: f64) -> f64 {
    let past = (spacings.abs() - 0.5) / FADE + 0.5;
    (FRAC_PI_2 * past.clamp(0.0, 1.0)).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::TrackDesign;

    fn section() -> Section {
        Section::new(TrackDesign::v_track(), 5, 0.0)
    }

    #[test]
    fn a_sine_has_its_power_at_its_own_frequency_over_every_sleeper() {
        let (section, speed, length_m) = (section(), 3.0, 6e-3);
        let sine = |x_m: f64| 1e-6 * (TAU * x_m / length_m).sin();
        let shape = Shape::new(&section, None, sine).unwrap();
        for sleeper in 0..5 {
            let density = |hz: i32| shape.density(sleeper, speed, f64::from(hz));
            let power: f64 = (0..2000).map(density).sum();
            let moment: f64 = (0..2000).map(|hz| f64::from(hz) * density(hz)).sum();
            // The window's square has a mean of one; lines stand 1 Hz apart.
            assert!((power / 0.5e-12 - 1.0).abs() < 0.02, "{power}");
            assert!((moment / power - 500.0).abs() < 5.0, "{}", moment / power);
        }
    }

    #[test]
    fn a_hollow_between_two_sleepers_belongs_half_to_each() {
        let section = section();
        let middle_m = section.model_x_m(0.5 * (section.x_m(1) + section.x_m(2)));
        let hollow = |x_m: f64| 1e-5 * (-((x_m - middle_m) / 2e-3).powi(2)).exp();
        let shape = Shape::new(&section, None, hollow).unwrap();
        let (left, right) = (shape.density(1, 3.0, 400.0), shape.density(2, 3.0, 400.0));
        assert!((left / right - 1.0).abs() < 1e-6);
        // The Fourier integral of the Gaussian, shared by two.
        let wave_number = TAU * 400.0 / 3.0;
        let integral =
            1e-5 * 2e-3 * std::f64::consts::PI.sqrt() * (-(wave_number * 2e-3 / 2.0).powi(2)).exp();
        let expected = 2.0 * integral.powi(2) / (0.125 * 3.0);
        assert!(((left + right) / expected - 1.0).abs() < 0.02, "{}", (left + right) / expected);
        assert_eq!(shape.density(4, 3.0, 400.0), 0.0);
    }

    #[test]
    fn orders_of_a_wheel_are_tones_and_a_flat_is_none() {
        let order = |turns: f64| 2e-6 * (TAU * 20.0 * turns + 0.3).cos();
        let tones = Tone::of_wheel(0.4, order);
        assert_eq!(tones.len(), 1);
        assert!((tones[0].length_m - 0.02).abs() < 1e-12);
        assert!((tones[0].square_m2 / 2e-12 - 1.0).abs() < 1e-9, "{tones:?}");
        let flat = |turns: f64| 1e-5 * (-((turns - 0.5) / 0.01).powi(2)).exp();
        assert!(Tone::of_wheel(0.4, flat).is_empty());
        assert!(Tone::of_wheel(0.4, |turns| order(turns) + flat(turns)).is_empty());
        assert!(Tone::of_wheel(0.4, |_| 0.0).is_empty());
    }

    #[test]
    fn a_flat_track_has_no_shape() {
        assert!(Shape::new(&section(), None, |_| 0.0).is_none());
    }
}
