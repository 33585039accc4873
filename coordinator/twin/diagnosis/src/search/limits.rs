//! What several steps of a diagnosis must agree on.

/// Least gain in nats of a name on passes that it was not fitted to.
pub(crate) const HELD_OUT_MIN: f64 = 4.0;

/// Probability of a false alarm on a recording without anything left out.
pub(super) const FALSE_ALARM: f64 = 0.05;

/// Candidates of one kind that are fitted together with the baseline.
pub(super) const REFINED_PER_KIND: usize = 2;
