//! The model selector: the library entries whose features are nearest (paper, 2.4.3.1).

use crate::Error;
use rayon::prelude::*;

/// Feature vectors of a library, searched exhaustively and exactly.
///
/// Ten of 10,000 entries with 300 bins take about a millisecond; trees are slower in so many
/// dimensions, and single precision changes the order of close matches.
pub struct Selector {
    features: Vec<f64>,
    dimension: usize,
}

/// A library entry and how far its feature vector is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Row of the library.
    pub entry: usize,
    /// Euclidean distance, in the unit of the features (paper, eq. 7).
    pub distance: f64,
}

/// What the nearest entries say of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Mean over the entries (paper, eq. 8).
    pub mean: f64,
    /// Standard deviation over the entries (n - 1); zero for one entry.
    pub sd: f64,
}

/// Rows a task measures: some 100 kB of features, so that tasks are few and fit the cache.
const ROWS_A_TASK: usize = 64;

impl Selector {
    /// A selector over rows of `features` (n x `dimension`, row-major).
    ///
    /// # Errors
    /// [`Error::Shape`] when the numbers do not fill whole rows.
    pub fn new(features: Vec<f64>, dimension: usize) -> Result<Self, Error> {
        let rows = features.len().checked_div(dimension).unwrap_or(0);
        if features.is_empty() || rows * dimension != features.len() {
            let expected = (rows + 1) * dimension;
            return Err(Error::Shape { what: "features", expected, found: features.len() });
        }
        Ok(Self { features, dimension })
    }

    /// How many entries there are.
    pub fn entries(&self) -> usize {
        self.features.len() / self.dimension
    }

    /// The feature vector of an entry.
    pub fn features(&self, entry: usize) -> &[f64] {
        &self.features[entry * self.dimension..][..self.dimension]
    }

    /// The `count` nearest entries, the nearest first; equal distances by row.
    ///
    /// # Errors
    /// [`Error::Shape`] when `observed` has another dimension.
    pub fn nearest(&self, observed: &[f64], count: usize) -> Result<Vec<Neighbour>, Error> {
        if observed.len() != self.dimension {
            let (expected, found) = (self.dimension, observed.len());
            return Err(Error::Shape { what: "observed features", expected, found });
        }
        let mut all: Vec<Neighbour> = self
            .features
            .par_chunks(self.dimension)
            .with_min_len(ROWS_A_TASK)
            .enumerate()
            .map(|(entry, row)| Neighbour { entry, distance: distance(row, observed) })
            .collect();
        let by_distance = |a: &Neighbour, b: &Neighbour| {
            a.distance.total_cmp(&b.distance).then(a.entry.cmp(&b.entry))
        };
        let count = count.min(all.len());
        if count < all.len() {
            all.select_nth_unstable_by(count, by_distance);
            all.truncate(count);
        }
        all.sort_unstable_by(by_distance);
        Ok(all)
    }
}

impl Selection {
    /// Mean and spread of a parameter's `values` (one a library row) over the nearest entries.
    pub fn of(nearest: &[Neighbour], values: &[f64]) -> Self {
        let n = nearest.len() as f64;
        let mean = nearest.iter().map(|neighbour| values[neighbour.entry]).sum::<f64>() / n;
        let squares: f64 =
            nearest.iter().map(|neighbour| (values[neighbour.entry] - mean).powi(2)).sum();
        let sd = if nearest.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 };
        Self { mean, sd }
    }
}

/// Mean absolute percentage error of `simulated` features against `measured` ones (paper, eq. 10;
/// 0.05 is 5 %).
///
/// Depends on the unit in which the logarithm of the power is taken: it is a relative error of a
/// quantity without a natural zero. Compare only values made in one way.
pub fn mape(measured: &[f64], simulated: &[f64]) -> f64 {
    let sum: f64 = measured.iter().zip(simulated).map(|(m, s)| ((m - s) / m).abs()).sum();
    sum / measured.len() as f64
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn selector() -> Selector {
        let features = (0..3000).map(|i| (f64::from(i) * 12.9898).sin() * 10.0).collect();
        Selector::new(features, 3).unwrap()
    }

    #[test]
    fn the_order_is_that_of_a_full_sort() {
        let selector = selector();
        let observed = [1.0, -2.0, 3.0];
        let mut all: Vec<(f64, usize)> = (0..selector.entries())
            .map(|entry| (distance(selector.features(entry), &observed), entry))
            .collect();
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let nearest = selector.nearest(&observed, 10).unwrap();
        let found: Vec<(f64, usize)> = nearest.iter().map(|n| (n.distance, n.entry)).collect();
        assert_eq!(found, all[..10]);
    }

    #[test]
    fn an_entry_of_the_library_is_its_own_nearest() {
        let selector = selector();
        let nearest = selector.nearest(selector.features(417), 1).unwrap();
        assert_eq!(nearest, [Neighbour { entry: 417, distance: 0.0 }]);
    }

    #[test]
    fn mean_and_spread_are_those_of_the_nearest_entries() {
        let near = |entry| Neighbour { entry, distance: 0.0 };
        let selection = Selection::of(&[near(0), near(2)], &[1.0, 100.0, 3.0]);
        assert_eq!(selection, Selection { mean: 2.0, sd: 2.0f64.sqrt() });
    }

    #[test]
    fn a_percentage_error_is_relative_to_the_measurement() {
        assert_eq!(mape(&[8.0, -16.0], &[9.0, -12.0]), 0.1875);
    }

    #[test]
    fn another_dimension_is_refused() {
        assert!(selector().nearest(&[1.0], 5).is_err());
        assert!(Selector::new(vec![1.0; 7], 3).is_err());
    }
}
