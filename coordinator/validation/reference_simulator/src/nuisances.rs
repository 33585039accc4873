//! Nuisances: small imperfections of every track, wheel and recorder. A diagnosis should not report
//! them.
//!
//! This module contains the data, and the formulas of wheel, contact patch and recorder. The module
//! `track` contains those of the railpads.

use crate::TruthError;
use crate::scene::{not_negative, positive};
use crate::vtrack::WHEEL_RADIUS_M;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Corner frequency of the recorder's slow noise in Hz.
const SLOW_HZ: f64 = 30.0;
/// Load in N of a railpad without any wheel, and beyond it that of its nominal stiffness: what the
/// nearest sleeper bears of the wheel.
pub(crate) const TOE_LOAD_N: f64 = 1000.0;
pub(crate) const REFERENCE_LOAD_N: f64 = 1500.0;
/// Furthest that a true value is from its nominal one.
const OFF_NOMINAL_MAX: f64 = 0.1;

/// Nuisances of a scene. The default has none.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Nuisances {
    /// Exponent of the load dependence of the stiffness of every railpad.
    pub railpad_exponent: f64,
    /// Ratio of the stiffness of a Maxwell branch, parallel to every railpad, to that of the railpad.
    pub railpad_relaxation: f64,
    /// Relaxation time of this branch in s.
    pub railpad_relaxation_time_s: f64,
    /// Half of the length of the contact patch in m, over which the contact averages the irregularity.
    pub patch_half_length_m: f64,
    /// Waves around the tread, from one wave per revolution up.
    pub wheel_orders: [WheelOrder; 4],
    /// Frequency response of the recorder. `None`: equal to one.
    pub response: Option<Response>,
    /// Standard deviation in m/s2 of noise below some 30 Hz.
    pub slow_noise_m_s2: f64,
    /// Ratio of true to nominal mass of the wheel.
    pub wheel_mass_factor: f64,
    /// Ratio of true to nominal Hertzian coefficient of the contact.
    pub contact_factor: f64,
    /// Ratio of true to nominal mass of the sleepers.
    pub sleeper_mass_factor: f64,
}

impl Default for Nuisances {
    fn default() -> Self {
        Self {
            railpad_exponent: 0.0,
            railpad_relaxation: 0.0,
            railpad_relaxation_time_s: 1e-4,
            patch_half_length_m: 0.0,
            wheel_orders: [WheelOrder::default(); 4],
            response: None,
            slow_noise_m_s2: 0.0,
            wheel_mass_factor: 1.0,
            contact_factor: 1.0,
            sleeper_mass_factor: 1.0,
        }
    }
}

/// Waves `a cos(n x / R + phi)` around the tread of a wheel, whose angle differs from pass to pass.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WheelOrder {
    /// Amplitude `a` in m.
    pub amplitude_m: f64,
    /// Angle `phi` in rad.
    pub angle_rad: f64,
}

/// Response `1 + r cos(2 pi f / p)` of a recorder, without a phase.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Response {
    /// Ripple `r`.
    pub ripple: f64,
    /// Period `p` in Hz.
    #[serde(rename = "period_Hz")]
    pub period_hz: f64,
}

impl Response {
    /// What is recorded of samples so far apart in s; values beyond the ends repeat those there.
    pub(crate) fn of(self, samples: &[f64], step_s: f64) -> Vec<f64> {
        let lag = (1.0 / (self.period_hz * step_s)).round() as usize;
        let last = samples.len().saturating_sub(1);
        let value = |(index, sample): (usize, &f64)| {
            let beside = samples[index.saturating_sub(lag)] + samples[(index + lag).min(last)];
            sample + 0.5 * self.ripple * beside
        };
        samples.iter().enumerate().map(value).collect()
    }
}

impl Nuisances {
    /// Whether there are none.
    pub(crate) fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Height in m, positive downwards, of a wheel that has rolled so far in m.
    pub(crate) fn wheel_m(&self, rolled_m: f64) -> f64 {
        let angle = rolled_m / WHEEL_RADIUS_M;
        let wave = |(order, wave): (u32, &WheelOrder)| {
            wave.amplitude_m * (f64::from(order) * angle + wave.angle_rad).cos()
        };
        (1..).zip(&self.wheel_orders).map(wave).sum()
    }

    /// What the contact leaves of the amplitude of a wave of this wave number in rad/m: the root of
    /// `1 / (1 + pi/4 (k a)³)` (Remington 1976).
    pub(crate) fn patch(&self, wave_number: f64) -> f64 {
        (1.0 + FRAC_PI_4 * (wave_number * self.patch_half_length_m).powi(3)).sqrt().recip()
    }

    /// Adds the recorder's slow noise to samples so far apart in s: white noise through a low-pass of
    /// first order.
    pub(crate) fn add_slow_noise(
        &self,
        samples: &mut [f64],
        step_s: f64,
        random: &mut ChaCha12Rng,
    ) {
        if self.slow_noise_m_s2 == 0.0 {
            return;
        }
        let kept = (-TAU * SLOW_HZ * step_s).exp();
        let fresh = self.slow_noise_m_s2 * (1.0 - kept * kept).sqrt();
        let mut draw = || -> f64 { StandardNormal.sample(random) };
        let mut noise = self.slow_noise_m_s2 * draw();
        for sample in samples {
            *sample += noise;
            noise = kept * noise + fresh * draw();
        }
    }

    /// That each can be.
    pub(crate) fn check(&self) -> Result<(), TruthError> {
        not_negative("railpad_exponent", self.railpad_exponent)?;
        not_negative("railpad_relaxation", self.railpad_relaxation)?;
        positive("railpad_relaxation_time_s", self.railpad_relaxation_time_s)?;
        not_negative("patch_half_length_m", self.patch_half_length_m)?;
        not_negative("slow_noise_m_s2", self.slow_noise_m_s2)?;
        for order in &self.wheel_orders {
            not_negative("wheel_orders.amplitude_m", order.amplitude_m)?;
        }
        if let Some(Response { ripple, period_hz }) = self.response {
            positive("response.period_Hz", period_hz)?;
            at_most("response.ripple", ripple.abs(), 0.5)?;
        }
        at_most("railpad_exponent", self.railpad_exponent, 0.9)?;
        for (field, factor) in [
            ("wheel_mass_factor", self.wheel_mass_factor),
            ("contact_factor", self.contact_factor),
            ("sleeper_mass_factor", self.sleeper_mass_factor),
        ] {
            positive(field, factor)?;
            at_most(field, (factor - 1.0).abs(), OFF_NOMINAL_MAX)?;
        }
        Ok(())
    }
}

fn at_most(field: &'static str, value: f64, most: f64) -> Result<(), TruthError> {
    if value <= most { Ok(()) } else { Err(TruthError::TooLarge { field, value, most }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn none_changes_no_bit() {
        let none = Nuisances::default();
        assert!(none.are_none() && none.check().is_ok());
        assert_eq!((none.wheel_m(0.37), none.patch(9e3)), (0.0, 1.0));
        let (mut samples, mut random) = ([1.0, 2.0], ChaCha12Rng::seed_from_u64(1));
        none.add_slow_noise(&mut samples, 1e-5, &mut random);
        assert_eq!((samples, random), ([1.0, 2.0], ChaCha12Rng::seed_from_u64(1)));
    }

    #[test]
    fn an_order_of_the_wheel_comes_back_after_its_share_of_a_turn() {
        let order = WheelOrder { amplitude_m: 1e-6, angle_rad: 0.4 };
        let mut orders = [WheelOrder::default(); 4];
        orders[2] = order;
        let wheel = Nuisances { wheel_orders: orders, ..Nuisances::default() };
        let third = TAU * WHEEL_RADIUS_M / 3.0;
        assert!((wheel.wheel_m(0.01) - wheel.wheel_m(0.01 + third)).abs() < 1e-18);
        assert!((wheel.wheel_m(0.0) - 1e-6 * 0.4_f64.cos()).abs() < 1e-18);
    }

    #[test]
    fn the_patch_leaves_the_power_of_remington() {
        let patch = Nuisances { patch_half_length_m: 1e-4, ..Nuisances::default() };
        let power = patch.patch(1e4).powi(2);
        assert!((power - 1.0 / (1.0 + std::f64::consts::PI / 4.0)).abs() < 1e-12);
        assert!(patch.patch(1e2) > 0.999);
    }

    #[test]
    fn a_tone_passes_a_response_with_its_gain_and_no_phase() {
        let response = Response { ripple: -0.03, period_hz: 5000.0 };
        for frequency in [500.0, 1250.0, 2500.0] {
            let tone = |index: usize| (TAU * frequency * 1e-5 * index as f64).sin();
            let samples: Vec<f64> = (0..2000).map(tone).collect();
            let gain = 1.0 - 0.03 * (TAU * frequency / 5000.0).cos();
            let recorded = response.of(&samples, 1e-5);
            for (index, value) in recorded.iter().enumerate().take(1900).skip(100) {
                assert!((value - gain * tone(index)).abs() < 1e-12, "{frequency} Hz");
            }
        }
    }

    #[test]
    fn slow_noise_has_its_deviation_and_is_slow() {
        let slow = Nuisances { slow_noise_m_s2: 0.1, ..Nuisances::default() };
        let mut samples = vec![0.0; 2_000_000];
        slow.add_slow_noise(&mut samples, 1e-5, &mut ChaCha12Rng::seed_from_u64(3));
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / 2e6;
        let power = mean(&mut samples.iter().map(|it| it * it));
        // Twenty seconds hold some two thousand independent values: 3 % by chance.
        assert!((power.sqrt() / 0.1 - 1.0).abs() < 0.1, "{power}");
        let step = mean(&mut samples.windows(2).map(|it| (it[1] - it[0]).powi(2)));
        assert!((step / (2.0 * power * TAU * SLOW_HZ * 1e-5) - 1.0).abs() < 0.1, "{step}");
    }

    #[test]
    fn what_is_not_small_is_refused_by_its_name() {
        let refused = |change: fn(&mut Nuisances)| {
            let mut nuisances = Nuisances::default();
            change(&mut nuisances);
            nuisances.check().unwrap_err().to_string()
        };
        assert!(refused(|it| it.wheel_mass_factor = 1.5).contains("wheel_mass_factor"));
        assert!(refused(|it| it.railpad_exponent = 1.0).contains("railpad_exponent"));
        assert!(refused(|it| it.wheel_orders[3].amplitude_m = -1e-6).contains("wheel_orders"));
        let loud = Response { ripple: 0.9, period_hz: 1e3 };
        let loud = Nuisances { response: Some(loud), ..Nuisances::default() };
        assert!(loud.check().unwrap_err().to_string().contains("response.ripple"));
    }
}
