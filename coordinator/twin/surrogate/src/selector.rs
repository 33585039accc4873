//! Model selector: search for the library entries with the nearest features (paper, 2.4.3.1).

use crate::Error;
use crate::coarse::Coarse;

/// Exact exhaustive search over the feature vectors of a library.
///
/// A first pass computes bounds of all distances from vectors of eight bits per number, which need one
/// eighth of the memory bandwidth. A second pass recomputes, in double precision, the distances of the
/// entries that the bounds leave undecided. The order is therefore exact. Trees are slower in spaces of
/// high dimension.
pub struct Selector {
    features: Vec<f64>,
    dimension: usize,
    coarse: Coarse,
}

/// A library entry and the distance of its feature vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Row of the library, from 0.
    pub entry: usize,
    /// Euclidean distance, in the unit of the features (paper, eq. 7).
    pub distance: f64,
}

/// Mean and standard deviation of one parameter over the nearest entries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Mean over the entries (paper, eq. 8).
    pub mean: f64,
    /// Standard deviation over the entries (n - 1); zero for one entry.
    pub sd: f64,
}

impl Selector {
    /// Makes a selector over the rows of `features` (n x `dimension`, row-major).
    ///
    /// # Errors
    /// [`Error::Shape`] if `features` is empty or its length is no multiple of `dimension`.
    pub fn new(features: Vec<f64>, dimension: usize) -> Result<Self, Error> {
        let rows = features.len().checked_div(dimension).unwrap_or(0);
        if features.is_empty() || rows * dimension != features.len() {
            let expected = (rows + 1) * dimension;
            return Err(Error::Shape { what: "features", expected, found: features.len() });
        }
        let coarse = Coarse::new(&features, dimension);
        Ok(Self { features, dimension, coarse })
    }

    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.features.len() / self.dimension
    }

    /// Feature vector of an entry (row of the library). Panics if there is no such row.
    pub fn features(&self, entry: usize) -> &[f64] {
        &self.features[entry * self.dimension..][..self.dimension]
    }

    /// The `count` nearest entries, sorted by distance; equal distances are sorted by row.
    ///
    /// # Errors
    /// [`Error::Shape`] if `observed` has another dimension.
    pub fn nearest(&self, observed: &[f64], count: usize) -> Result<Vec<Neighbour>, Error> {
        if observed.len() != self.dimension {
            let (expected, found) = (self.dimension, observed.len());
            return Err(Error::Shape { what: "observed features", expected, found });
        }
        let measured = |entry| {
            let distance = distance(self.features(entry), observed);
            Neighbour { entry, distance }
        };
        let mut nearest: Vec<_> =
            self.candidates(observed, count).into_iter().map(measured).collect();
        nearest
            .sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.entry.cmp(&b.entry)));
        nearest.truncate(count);
        Ok(nearest)
    }

    /// Entries that may be among the `count` nearest within the bounds of the rounding.
    fn candidates(&self, observed: &[f64], count: usize) -> Vec<usize> {
        let mut candidates: Vec<(f64, usize)> = Vec::new();
        // The smallest distances that entries do not exceed for certain, ascending.
        let mut surest: Vec<f64> = Vec::with_capacity(count + 1);
        for (entry, [low, high]) in self.coarse.bounds(observed).enumerate() {
            let full = surest.len() == count;
            if full && surest.last().is_none_or(|worst| low > *worst) {
                continue;
            }
            candidates.push((low, entry));
            let place = surest.partition_point(|sure| *sure < high);
            surest.insert(place, high);
            surest.truncate(count);
        }
        let worst = surest.last().copied().unwrap_or(f64::INFINITY);
        candidates.retain(|(low, _)| *low <= worst);
        candidates.into_iter().map(|(_, entry)| entry).collect()
    }
}

impl Selection {
    /// Mean and standard deviation of a parameter's `values` (one per library row) over the nearest
    /// entries.
    pub fn of(nearest: &[Neighbour], values: &[f64]) -> Self {
        let n = nearest.len() as f64;
        let mean = nearest.iter().map(|neighbour| values[neighbour.entry]).sum::<f64>() / n;
        let squares: f64 =
            nearest.iter().map(|neighbour| (values[neighbour.entry] - mean).powi(2)).sum();
        let sd = if nearest.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 };
        Self { mean, sd }
    }
}

/// Natural logarithm of the squared ratio of 1 m/s2 to the reference of acceleration levels, 1 um/s2 (ISO
/// 1683).
const REFERENCE: f64 = 27.631_021_115_928_547;

/// Mean absolute percentage error of `simulated` features against `measured` ones, as natural logarithms of
/// power in m2/s4 (paper, eq. 10; 0.05 is 5 %).
///
/// The percentage is that of the level in dB above 1 um/s2 (ISO 1683), which is positive for every
/// acceleration that a sensor can measure. Powers in m2/s4 have logarithms on both sides of zero, where a
/// percentage has no meaning. The ratio does not depend on the base of the logarithm.
pub fn mape(measured: &[f64], simulated: &[f64]) -> f64 {
    let sum: f64 =
        measured.iter().zip(simulated).map(|(m, s)| ((m - s) / (m + REFERENCE)).abs()).sum();
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
    fn entries_closer_together_than_rounding_tells_are_in_order() {
        // Far from the origin, a billionth of a rounding apart.
        let row = |entry: u32| [1e3 + f64::from((entry * 7) % 40) * 1e-8, 2e3, -1e3];
        let far = [[-1e3, 5.0, 9.0]; 3];
        let features = (0..40).flat_map(row).chain(far.into_iter().flatten()).collect();
        let selector = Selector::new(features, 3).unwrap();
        let nearest = selector.nearest(&[1e3 - 1e-9, 2e3, -1e3], 5).unwrap();
        let entries: Vec<_> = nearest.iter().map(|near| (near.entry * 7) % 40).collect();
        assert_eq!(entries, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn none_and_more_than_all_may_be_asked_for() {
        assert!(selector().nearest(&[1.0, -2.0, 3.0], 0).unwrap().is_empty());
        assert_eq!(selector().nearest(&[1.0, -2.0, 3.0], 2000).unwrap().len(), 1000);
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
    fn a_percentage_error_is_that_of_the_level_above_a_micrometre_per_second_squared() {
        // 120 dB and 60 dB, simulated as 126 dB and 57 dB: 5 % each.
        let power = |level_db: f64| (10f64.powf(level_db / 20.0) * 1e-6).powi(2).ln();
        let error = mape(&[power(120.0), power(60.0)], &[power(126.0), power(57.0)]);
        assert!((error - 0.05).abs() < 1e-12);
    }

    #[test]
    fn another_dimension_is_refused() {
        assert!(selector().nearest(&[1.0], 5).is_err());
        assert!(Selector::new(vec![1.0; 7], 3).is_err());
    }
}
