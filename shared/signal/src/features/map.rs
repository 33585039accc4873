//! Maps of the transforms over time and frequency (paper, Fig. 2).

use super::{Extractor, FeatureError};
use crate::Signal;
use num_complex::Complex64;
use std::ops::Range;

/// Magnitudes over frequency and time, with reduced time resolution for a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeFrequencyMap {
    /// Centre time of each column in s, from the first sample of the window.
    pub times_s: Vec<f64>,
    /// Frequency of each row in Hz, ascending. These are the frequencies of the features.
    pub frequencies_hz: Vec<f64>,
    /// Magnitudes in m/s2, row by row. Each value is the root mean square over the instants of its
    /// column, so a narrow ridge remains visible.
    pub magnitudes: Vec<f64>,
}

impl TimeFrequencyMap {
    /// The magnitudes in m/s2 at the frequency with this index, one value per column.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.magnitudes[index * self.times_s.len()..][..self.times_s.len()]
    }
}

/// The instants of each column.
struct Columns {
    instants: usize,
    count: usize,
}

impl Columns {
    fn range(&self, column: usize) -> Range<usize> {
        column * self.instants / self.count..(column + 1) * self.instants / self.count
    }

    fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        (0..self.count).map(|column| self.range(column))
    }

    /// The thinned-out magnitudes of a row.
    fn magnitudes(&self, row: &[Complex64]) -> impl Iterator<Item = f64> {
        self.ranges().map(|instants| {
            let count = instants.len() as f64;
            (row[instants].iter().map(Complex64::norm_sqr).sum::<f64>() / count).sqrt()
        })
    }
}

impl Extractor {
    /// Magnitude `|T|` in m/s2 of the synchrosqueezed transform over a window, in at most `columns`
    /// columns. A steady tone of amplitude `A` gives a line with the value `A`.
    ///
    /// # Errors
    /// The errors of [`Extractor::extract`].
    pub fn sswt_map(
        &self,
        signal: &Signal,
        window: Range<usize>,
        columns: usize,
    ) -> Result<TimeFrequencyMap, FeatureError> {
        let (columns, mut map) = self.empty_map(signal, &window, columns)?;
        map.magnitudes =
            self.squeeze(signal, window, &self.definition().unthinned(), |squeezed| {
                let rows = self.kept().map(|bin| squeezed.bin(bin));
                rows.flat_map(|row| columns.magnitudes(row)).collect()
            })?;
        Ok(map)
    }

    /// Magnitude `2 |W| / (sqrt(a) psihat(mu))` in m/s2 of the wavelet transform over a window, in at
    /// most `columns` columns. A steady tone of amplitude `A` gives a peak with the value `A`.
    ///
    /// # Errors
    /// The errors of [`Extractor::extract`].
    pub fn cwt_map(
        &self,
        signal: &Signal,
        window: Range<usize>,
        columns: usize,
    ) -> Result<TimeFrequencyMap, FeatureError> {
        let (columns, mut map) = self.empty_map(signal, &window, columns)?;
        let height = self.definition().height_of_a_tone();
        let mut rows = Vec::new();
        self.voices(signal, window, &self.definition().unthinned(), |_, voice, _| {
            rows.push(columns.magnitudes(voice).map(|magnitude| magnitude / height).collect());
        })?;
        // Voices descend and reach beyond the features on both sides.
        let highest_hz = map.frequencies_hz[map.frequencies_hz.len() - 1];
        let above = self.voices_above(highest_hz);
        let rows: &[Vec<f64>] = &rows[above..above + map.frequencies_hz.len()];
        map.magnitudes = rows.iter().rev().flatten().copied().collect();
        Ok(map)
    }

    fn empty_map(
        &self,
        signal: &Signal,
        window: &Range<usize>,
        columns: usize,
    ) -> Result<(Columns, TimeFrequencyMap), FeatureError> {
        let rate = signal.sample_rate_hz();
        let instants = self.instants(signal, window)?;
        let interval_s = instants.interval_s(rate);
        let columns = Columns { instants: instants.count, count: columns.clamp(1, instants.count) };
        let middle = |instants: Range<usize>| {
            0.5 * (instants.start + instants.end).saturating_sub(1) as f64 * interval_s
        };
        let map = TimeFrequencyMap {
            times_s: columns.ranges().map(middle).collect(),
            frequencies_hz: self.bins_hz()[self.kept()].to_vec(),
            magnitudes: Vec::new(),
        };
        Ok((columns, map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FeatureDefinition;
    use std::f64::consts::TAU;

    /// A tone of amplitude 3 at the bin nearest to 1 kHz, that bin's place, and its maps.
    fn maps_of_a_tone() -> (usize, TimeFrequencyMap, TimeFrequencyMap) {
        let extractor = Extractor::new(&FeatureDefinition::default()).unwrap();
        let frequencies = extractor.definition().frequencies_hz();
        let bin = frequencies.partition_point(|&f| f < 1000.0);
        let tone = (0..20_000).map(|n| 3.0 * (TAU * frequencies[bin] * f64::from(n) * 1e-5).sin());
        let signal = Signal::new(1e5, tone.collect()).unwrap();
        let cwt = extractor.cwt_map(&signal, 8000..12_000, 50).unwrap();
        let sswt = extractor.sswt_map(&signal, 8000..12_000, 50).unwrap();
        (bin, cwt, sswt)
    }

    #[test]
    fn a_tone_stands_as_high_as_its_amplitude_in_both_maps() {
        let (bin, cwt, sswt) = maps_of_a_tone();
        for (map, neighbours_are_empty) in [(cwt, false), (sswt, true)] {
            assert_eq!(map.times_s.len(), 50);
            assert_eq!(map.magnitudes.len(), 50 * 304);
            // The hill's top is at the bin itself; what voices beyond 3 sigma hold is not missed.
            assert!(map.row(bin).iter().all(|m| (m - 3.0).abs() < 1e-3), "{:?}", map.row(bin));
            assert_eq!(map.row(bin + 2).iter().all(|&m| m < 1e-3), neighbours_are_empty);
        }
    }

    #[test]
    fn times_run_through_the_window() {
        let (_, map, _) = maps_of_a_tone();
        // 1000 instants of 40 us, 20 a column: the first column's middle is 9.5 instants in.
        assert!((map.times_s[0] - 9.5 * 4e-5).abs() < 1e-12);
        assert!((map.times_s[49] - (980.0 + 9.5) * 4e-5).abs() < 1e-12);
    }
}
