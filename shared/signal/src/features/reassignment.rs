//! Where a coefficient goes: the bin nearest to its instantaneous frequency, without logarithms.

use rustfft::num_complex::Complex64;

/// Bins that are evenly spaced in the logarithm of frequency, as a table over the leading bits of
/// a floating-point number.
///
/// A cell of the table is narrower than a bin, so at most one border lies in it: the bin is the
/// cell's, or the next. Row 0 and the last row stand for frequencies outside all bins.
#[derive(Debug)]
pub(super) struct Bins {
    count: usize,
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
        Self { count: frequencies_hz.len(), shift, base, cells: (base..=last).map(cell).collect() }
    }

    /// Rows of an accumulator: the bins and one on either side.
    pub(super) const fn rows(&self) -> usize {
        self.count + 2
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

/// The synchrosqueezed transform while it is summed, one row a bin (and one on either side), one
/// column an instant.
#[derive(Debug, Default)]
pub(super) struct Squeezed {
    instants: usize,
    values: Vec<Complex64>,
    frequencies_hz: Vec<f64>,
}

impl Squeezed {
    /// All zero, for so many rows and instants.
    pub(super) fn clear(&mut self, rows: usize, instants: usize) {
        self.instants = instants;
        self.values.clear();
        self.values.resize(rows * instants, Complex64::ZERO);
        self.frequencies_hz.clear();
        self.frequencies_hz.resize(instants, 0.0);
    }

    /// Adds a voice, given with its frequency-weighted twin (in Hz), at its instantaneous
    /// frequencies (paper, eq. A.3, A.4).
    pub(super) fn add(&mut self, bins: &Bins, voice: &[Complex64], weighted: &[Complex64]) {
        let instants = self.instants;
        let pairs = voice[..instants].iter().zip(&weighted[..instants]);
        for (frequency_hz, (value, weighted)) in self.frequencies_hz.iter_mut().zip(pairs) {
            let product = weighted.re * value.re + weighted.im * value.im;
            *frequency_hz = product / value.norm_sqr();
        }
        for (instant, (value, &frequency_hz)) in voice.iter().zip(&self.frequencies_hz).enumerate()
        {
            self.values[bins.row(frequency_hz) * instants + instant] += value;
        }
    }

    /// The values of a bin, by its place among the bins.
    pub(super) fn bin(&self, bin: usize) -> &[Complex64] {
        &self.values[(bin + 1) * self.instants..][..self.instants]
    }

    /// Mean of the squared magnitude over all instants, of one bin (paper, eq. 4).
    pub(super) fn mean_power(&self, bin: usize) -> f64 {
        self.bin(bin).iter().map(Complex64::norm_sqr).sum::<f64>() / self.instants as f64
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
            assert!(row == 0 || row == bins.rows() - 1, "{frequency} Hz in row {row}");
        }
    }
}
