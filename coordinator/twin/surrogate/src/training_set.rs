//! Training set of the models, and its check.

use crate::Error;
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::ops::Range;
use tracktwin_parameters::{Parameter, Scale};

/// Finished cases of a library: parameters and simulated ln-powers.
#[derive(Clone, Debug)]
pub struct TrainingSet {
    /// Frequencies of the bins in Hz, ascending.
    pub frequencies_hz: Vec<f64>,
    /// Speeds in km/h.
    pub speeds_km_h: Vec<f64>,
    /// One table per speed: natural logarithms of the power of the bins, entries x bins, row-major.
    pub log_power: Vec<Vec<f64>>,
    /// The parameters that vary.
    pub varied: Vec<Parameter>,
    /// Scale of each varied parameter, on which it is mapped onto [0, 1].
    pub scales: Vec<Scale>,
    /// Values of the varied parameters in SI units, entries x varied, row-major.
    pub parameters: Vec<f64>,
    /// Name of the campaign.
    pub campaign: String,
    /// Digest of the library's results.
    pub library_digest: String,
    /// Definition of the features, as recorded in the library.
    pub feature_definition: serde_json::Value,
}

/// Split of the entries into training and test half.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Entries to train on, in random order.
    pub train: Vec<usize>,
    /// The rest, in random order.
    pub test: Vec<usize>,
}

impl TrainingSet {
    /// Number of entries.
    pub fn entries(&self) -> usize {
        self.parameters.len().checked_div(self.varied.len()).unwrap_or(0)
    }

    /// Returns an error if a table has a wrong size, a number is not finite or a parameter is constant.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let entries = self.entries();
        let size = |what, table: &[f64], columns: usize| {
            let (expected, found) = (entries * columns, table.len());
            if expected == found { Ok(()) } else { Err(Error::Shape { what, expected, found }) }
        };
        size("parameters", &self.parameters, self.varied.len())?;
        if self.scales.len() != self.varied.len() {
            let (expected, found) = (self.varied.len(), self.scales.len());
            return Err(Error::Shape { what: "scales", expected, found });
        }
        finite("parameters", &self.parameters, self.varied.len())?;
        if self.log_power.len() != self.speeds_km_h.len() {
            let (expected, found) = (self.speeds_km_h.len(), self.log_power.len());
            return Err(Error::Shape { what: "tables of ln-power", expected, found });
        }
        for (table, speed) in self.log_power.iter().zip(&self.speeds_km_h) {
            size("ln-power", table, self.frequencies_hz.len())?;
            finite(&format!("ln-power at {speed} km/h"), table, self.frequencies_hz.len())?;
        }
        for (column, parameter) in self.varied.iter().enumerate() {
            let [low, high] = self.range(column);
            if low >= high {
                return Err(Error::Constant(parameter.to_string()));
            }
        }
        Ok(())
    }

    /// Lowest and highest value of a varied parameter, in SI units; `column` is its index in `varied`.
    pub fn range(&self, column: usize) -> [f64; 2] {
        let values = self.parameters.iter().skip(column).step_by(self.varied.len());
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)])
    }

    /// Value of a varied parameter mapped onto [0, 1] by range and scale; `column` is its index in `varied`.
    pub fn unit(&self, column: usize, value: f64) -> f64 {
        self.scales[column].share(self.range(column), value)
    }

    /// Given columns of given entries, with the speeds (indices) one after the other: entries x (speeds *
    /// columns).
    pub(crate) fn features(
        &self,
        entries: &[usize],
        speeds: &[usize],
        columns: &Range<usize>,
    ) -> Mat<f64> {
        let (bins, width) = (self.frequencies_hz.len(), columns.len());
        Mat::from_fn(entries.len(), speeds.len() * width, |i, j| {
            self.log_power[speeds[j / width]][entries[i] * bins + columns.start + j % width]
        })
    }

    /// Parameter values of given entries, entries x varied.
    pub(crate) fn values(&self, entries: &[usize]) -> Mat<f64> {
        let p = self.varied.len();
        Mat::from_fn(entries.len(), p, |i, j| self.parameters[entries[i] * p + j])
    }
}

impl Split {
    /// Splits `entries` at random into a training half and a test half; `seed` fixes the order.
    pub fn halves(entries: usize, seed: u64) -> Self {
        let mut order: Vec<usize> = (0..entries).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for last in (1..entries).rev() {
            // 64 random bits against a few thousand places: the bias is below 1e-15.
            let chosen = random.next_u64() % (last as u64 + 1);
            order.swap(last, usize::try_from(chosen).expect("not beyond the last place"));
        }
        let test = order.split_off(entries.div_ceil(2));
        Self { train: order, test }
    }
}

fn finite(what: &str, table: &[f64], columns: usize) -> Result<(), Error> {
    match table.iter().position(|v| !v.is_finite()) {
        Some(place) => Err(Error::NotFinite { what: what.to_owned(), entry: place / columns }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_part_the_entries_the_same_way_for_the_same_seed() {
        let split = Split::halves(11, 5);
        assert_eq!((split.train.len(), split.test.len()), (6, 5));
        let mut all = [split.train.clone(), split.test.clone()].concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..11));
        assert_eq!(split, Split::halves(11, 5));
        assert_ne!(split, Split::halves(11, 6));
    }

    #[test]
    fn a_number_that_is_not_finite_is_named_by_its_entry() {
        let mut set = TrainingSet {
            frequencies_hz: vec![100.0, 200.0],
            speeds_km_h: vec![13.0],
            log_power: vec![vec![0.0; 6]],
            varied: vec![Parameter::BallastStiffness],
            scales: vec![Scale::Linear],
            parameters: vec![1.0, 2.0, 3.0],
            campaign: String::new(),
            library_digest: String::new(),
            feature_definition: serde_json::Value::Null,
        };
        assert!(set.check().is_ok());
        set.log_power[0][5] = f64::NEG_INFINITY;
        assert_eq!(
            set.check().unwrap_err().to_string(),
            "ln-power at 13 km/h: entry 2 is not a finite number"
        );
    }
}
