//! A pass as the measuring chain records it.

use num_complex::Complex64;
use rustfft::FftPlannerScalar;

/// Acceleration and position of a pass inside the measuring chain. Each fault of the chain changes them
/// in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Time between samples in s.
    pub time_step_s: f64,
    /// Axle-box acceleration in m/s2, positive downwards.
    pub acceleration_m_s2: Vec<f64>,
    /// Position of the wheel along the track in m at each sample.
    pub position_m: Vec<f64>,
    /// Index of the first sample that is kept. The samples before it are the run-in.
    pub first: usize,
}

impl Measured {
    /// Applies a linear filter to the acceleration. `transfer` is the ratio of output to input at a
    /// frequency in Hz, in the convention `exp(+i w t)`.
    ///
    /// The function pads the signal with the same number of zeros, so that the response after the end of
    /// the signal does not wrap around.
    pub(super) fn filter(&mut self, transfer: impl Fn(f64) -> Complex64) {
        let samples = self.acceleration_m_s2.len();
        let points = (2 * samples).next_power_of_two();
        let mut spectrum: Vec<_> =
            self.acceleration_m_s2.iter().map(|&value| Complex64::from(value)).collect();
        spectrum.resize(points, Complex64::ZERO);
        // The portable planner: the same bits on every processor.
        let mut planner = FftPlannerScalar::new();
        planner.plan_fft_forward(points).process(&mut spectrum);
        let step_hz = 1.0 / (points as f64 * self.time_step_s);
        for index in 0..=points / 2 {
            let factor = transfer(index as f64 * step_hz) / points as f64;
            spectrum[index] *= factor;
            if index > 0 && index < points / 2 {
                spectrum[points - index] *= factor.conj();
            }
        }
        planner.plan_fft_inverse(points).process(&mut spectrum);
        for (value, filtered) in self.acceleration_m_s2.iter_mut().zip(spectrum) {
            *value = filtered.re;
        }
    }
}
