//! Reassignment of a coefficient to the bin nearest to its instantaneous frequency, without logarithms.

use num_complex::Complex64;

/// Bins that are evenly spaced in the logarithm of frequency, as a table over the leading bits of
/// a floating-point number.
///
/// A cell of the table is narrower than a bin and therefore contains at most one border. The bin is that
/// of the cell or the next one. Row 0 and the last row represent frequencies outside all bins.
#[derive(Debug)]
pub(super) struct Bins {
    /// Bits of the mantissa that a cell leaves out.
    shift: u32,
    /// Leading bits of the first cell.
    base: u64,
    cells: Vec<Cell>,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    row: usize,
    /// Frequencies in Hz from here on belong to the next row; NaN where there is none.
    border_hz: f64,
}

/// Bits of the mantissa of an `f64`.
const MANTISSA_BITS: u32 = 52;

impl Bins {
    /// The bins at these ascending frequencies in Hz, `voices` an octave.
    pub(super) fn new(frequencies_hz: &[f64], voices: u32) -> Self {
        let half_bin = (0.5 / f64::from(voices)).exp2();
        let mut borders_hz: Vec<_> = frequencies_hz.iter().map(|f| f / half_bin).collect();
        borders_hz.extend(frequencies_hz.last().map(|f| f * half_bin));

        // A cell spans at most 2^-bits of its lower end; a bin spans ln 2 / voices.
        let bits = (f64::from(voices) / std::f64::consts::LN_2).log2().ceil();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 9")]
        let shift = MANTISSA_BITS - bits as u32;
        let base = borders_hz[0].to_bits() >> shift;
        let last = (borders_hz[borders_hz.len() - 1].to_bits() >> shift) + 1;
        let cell = |leading: u64| {
            let row = borders_hz.partition_point(|&b| b <= f64::from_bits(leading << shift));
            Cell { row, border_hz: borders_hz.get(row).copied().unwrap_or(f64::NAN) }
        };
        Self { shift, base, cells: (base..=last).map(cell).collect() }
    }

    /// The row of a frequency in Hz; anything outside, NaN included, gets row 0 or the last.
    #[inline]
    pub(super) fn row(&self, frequency_hz: f64) -> usize {
        // Smaller numbers wrap around, negative ones and NaN have the highest bits set: all end in
        // the last cell.
        let leading = (frequency_hz.to_bits() >> self.shift).wrapping_sub(self.base);
        let last = self.cells.len() - 1;
        let cell = self.cells[usize::try_from(leading).map_or(last, |place| place.min(last))];
        cell.row + usize::from(frequency_hz >= cell.border_hz)
    }
}

/// Accumulator of the synchrosqueezed transform: one row per bin, with every instant of the window, or
/// every second, fourth, ... of them.
#[derive(Debug, Default)]
pub(super) struct Squeezed {
    /// First the cells for values without a bin or instant, then the values of the bins, row by row.
    values: Vec<Complex64>,
    rows: Vec<Row>,
    /// Instants of the window when none is left out.
    instants: usize,
    frequencies_hz: Vec<f64>,
    places: Vec<u32>,
    targets: Vec<Target>,
    /// Number of halvings of the voices for which the targets are valid.
    targets_for: Option<u32>,
}

/// A bin's place among the values.
#[derive(Clone, Copy, Debug)]
struct Row {
    first: usize,
    /// Number of halvings of the instants of the row.
    halvings: u32,
    count: usize,
}

/// Where a row takes the instants of a voice.
#[derive(Clone, Copy, Debug)]
struct Target {
    first: u32,
    /// Bits that are zero in the instants that the row has.
    skipped: u32,
    /// How often the voice's instants are halved once more.
    halvings: u32,
}

/// Number of cells for omitted values. With several cells an addition does not wait for the previous
/// one.
const DROPPED: u32 = 8;

/// No row: nothing is added anywhere but there.
const NOWHERE: Target = Target { first: 0, skipped: u32::MAX, halvings: 0 };

impl Target {
    /// Where a value at an instant of the voice is added.
    fn place(self, instant: u32) -> u32 {
        if instant & self.skipped == 0 {
            self.first + (instant >> self.halvings)
        } else {
            instant % DROPPED
        }
    }
}

impl Squeezed {
    /// All zero, for bins whose instants are halved so often and so many instants in all.
    pub(super) fn clear(&mut self, halvings: impl Iterator<Item = u32>, instants: usize) {
        let mut first = DROPPED as usize;
        self.rows.clear();
        self.rows.extend(halvings.map(|halvings| {
            let row = Row { first, halvings, count: instants.div_ceil(1 << halvings) };
            first += row.count;
            row
        }));
        self.instants = instants;
        self.targets_for = None;
        self.values.clear();
        self.values.resize(first, Complex64::ZERO);
    }

    /// Adds a voice whose instants are halved so often, given with its frequency-weighted twin (in
    /// Hz), at its instantaneous frequencies (paper, eq. A.3, A.4).
    ///
    /// A bin with more instants than the voice is beyond the reach of the voice and receives nothing.
    pub(super) fn add(
        &mut self,
        bins: &Bins,
        halvings: u32,
        voice: &[Complex64],
        weighted: &[Complex64],
    ) {
        if self.targets_for != Some(halvings) {
            self.targets = self.targets(halvings);
            self.targets_for = Some(halvings);
        }
        let count = self.instants.div_ceil(1 << halvings);
        let pairs = voice[..count].iter().zip(&weighted[..count]);
        // In three passes: the last waits for memory only, and many of its additions at a time.
        self.frequencies_hz.clear();
        self.frequencies_hz.extend(pairs.map(|(value, weighted)| {
            let product = weighted.re * value.re + weighted.im * value.im;
            product / value.norm_sqr()
        }));
        self.places.clear();
        let targets = &self.targets;
        let places = (0..)
            .zip(&self.frequencies_hz)
            .map(|(instant, &frequency_hz)| targets[bins.row(frequency_hz)].place(instant));
        self.places.extend(places);
        for (&place, value) in self.places.iter().zip(voice) {
            self.values[place as usize] += value;
        }
    }

    /// A target for every row of [`Bins`], those on either side included.
    fn targets(&self, halvings: u32) -> Vec<Target> {
        let target = |row: &Row| match row.halvings.checked_sub(halvings) {
            Some(more) => Target {
                first: u32::try_from(row.first).expect("fewer values than four thousand million"),
                skipped: (1 << more) - 1,
                halvings: more,
            },
            None => NOWHERE,
        };
        [NOWHERE].into_iter().chain(self.rows.iter().map(target)).chain([NOWHERE]).collect()
    }

    /// The values of a bin, by its place among the bins.
    pub(super) fn bin(&self, bin: usize) -> &[Complex64] {
        let Row { first, count, .. } = self.rows[bin];
        &self.values[first..first + count]
    }

    /// Mean of the squared magnitude over all instants, of one bin (paper, eq. 4).
    pub(super) fn mean_power(&self, bin: usize) -> f64 {
        let values = self.bin(bin);
        values.iter().map(Complex64::norm_sqr).sum::<f64>() / values.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins() -> (Vec<f64>, Bins) {
        let frequencies: Vec<_> = (0..304).map(|l| 50.0 * (f64::from(l) / 48.0).exp2()).collect();
        let bins = Bins::new(&frequencies, 48);
        (frequencies, bins)
    }

    #[test]
    fn the_table_finds_the_bin_nearest_in_the_logarithm() {
        let (frequencies, bins) = bins();
        for step in 0..200_000 {
            let frequency = 40.0 * (f64::from(step) / 200_000.0 * 7.0).exp2();
            let nearest = (48.0 * (frequency / frequencies[0]).log2()).round();
            let expected = (nearest + 1.0).clamp(0.0, 305.0);
            let distance = (48.0 * (frequency / frequencies[0]).log2() - nearest).abs();
            // On a border itself rounding decides.
            if distance < 0.5 - 1e-9 {
                let row = bins.row(frequency) % 305;
                assert!((row as f64 - expected % 305.0).abs() < 0.5, "{frequency} Hz: {row}");
            }
        }
    }

    #[test]
    fn what_is_no_frequency_of_a_bin_stays_outside() {
        let (_, bins) = bins();
        for frequency in [f64::NAN, -f64::NAN, -100.0, 0.0, 1e-300, 49.0, 4100.0, f64::INFINITY] {
            let row = bins.row(frequency);
            assert!(row == 0 || row == 305, "{frequency} Hz in row {row}");
        }
    }
}
