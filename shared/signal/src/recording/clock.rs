//! Timing of a column of times: even, in coarse steps, with jitter, or with gaps.

use super::error::Fault;

/// Deviation of a single time step, in sample intervals, that rounded times may show.
pub const STEP_TOLERANCE: f64 = 0.5;
/// Largest error of a time stamp with jitter, in sample intervals.
const JITTER_MAX: f64 = 1.0;
/// Sample intervals from which on steps of the clock are coarse: a repeated row makes steps of one.
const COARSE_MIN: f64 = 1.1;
/// Largest deviation of even times from a constant rate, as a share of the duration.
const RATE_CHANGE: f64 = 1e-3;
/// Relative accuracy of a rate from times that advance evenly.
const ACCURACY: f64 = 1e-6;

/// How the samples of a pass follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SampleClock {
    /// Samples per second in Hz.
    pub rate_hz: f64,
    /// Relative uncertainty of that rate.
    pub uncertainty: f64,
    /// Deviation of the time stamps from even times.
    pub stamps: Stamps,
}

/// Accuracy of single time stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stamps {
    /// Even up to rounding.
    Even,
    /// The clock advances in steps of this length in s, longer than a sample interval.
    Coarse(f64),
    /// Jitter of up to this time in s, but never more than a sample interval.
    Jitter(f64),
}

impl SampleClock {
    /// Determines the timing of `times` in s. There must be at least two times.
    ///
    /// # Errors
    /// [`Fault::UnevenTime`] if samples are missing, repeated or out of order, or if their rate changes.
    pub(super) fn of(times: &[f64]) -> Result<Self, Fault> {
        let last = times.len() - 1;
        let mean = (times[last] - times[0]) / last as f64;
        if let Some(fault) = uneven_step(times, mean) {
            return coarse(times, mean).or_else(|| jitter(times, mean)).ok_or(fault);
        }
        let (row, off_s) = farthest(times, 0, mean);
        if off_s > mean.max(RATE_CHANGE * (times[last] - times[0])) {
            return Err(changing_rate(times, row, mean));
        }
        Ok(Self { rate_hz: 1.0 / mean, uncertainty: ACCURACY, stamps: Stamps::Even })
    }

    /// The rate with as few digits as its uncertainty allows, in Hz: clocks have round rates.
    pub(super) fn round_rate_hz(&self) -> f64 {
        let with = |digits: usize| {
            let text = format!("{:.*e}", digits, self.rate_hz);
            text.parse::<f64>().unwrap_or(self.rate_hz)
        };
        let fits = |rate: &f64| (rate / self.rate_hz - 1.0).abs() <= self.uncertainty;
        (0..8).map(with).find(fits).unwrap_or(self.rate_hz)
    }
}

/// The error of times whose rate changes at a row: of its two steps the one that differs most from the mean.
fn changing_rate(times: &[f64], row: usize, mean: f64) -> Fault {
    let around = [row, row + 1].into_iter().filter(|row| (1..times.len()).contains(row));
    let steps = around.map(|row| (row, times[row] - times[row - 1]));
    let other = |(_, step): &(usize, f64)| (step - mean).abs();
    let (row, step) = steps.max_by(|a, b| other(a).total_cmp(&other(b))).unwrap_or((row, mean));
    let alternative = " or where the rate changes, or resample it to one rate";
    Fault::UnevenTime { row: row + 1, step, expected: mean, alternative }
}

/// Times that are constant and then advance by whole steps of a clock.
fn coarse(times: &[f64], mean: f64) -> Option<SampleClock> {
    let changes: Vec<usize> = (1..times.len()).filter(|&i| times[i] != times[i - 1]).collect();
    let steps = || changes.iter().map(|&i| times[i] - times[i - 1]);
    let step_s = steps().fold(f64::INFINITY, f64::min);
    if changes.len() < 3 || step_s <= 0.0 || step_s < COARSE_MIN * mean {
        return None;
    }
    let (first, last) = (changes[0], changes[changes.len() - 1]);
    let interval = (times[last] - times[first]) / (last - first) as f64;
    let whole = |step: f64| (step / step_s - (step / step_s).round()).abs() < 0.1;
    let (_, off) = farthest(times, first, interval);
    if !(steps().all(whole) && off <= step_s + interval) {
        return None;
    }
    let uncertainty = 1.0 / (last - first) as f64;
    Some(SampleClock { rate_hz: 1.0 / interval, uncertainty, stamps: Stamps::Coarse(step_s) })
}

/// Time stamps with jitter about even times.
fn jitter(times: &[f64], mean: f64) -> Option<SampleClock> {
    let (_, off) = farthest(times, 0, mean);
    let advances = times.windows(2).all(|pair| pair[1] > pair[0]);
    let uncertainty = 2.0 * off / (mean * (times.len() - 1) as f64);
    (advances && off <= JITTER_MAX * mean).then_some(SampleClock {
        rate_hz: 1.0 / mean,
        uncertainty: uncertainty.max(ACCURACY),
        stamps: Stamps::Jitter(off),
    })
}

/// The row with the largest deviation from times that are even from row `first` on, and this deviation in s.
fn farthest(times: &[f64], first: usize, interval: f64) -> (usize, f64) {
    let off = |(row, time): (usize, &f64)| {
        (row, (time - times[first] - (row as f64 - first as f64) * interval).abs())
    };
    let all = times.iter().enumerate().map(off);
    all.fold((0, 0.0), |farthest, it| if it.1 > farthest.1 { it } else { farthest })
}

/// The first step that differs from the others by more than rounding.
fn uneven_step(times: &[f64], mean: f64) -> Option<Fault> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let index = steps.len() / 2;
    // The median step is what a gap cannot move; the mean is what rounding cannot move.
    let median = *steps.clone().select_nth_unstable_by(index, f64::total_cmp).1;
    let expected = if (mean / median - 1.0).abs() < STEP_TOLERANCE { mean } else { median };
    let odd = |step: f64| !(step > 0.0 && (step - expected).abs() <= STEP_TOLERANCE * expected);
    let row = steps.iter().position(|&step| odd(step))?;
    let step = steps.swap_remove(row);
    Some(Fault::UnevenTime { row: row + 2, step, expected, alternative: "" })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 25_600.0;

    fn times(stamp: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..40_000).map(|row| stamp(f64::from(row) / RATE_HZ)).collect()
    }

    #[test]
    fn even_times_from_any_instant_have_their_rate() {
        for begin in [0.0, 3.7, 1.7e9] {
            let clock = SampleClock::of(&times(|time| begin + time)).unwrap();
            assert_eq!((clock.stamps, clock.round_rate_hz()), (Stamps::Even, RATE_HZ), "{begin}");
        }
    }

    #[test]
    fn a_clock_in_coarse_steps_has_the_rate_of_its_samples() {
        for step in [1e-3, 1e-2, 5e-5] {
            let rounded = times(|time| (time / step).round() * step);
            let clock = SampleClock::of(&rounded).unwrap();
            let Stamps::Coarse(found) = clock.stamps else { panic!("{step}: {clock:?}") };
            assert!((found / step - 1.0).abs() < 1e-6, "{found} for {step}");
            assert_eq!(clock.round_rate_hz(), RATE_HZ, "{clock:?}");
        }
    }

    #[test]
    fn stamps_that_tremble_by_less_than_a_sample_are_even_underneath() {
        let tremble = |time: f64| time + 0.45 / RATE_HZ * (1e5 * time).sin();
        let clock = SampleClock::of(&times(tremble)).unwrap();
        assert!(matches!(clock.stamps, Stamps::Jitter(_)), "{clock:?}");
        assert!((clock.round_rate_hz() / RATE_HZ - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_rate_that_changes_is_refused_at_the_row_of_the_change() {
        let half = 20_000.0 / RATE_HZ;
        let changed = times(|time| if time <= half { time } else { half + 1.4 * (time - half) });
        let fault = SampleClock::of(&changed).unwrap_err();
        let Fault::UnevenTime { row: 20_002, .. } = fault else { panic!("{fault:?}") };
        assert!(fault.to_string().contains("resample it to one rate"), "{fault}");
        // A recorder whose quartz drifts by some 1e-5.
        let drifting = times(|time| time + 1e-5 * time * time);
        assert_eq!(SampleClock::of(&drifting).unwrap().stamps, Stamps::Even);
    }

    #[test]
    fn gaps_repeated_rows_and_rows_out_of_order_are_none_of_these() {
        let rounded = || times(|time| (time * 1e3).round() / 1e3);
        let mut cases = [times(|time| time), times(|time| time), times(|time| time), rounded()];
        cases[0].insert(700, 700.0 / RATE_HZ);
        cases[1].swap(700, 720);
        cases[2].drain(700..720);
        cases[3].drain(700..900);
        for (index, times) in cases.iter().enumerate() {
            assert!(
                matches!(SampleClock::of(times), Err(Fault::UnevenTime { .. })),
                "case {index}"
            );
        }
    }
}
