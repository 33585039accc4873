//! Feature sets: names with ranges of bins. The signal crate defines the frequencies of the bins.

use crate::Error;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A feature set: contiguous bins of the ln-power at one speed (paper, eq. 9).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureColumns {
    /// Name, e.g. `GF` or `LF1`.
    pub name: String,
    /// Range of bins.
    pub columns: Range<usize>,
}

impl FeatureColumns {
    /// A feature set with this name and these bins.
    pub fn new(name: impl Into<String>, columns: Range<usize>) -> Self {
        Self { name: name.into(), columns }
    }

    /// The bins with frequencies from `low_hz` to `high_hz`, both ends included.
    pub fn in_band(
        name: impl Into<String>,
        frequencies_hz: &[f64],
        low_hz: f64,
        high_hz: f64,
    ) -> Self {
        let start = frequencies_hz.partition_point(|&f| f < low_hz);
        let end = frequencies_hz.partition_point(|&f| f <= high_hz);
        Self::new(name, start..end.max(start))
    }

    /// Returns [`Error::Columns`] if the range is empty or exceeds `bins`.
    pub(crate) fn check(&self, bins: usize) -> Result<(), Error> {
        if self.columns.is_empty() || self.columns.end > bins {
            return Err(Error::Columns {
                feature: self.name.clone(),
                start: self.columns.start,
                end: self.columns.end,
                bins,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_holds_the_frequencies_on_its_edges() {
        let feature =
            FeatureColumns::in_band("LF1", &[100.0, 400.0, 500.0, 700.0, 800.0], 400.0, 700.0);
        assert_eq!(feature.columns, 1..4);
    }

    #[test]
    fn a_range_beyond_the_last_bin_is_refused() {
        assert!(FeatureColumns::new("LF4", 3..6).check(5).is_err());
        assert!(FeatureColumns::new("LF4", 3..5).check(5).is_ok());
    }
}
