//! What several steps of a search must agree on.

/// Probability of a false alarm on a recording without anything left out.
pub(super) const FALSE_ALARM: f64 = 0.05;

/// Candidates of one kind that are fitted together with the baseline.
pub(super) const REFINED_PER_KIND: usize = 2;
