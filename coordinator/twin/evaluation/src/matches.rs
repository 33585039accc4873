//! The library entries nearest to a sleeper's features.

use crate::evaluation::{Estimate, Estimates, Selected};
use crate::{Error, SpeedFeatures};
use std::collections::HashMap;
use tracktwin_surrogate::{Selection, Selector, TrainingSet, mape};

/// Number of nearest entries that are averaged (paper, section 3.1.2).
pub const MATCHES: usize = 10;

/// Selectors over the library, one for every set of speeds in use.
pub(crate) struct Matcher<'a> {
    library: &'a TrainingSet,
    /// Values of every varied parameter, one per entry.
    values: Vec<Vec<f64>>,
    selectors: HashMap<Vec<usize>, Selector>,
}

impl<'a> Matcher<'a> {
    pub(crate) fn new(library: &'a TrainingSet) -> Self {
        let columns = library.varied.len();
        let column = |column| library.parameters.iter().skip(column).step_by(columns).copied();
        let values = (0..columns).map(|index| column(index).collect()).collect();
        Self { library, values, selectors: HashMap::new() }
    }

    /// The best matches of a sleeper's features, with all its speeds one after the other.
    pub(crate) fn select(&mut self, speeds: &[SpeedFeatures]) -> Result<Selected, Error> {
        let key: Vec<usize> = speeds.iter().map(|known| known.speed).collect();
        let observed: Vec<f64> =
            speeds.iter().flat_map(|known| known.log_power.iter().copied()).collect();
        if !self.selectors.contains_key(&key) {
            let selector = Selector::new(side_by_side(self.library, &key), observed.len())?;
            self.selectors.insert(key.clone(), selector);
        }
        let selector = &self.selectors[&key];
        let nearest = selector.nearest(&observed, MATCHES)?;
        let error = |entry| mape(&observed, selector.features(entry));
        let pairs = self.library.varied.iter().zip(&self.values);
        let estimates: Estimates = pairs
            .map(|(&parameter, values)| {
                let Selection { mean, sd } = Selection::of(&nearest, values);
                (parameter, Estimate { mean, sd })
            })
            .collect();
        Ok(Selected {
            estimates,
            entries: nearest.iter().map(|neighbour| neighbour.entry).collect(),
            mape: nearest.iter().map(|neighbour| error(neighbour.entry)).collect(),
        })
    }

    /// Natural logarithms of the LWPS of library entries at a speed, one value per bin.
    pub(crate) fn log_powers(&self, speed: usize, entries: &[usize]) -> Vec<Vec<f64>> {
        entries.iter().map(|&entry| row(self.library, speed, entry).to_vec()).collect()
    }
}

/// The ln-powers of all entries with these speeds one after the other, row-major.
fn side_by_side(library: &TrainingSet, speeds: &[usize]) -> Vec<f64> {
    let bins = library.frequencies_hz.len();
    let mut table = Vec::with_capacity(library.entries() * speeds.len() * bins);
    for entry in 0..library.entries() {
        for &speed in speeds {
            table.extend_from_slice(row(library, speed, entry));
        }
    }
    table
}

fn row(library: &TrainingSet, speed: usize, entry: usize) -> &[f64] {
    let bins = library.frequencies_hz.len();
    &library.log_power[speed][entry * bins..][..bins]
}
