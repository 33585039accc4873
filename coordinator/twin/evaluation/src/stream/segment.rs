//! The uninterrupted samples that windows still need.

use super::Reason;
use std::ops::Range;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{JUMP, JUMP_M, TIME_STEP_TOLERANCE};
use tracktwin_signal::samples::Sample;

/// A time step is uneven if it differs from one sample interval by more than [`UNEVEN`] intervals. After
/// [`UNEVEN_STEPS`] uneven steps in a row the sample rate is computed from the times.
const UNEVEN: f64 = 0.25;
const UNEVEN_STEPS: u32 = 100;

/// Samples without a gap. The first samples are dropped when no window needs them.
pub(super) struct Segment {
    sample_rate_hz: f64,
    /// Largest step of the position between two samples in m.
    step_max_m: f64,
    position_m: Vec<f64>,
    acceleration_m_s2: Vec<f64>,
    /// Times in s of the first sample of the segment (dropped or not) and of the last one.
    time_s: [f64; 2],
    /// Number of samples of the segment, including dropped ones.
    count: u64,
    /// Number of uneven time steps in a row, over all segments, and the time in s before the first of them.
    uneven: u32,
    uneven_from_s: f64,
    /// Reason of the interruption before the segment.
    after: Option<Reason>,
}

impl Segment {
    /// An empty segment; the speeds of the models are at most `fastest_m_s`.
    pub(super) fn new(sample_rate_hz: f64, fastest_m_s: f64) -> Self {
        Self {
            sample_rate_hz,
            step_max_m: JUMP * fastest_m_s / sample_rate_hz + JUMP_M,
            position_m: Vec::new(),
            acceleration_m_s2: Vec::new(),
            time_s: [f64::NAN; 2],
            count: 0,
            uneven: 0,
            uneven_from_s: f64::NAN,
            after: None,
        }
    }

    /// Positions in m.
    pub(super) fn position_m(&self) -> &[f64] {
        &self.position_m
    }

    /// The first and the last position in m, if any.
    pub(super) fn ends_m(&self) -> [Option<&f64>; 2] {
        [self.position_m.first(), self.position_m.last()]
    }

    pub(super) fn len(&self) -> usize {
        self.position_m.len()
    }

    /// Reason of the interruption before the segment, if any.
    pub(super) const fn after(&self) -> Option<Reason> {
        self.after
    }

    /// Reason why a sample does not continue the segment; `None` for the first sample.
    pub(super) fn interruption(&self, sample: &Sample) -> Option<Reason> {
        if !(sample.position_m.is_finite() && sample.acceleration_m_s2.is_finite()) {
            return Some(Reason::NotFinite);
        }
        let step_m = sample.position_m - self.position_m.last()?;
        let intervals = self.intervals(sample.time_s);
        // Where a time is not known, the difference is NaN.
        if (intervals - 1.0).abs() > TIME_STEP_TOLERANCE || step_m > self.step_max_m {
            Some(Reason::Gap)
        } else if step_m < 0.0 {
            Some(Reason::RunsBack)
        } else {
            None
        }
    }

    /// Counts the next sample's time, before it is pushed: sample rate in Hz by the last times and its
    /// relative uncertainty, where [`UNEVEN_STEPS`] in a row are not those of the declared rate.
    pub(super) fn count_time(&mut self, time_s: f64) -> Option<(f64, f64)> {
        let intervals = self.intervals(time_s);
        // Repeated times are those of a coarse clock; they say nothing of the rate.
        let is_uneven = intervals > 0.0 && (intervals - 1.0).abs() > UNEVEN;
        if self.position_m.is_empty() || !is_uneven {
            self.uneven = 0;
            return None;
        }
        if self.uneven == 0 {
            self.uneven_from_s = self.time_s[1];
        }
        self.uneven += 1;
        if self.uneven < UNEVEN_STEPS {
            return None;
        }
        self.uneven = 0;
        let steps = f64::from(UNEVEN_STEPS);
        Some((steps / (time_s - self.uneven_from_s), 2.0 / steps))
    }

    /// Sample intervals from the last sample to this time in s.
    fn intervals(&self, time_s: f64) -> f64 {
        (time_s - self.time_s[1]) * self.sample_rate_hz
    }

    /// Ends the segment and begins an empty one.
    pub(super) fn restart(&mut self, after: Reason) {
        self.position_m.clear();
        self.acceleration_m_s2.clear();
        self.count = 0;
        self.after = Some(after);
    }

    /// Adds the next sample, which must be finite.
    pub(super) fn push(&mut self, sample: &Sample) {
        if self.count == 0 {
            self.time_s[0] = sample.time_s;
        }
        self.time_s[1] = sample.time_s;
        self.count += 1;
        self.position_m.push(sample.position_m);
        self.acceleration_m_s2.push(sample.acceleration_m_s2);
    }

    /// Drops the first samples.
    pub(super) fn drop_first(&mut self, count: usize) {
        self.position_m.drain(..count);
        self.acceleration_m_s2.drain(..count);
    }

    /// The samples as a signal.
    pub(super) fn signal(&self) -> Signal {
        Signal::new(self.sample_rate_hz, self.acceleration_m_s2.clone())
            .expect("samples are finite, and there is one")
    }

    /// Mean speed over a range of samples in km/h; NaN for fewer than two samples.
    pub(super) fn speed_km_h(&self, samples: Range<usize>) -> f64 {
        let intervals = samples.len() as f64 - 1.0;
        let positions = &self.position_m[samples];
        match positions {
            [first, .., last] => 3.6 * (last - first) / intervals * self.sample_rate_hz,
            _ => f64::NAN,
        }
    }

    /// Sample rate in Hz and its relative uncertainty, from the times of the segment; `None` without finite
    /// times.
    pub(super) fn observed_rate_hz(&self) -> Option<(f64, f64)> {
        let intervals = self.count.checked_sub(1).filter(|count| *count > 0)? as f64;
        let rate_hz = intervals / (self.time_s[1] - self.time_s[0]);
        rate_hz.is_finite().then_some((rate_hz, 2.0 / intervals))
    }

    /// Whether at least half of the steps of the position are zero.
    pub(super) fn is_coarse(&self, samples: Range<usize>) -> bool {
        let pairs = self.position_m[samples].windows(2);
        let count = pairs.len();
        2 * pairs.filter(|pair| pair[1] != pair[0]).count() <= count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;

    fn sample(index: u32, change: impl Fn(&mut Sample)) -> Sample {
        let time_s = f64::from(index) / RATE_HZ;
        let mut sample = Sample { time_s, position_m: 2.0 * time_s, acceleration_m_s2: 1.0 };
        change(&mut sample);
        sample
    }

    fn segment() -> Segment {
        let mut segment = Segment::new(RATE_HZ, 2.0);
        (0..100).for_each(|index| segment.push(&sample(index, |_| ())));
        segment
    }

    #[test]
    fn what_follows_a_sample_is_no_interruption_and_what_does_not_is_named() {
        let segment = segment();
        let found = |change: &dyn Fn(&mut Sample)| segment.interruption(&sample(100, change));
        assert_eq!(found(&|_| ()), None);
        assert_eq!(found(&|it| it.time_s = f64::NAN), None);
        assert_eq!(found(&|it| it.time_s += 1e-3), Some(Reason::Gap));
        assert_eq!(found(&|it| it.time_s -= 1e-3), Some(Reason::Gap));
        assert_eq!(found(&|it| it.position_m += 0.05), Some(Reason::Gap));
        assert_eq!(found(&|it| it.position_m -= 0.05), Some(Reason::RunsBack));
        assert_eq!(found(&|it| it.position_m = f64::NAN), Some(Reason::NotFinite));
        assert_eq!(found(&|it| it.acceleration_m_s2 = f64::INFINITY), Some(Reason::NotFinite));
    }

    #[test]
    fn a_rate_is_told_by_many_uneven_steps_in_a_row_and_not_by_a_gap_or_a_coarse_clock() {
        for (factor, expected_hz) in [(2.0, 500.0), (0.5, 2000.0)] {
            let mut segment = Segment::new(RATE_HZ, 2.0);
            let told = (0..101).find_map(|index| {
                let sample = sample(index, |it| it.time_s *= factor);
                let told = segment.count_time(sample.time_s);
                segment.restart(Reason::Gap);
                segment.push(&sample);
                told
            });
            let (rate_hz, uncertainty) = told.unwrap();
            assert!((rate_hz / expected_hz - 1.0).abs() < 1e-9 && uncertainty == 0.02);
        }
        let mut segment = segment();
        assert_eq!(segment.count_time(7.0), None);
        let coarse = (0..1000).find_map(|index| {
            let sample = sample(index, |it| it.time_s = f64::from(index / 7 * 7) / RATE_HZ);
            let told = segment.count_time(sample.time_s);
            segment.push(&sample);
            told
        });
        assert_eq!(coarse, None);
    }

    #[test]
    fn speed_and_rate_are_those_of_the_samples() {
        let mut segment = segment();
        segment.drop_first(50);
        assert_eq!(segment.len(), 50);
        assert!((segment.speed_km_h(0..50) - 7.2).abs() < 1e-9);
        let (rate_hz, uncertainty) = segment.observed_rate_hz().unwrap();
        assert!((rate_hz - RATE_HZ).abs() < 1e-6 && (uncertainty - 2.0 / 99.0).abs() < 1e-12);
        assert!(!segment.is_coarse(0..50) && segment.speed_km_h(3..4).is_nan());
        segment.restart(Reason::Gap);
        assert_eq!((segment.observed_rate_hz(), segment.after()), (None, Some(Reason::Gap)));
        for index in 0..100 {
            segment
                .push(&sample(index, |it| it.position_m = (50.0 * it.position_m).floor() / 50.0));
        }
        assert!(segment.is_coarse(0..100));
    }
}
