//! Irregularity of the rail, from the background of the passes.
//!
//! The passes show how far a defect or a line is above the surface around it. Its size in metres follows from
//! the size of that surface: `S(k) = v P(f) / |H(f)|^2` with `k = f/v`, the background `P` of a pass, and the
//! transfer `H` of the stated track (docs/diagnosis.md, eq. 2), and by the gain of the contact patch where the
//! track has one. `S` is eq. B.6 of the usual level, times a factor whose logarithm is a parabola over the
//! logarithm of the wave number.

use super::Background;
use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;
use std::f64::consts::{LN_2, TAU};
use tracktwin_parameters::{Parameter, Track};
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_track::frequency::RailReceptances;
use tracktwin_track::model::{ContactPatch, HertzContact, Mesh, Roughness, Support, TrackModel};

/// Distance between the ends of a uniform distribution, in standard deviations.
const UNIFORM_WIDTH: f64 = 3.464;
/// Lowest examined frequency in Hz, highest as a share of the sample rate, and number per octave. Lines of
/// the background are 50 Hz apart, and its steep rise leaks into the lowest ones.
const LOW_HZ: f64 = 200.0;
const HIGH_SHARE: f64 = 0.4;
const PER_OCTAVE: f64 = 3.0;
/// Smallest ratio of power to noise floor of a usable frequency.
const AUDIBLE: f64 = 4.0;
/// Waves per sleeper spacing in the middle of the parabola.
const MIDDLE_PER_SPACING: f64 = 12.0;
/// Prior standard deviations of the level, slope and curvature of the factor's logarithm.
const PRIOR: [f64; 3] = [3.0, 1.0, 0.3];
/// Standard deviation of the logarithm of a background's value: scatter of the transfer from place to place,
/// and resonances that differ from those of the stated track.
const VALUE_DEVIATION: f64 = 0.7;
/// Standard deviation of the logarithm of the mean transfer of a track around that of the stated one.
const TRANSFER_DEVIATION: f64 = 0.9;
/// Spans of the track for the transfer, and elements of each span.
const SPANS: usize = 24;
const ELEMENTS: usize = 8;

/// Surface of a rail.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    usual: Roughness,
    /// Level, slope and curvature of the factor's logarithm.
    factor: Vector3<f64>,
    /// Range of the logarithm of the wave number over its middle; the factor is constant beyond it.
    range: [f64; 2],
    middle_per_m: f64,
    /// Relative standard deviation of heights: half that of the density's logarithm.
    pub height_deviation: f64,
}

impl Surface {
    /// The surface under the passes of a recording. Where accelerations are not in m/s2, or sleepers are
    /// unknown, it is the usual surface of the stated track.
    pub(crate) fn of(recording: &Recording) -> Self {
        let track = recording.stated_track().track;
        let usual = Self::usual(&track);
        if !recording.gain_known() || recording.sleepers.is_empty() {
            return usual;
        }
        let values = usual.values(recording, &track);
        if values.is_empty() { usual } else { usual.fitted(&values) }
    }

    /// The usual surface of a track.
    fn usual(track: &Track) -> Self {
        let [low, high] = track.ranges[Parameter::IrregularityLevel.index()];
        Self {
            usual: Roughness::new(track.nominal[Parameter::IrregularityLevel]),
            factor: Vector3::zeros(),
            range: [0.0; 2],
            middle_per_m: MIDDLE_PER_SPACING / track.design.sleeper.spacing_m,
            height_deviation: 0.5 * (high / low).ln() / UNIFORM_WIDTH,
        }
    }

    /// Logarithms of wave number over its middle and of the density over the present one, at all
    /// frequencies of all passes.
    fn values(&self, recording: &Recording, track: &Track) -> Vec<(f64, f64)> {
        let top_hz = HIGH_SHARE * recording.sample_rate_hz;
        let count = ((top_hz / LOW_HZ).log2() * PER_OCTAVE).max(0.0) as usize;
        let lines_hz: Vec<f64> =
            (0..=count).map(|line| LOW_HZ * (line as f64 / PER_OCTAVE).exp2()).collect();
        let Some(transfer) = transfer(track, &lines_hz) else { return Vec::new() };
        let patch = track.design.contact_patch_filter.then(|| ContactPatch::new(&track.design));
        let of_pass = |pass: &Pass| {
            let background = Background::of(&pass.signal)?;
            let (speed, audible_hz) = (pass.mean_speed_m_s(), background.audible_hz(AUDIBLE));
            let value = |(hz, power): (f64, f64)| {
                let wave_number = hz / speed;
                let gain = patch.map_or(1.0, |patch| patch.gain(TAU * wave_number));
                let density = speed * background.at(hz) / power / gain;
                let ratio = density / self.density_m3(wave_number);
                ((wave_number / self.middle_per_m).ln(), ratio.ln())
            };
            let usable = lines_hz.iter().copied().zip(transfer.iter().copied());
            let is_felt = |hz: f64| {
                hz < audible_hz && !patch.is_some_and(|patch| patch.averages_out(TAU * hz / speed))
            };
            let usable = usable.take_while(|(hz, _)| is_felt(*hz)).map(value);
            Some(usable.filter(|(_, ratio)| ratio.is_finite()).collect::<Vec<_>>())
        };
        recording.passes.iter().filter_map(of_pass).flatten().collect()
    }

    /// The surface with the factor that fits these values. Passes count as one: they share their track.
    fn fitted(self, values: &[(f64, f64)]) -> Self {
        let range = values.iter().fold([f64::MAX, f64::MIN], |[low, high], (place, _)| {
            [low.min(*place), high.max(*place)]
        });
        let octaves = (range[1] - range[0]) / LN_2;
        let weight =
            (octaves * PER_OCTAVE).max(1.0) / values.len() as f64 / VALUE_DEVIATION.powi(2);
        let mut precision = Matrix3::from_diagonal(&Vector3::from(PRIOR.map(|it| it.powi(-2))));
        let mut sum = Vector3::zeros();
        for &(place, ratio) in values {
            let row = Vector3::new(1.0, place, place * place);
            precision += weight * row * row.transpose();
            sum += weight * ratio * row;
        }
        let Some(covariance) = precision.try_inverse() else { return self };
        let deviation = covariance[(0, 0)].sqrt().hypot(TRANSFER_DEVIATION);
        Self { factor: covariance * sum, range, height_deviation: 0.5 * deviation, ..self }
    }

    /// One-sided spectral density in m3 at a wave number in cycles/m.
    pub(crate) fn density_m3(&self, wave_number: f64) -> f64 {
        let place = (wave_number / self.middle_per_m).ln().clamp(self.range[0], self.range[1]);
        let factor = self.factor.dot(&Vector3::new(1.0, place, place * place)).exp();
        factor * TAU * self.usual.density(TAU * wave_number)
    }
}

/// Squared ratio of acceleration to surface height in 1/s4, as mean over the middle span of the nominal track.
/// `None` if no model of it exists.
fn transfer(track: &Track, lines_hz: &[f64]) -> Option<Vec<f64>> {
    let supports = vec![Support::from(&track.nominal); SPANS - 1];
    let mesh = Mesh::uniform(SPANS, ELEMENTS, ELEMENTS);
    let model = TrackModel::build(&track.design, &mesh, &supports, &[]).ok()?;
    let contact = 1.0 / HertzContact::new(&track.design).stiffness(track.design.wheel.load_n);
    let of_line = |(&hz, direct): (&f64, &Vec<Complex64>)| {
        let omega = TAU * hz;
        let vehicle = contact + model.vehicle().receptance(omega);
        let acceleration = model.vehicle().acceleration_per_force(omega).norm_sqr();
        let middle = &direct[SPANS / 2 * ELEMENTS..][..ELEMENTS];
        let power = middle.iter().map(|rail| acceleration / (vehicle + rail).norm_sqr());
        power.sum::<f64>() / ELEMENTS as f64
    };
    let direct = RailReceptances::new(&model, lines_hz, None).direct;
    Some(lines_hz.iter().zip(&direct).map(of_line).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::Rolled;
    use tracktwin_signal::Signal;
    use tracktwin_track::time;

    #[test]
    fn the_usual_surface_of_a_line_is_smoother_than_that_of_v_track_and_less_known() {
        let recording = Rolled::faultless(1).recording();
        let on_line = Recording { spacing_m: 0.6, ..recording.clone() };
        let [rig, line] = [recording, on_line].map(|recording| Surface::of(&recording));
        // Levels of 3 (1 to 5) and 0.15.
        assert!((rig.density_m3(100.0) / line.density_m3(100.0) - 20.0).abs() < 1e-9);
        assert!((rig.height_deviation - 0.232).abs() < 1e-3, "{rig:?}");
        assert!(line.height_deviation > 2.0 * rig.height_deviation, "{line:?}");
    }

    #[test]
    fn a_surface_is_recognised_under_a_wheel_that_was_simulated_in_time() {
        let mut recording = Rolled::faultless(1).recording();
        recording.nominal.clear();
        let track = recording.stated_track().track;
        let supports = vec![Support::from(&track.nominal); SPANS - 1];
        let mesh = Mesh::uniform(SPANS, ELEMENTS, ELEMENTS);
        let model = TrackModel::build(&track.design, &mesh, &supports, &[]).unwrap();
        // Half the usual level, and a cube instead of the fourth power of the wave number.
        let (middle_rad_m, length_m) = (TAU * 100.0, SPANS as f64 * recording.spacing_m);
        let gain = |wave_number: f64| 0.5 * wave_number / middle_rad_m;
        let rough = Roughness::new(track.nominal[Parameter::IrregularityLevel]);
        let surface = rough.shaped_surface(7, length_m, gain);
        for pass in &mut recording.passes {
            let speed_m_s = pass.speed_km_h / 3.6;
            let time_step_s = 1.0 / Rolled::RATE_HZ;
            let (start_m, end_m) = (0.1 * length_m, 0.9 * length_m);
            let run =
                time::Pass { speed_m_s, start_m, end_m, time_step_s, local_flexibility: true };
            let record = time::pass(&model, &run, &surface).unwrap();
            let places = 0..record.acceleration_m_s2.len();
            pass.position_m = places.map(|index| record.position_m(index)).collect();
            pass.signal = Signal::new(Rolled::RATE_HZ, record.acceleration_m_s2).unwrap();
        }
        let found = Surface::of(&recording);
        for wave_number in [100.0, 200.0, 400.0, 800.0, 1600.0] {
            let truth = TAU * gain(TAU * wave_number) * rough.density(TAU * wave_number);
            let ratio_db = 10.0 * (found.density_m3(wave_number) / truth).log10();
            assert!(ratio_db.abs() < 2.5, "{wave_number}: {ratio_db}");
        }
    }
}
