//! Comparison of a sleeper with its neighbours.

use tracktwin_inspection::median;

/// Smallest log ratio of an outlier's stiffness to that of its neighbours: three standard deviations of the
/// variation between railpads.
pub(crate) const FAR: f64 = 0.6;

/// Number of sleepers on either side with which a sleeper is compared.
const NEIGHBOURS: usize = 3;

/// Median of the values of the sleepers near this one, without its own.
pub(crate) fn usual_near(values: &[f64], sleeper: usize) -> f64 {
    let near = sleeper.saturating_sub(NEIGHBOURS)..values.len().min(sleeper + NEIGHBOURS + 1);
    median(near.filter(|other| *other != sleeper).map(|other| values[other]).collect())
}
