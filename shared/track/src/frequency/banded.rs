//! Symmetric banded matrices, and the required entries of their inverses.

use super::lane::Lane;

/// A symmetric banded matrix at [`LANES`] frequencies, by rows: the entry `(row, row - k)` stands
/// at `row × (width + 1) + k`.
pub(super) struct Banded {
    size: usize,
    width: usize,
    entries: Vec<Lane>,
}

impl Banded {
    /// A matrix of zeros with `width` entries beside the diagonal.
    pub(super) fn zeros(size: usize, width: usize) -> Self {
        Self { size, width, entries: vec![Lane::default(); size * (width + 1)] }
    }

    /// Adds to an entry of the lower triangle.
    #[inline(always)]
    pub(super) fn add(&mut self, row: usize, column: usize, value: Lane) {
        let place = row * (self.width + 1) + (row - column);
        self.entries[place] = self.entries[place] + value;
    }

    /// Factors into `L D Lᵀ` in place: `L` below the diagonal, `1 / D` on it.
    ///
    /// Without pivoting: the track's damping keeps every pivot away from zero, and at a resonance
    /// without damping the result is infinite, not wrong.
    #[inline(always)]
    pub(super) fn factor(&mut self) {
        let stride = self.width + 1;
        for row in 0..self.size {
            let first = row.saturating_sub(self.width);
            let mut pivot = self.entries[row * stride];
            for column in first..row {
                // Here still L D; what stands left of it is L D as well.
                let mut value = self.entries[row * stride + row - column];
                for k in first.max(column.saturating_sub(self.width))..column {
                    let left = self.entries[row * stride + row - k];
                    value = value - left * self.entries[column * stride + column - k];
                }
                self.entries[row * stride + row - column] = value;
            }
            for column in first..row {
                let place = row * stride + row - column;
                let scaled = self.entries[place] * self.entries[column * stride];
                pivot = pivot - self.entries[place] * scaled;
                self.entries[place] = scaled;
            }
            self.entries[row * stride] = pivot.recip();
        }
    }

    /// Solves `L y = b` from row `from` on, before which `b` is zero.
    #[inline(always)]
    pub(super) fn forward(&self, b: &mut [Lane], from: usize) {
        let stride = self.width + 1;
        for row in from + 1..self.size {
            let mut value = b[row];
            let first = from.max(row.saturating_sub(self.width));
            for (known, k) in b[first..row].iter().zip(first..) {
                value = value - self.entries[row * stride + row - k] * *known;
            }
            b[row] = value;
        }
    }

    /// Reciprocal pivot of a row.
    #[inline(always)]
    pub(super) fn inverse_pivot(&self, row: usize) -> Lane {
        self.entries[row * (self.width + 1)]
    }

    /// The entries of the inverse that lie in the band, from the factor.
    ///
    /// Source: K. Takahashi, J. Fagan and M.-S. Chen, 8th PICA Conference (1973).
    #[inline(always)]
    fn selected_inverse(&self) -> Self {
        let (stride, size) = (self.width + 1, self.size);
        let mut inverse = Self::zeros(size, self.width);
        for column in (0..size).rev() {
            let end = size.min(column + stride);
            for row in (column + 1..end).rev() {
                let mut value = Lane::default();
                for k in column + 1..end {
                    let (low, high) = if k < row { (k, row) } else { (row, k) };
                    let known = inverse.entries[high * stride + high - low];
                    value = value - known * self.entries[k * stride + k - column];
                }
                inverse.entries[row * stride + row - column] = value;
            }
            let mut value = self.entries[column * stride];
            for k in column + 1..end {
                let factor = self.entries[k * stride + k - column];
                value = value - factor * inverse.entries[k * stride + k - column];
            }
            inverse.entries[column * stride] = value;
        }
        inverse
    }

    /// The same matrix with rows and columns in the opposite order.
    #[inline(always)]
    pub(super) fn mirrored(&self) -> Self {
        let mut mirrored = Self::zeros(self.size, self.width);
        for row in 0..self.size {
            for column in row.saturating_sub(self.width)..=row {
                let value = self.entries[row * (self.width + 1) + row - column];
                mirrored.add(self.size - 1 - column, self.size - 1 - row, value);
            }
        }
        mirrored
    }

    /// An entry on the diagonal.
    #[inline(always)]
    pub(super) fn diagonal(&self, row: usize) -> Lane {
        self.entries[row * (self.width + 1)]
    }
}

/// The inverse of a banded matrix: its entries in the band, and the factor from which the other entries
/// follow.
pub(super) struct Inverse {
    factor: Banded,
    band: Banded,
}

impl Inverse {
    #[inline(always)]
    pub(super) fn new(mut matrix: Banded) -> Self {
        matrix.factor();
        let band = matrix.selected_inverse();
        Self { factor: matrix, band }
    }

    /// Rows of the matrix.
    pub(super) const fn size(&self) -> usize {
        self.factor.size
    }

    /// The entries on the diagonal at these rows, zero where there is none.
    #[inline(always)]
    pub(super) fn direct(&self, rows: &[Option<usize>]) -> Vec<Lane> {
        let at = |row: &Option<usize>| row.map_or(Lane::default(), |row| self.band.diagonal(row));
        rows.iter().map(at).collect()
    }

    /// The entries of a column from row `first` down to its diagonal: left in these places of `work`,
    /// which holds a column.
    ///
    /// Each row follows from those next to it by the factor's column, as in
    /// [`Banded::selected_inverse`].
    #[inline(always)]
    pub(super) fn column_above(&self, column: usize, first: usize, work: &mut [Lane]) {
        let (width, stride) = (self.factor.width, self.factor.width + 1);
        let in_band = column.saturating_sub(width);
        let from = in_band.max(first);
        for (known, k) in work[from..=column].iter_mut().zip(from..) {
            *known = self.band.entries[column * stride + column - k];
        }
        for i in (first..in_band).rev() {
            let mut value = Lane::default();
            for (known, k) in work[i + 1..=i + width].iter().zip(i + 1..) {
                value = value - *known * self.factor.entries[k * stride + k - i];
            }
            work[i] = value;
        }
    }
}
