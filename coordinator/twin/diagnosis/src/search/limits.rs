//! Limits that several steps of a diagnosis share.

/// Smallest gain in nats of a kind on passes that were not fitted.
pub(crate) const HELD_OUT_MIN: f64 = 4.0;

/// False-alarm rate on a recording with nothing left out.
pub(super) const FALSE_ALARM: f64 = 0.05;

/// Largest number of candidates of one kind that are fitted together with the baseline.
pub(super) const REFINED_PER_KIND: usize = 2;
