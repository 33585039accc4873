//! A sampled signal that has been checked once.

/// Evenly sampled values, all finite; an axle-box acceleration in m/s2 unless stated otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    sample_rate_hz: f64,
    samples: Vec<f64>,
}

/// Why samples do not form a valid signal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SignalError {
    /// The sample rate is zero, negative, NaN or infinite.
    #[error("the sample rate must be a positive number of hertz, not {0}")]
    SampleRate(f64),
    /// There are no samples.
    #[error("the signal has no samples")]
    Empty,
    /// A sample is NaN or infinite.
    #[error("sample {index} is {value}, not a finite number")]
    NotFinite {
        /// Index of the first such sample, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
}

impl Signal {
    /// A signal of these samples at `sample_rate_hz` in Hz.
    ///
    /// # Errors
    /// [`SignalError`]. [`SignalError::NotFinite`] names the first sample that is NaN or infinite.
    pub fn new(sample_rate_hz: f64, samples: Vec<f64>) -> Result<Self, SignalError> {
        if !(sample_rate_hz.is_finite() && sample_rate_hz > 0.0) {
            return Err(SignalError::SampleRate(sample_rate_hz));
        }
        if samples.is_empty() {
            return Err(SignalError::Empty);
        }
        match samples.iter().position(|sample| !sample.is_finite()) {
            Some(index) => Err(SignalError::NotFinite { index, value: samples[index] }),
            None => Ok(Self { sample_rate_hz, samples }),
        }
    }

    /// Sample rate in Hz.
    pub const fn sample_rate_hz(&self) -> f64 {
        self.sample_rate_hz
    }

    /// The samples.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Number of samples, at least one.
    #[expect(clippy::len_without_is_empty, reason = "a signal is never empty")]
    pub const fn len(&self) -> usize {
        self.samples.len()
    }

    /// Number of samples times their interval, in s.
    pub fn duration_s(&self) -> f64 {
        self.len() as f64 / self.sample_rate_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sample_that_is_not_finite_is_named() {
        let samples = vec![0.0, 1.0, f64::INFINITY, f64::INFINITY];
        let error = Signal::new(1e5, samples).unwrap_err();
        assert_eq!(error, SignalError::NotFinite { index: 2, value: f64::INFINITY });
    }

    #[test]
    fn a_signal_has_samples_and_a_positive_rate() {
        assert_eq!(Signal::new(1e5, vec![]), Err(SignalError::Empty));
        for rate in [0.0, -1.0, f64::INFINITY] {
            assert_eq!(Signal::new(rate, vec![0.0]), Err(SignalError::SampleRate(rate)));
        }
        assert!(matches!(Signal::new(f64::NAN, vec![0.0]), Err(SignalError::SampleRate(_))));
    }
}
