//! Symmetric matrices with two diagonals beside the main one.
//!
//! This module contains assembly, factorisation `L D L^T` and solution for two right-hand sides at once.

/// A symmetric matrix of half-bandwidth two.
#[derive(Clone, Debug)]
pub(crate) struct Band {
    /// `rows[i]` are the elements `(i, i)`, `(i, i + 1)` and `(i, i + 2)`.
    rows: Vec<[f64; 3]>,
}

impl Band {
    /// Zero, of this size.
    pub(crate) fn zero(size: usize) -> Self {
        Self { rows: vec![[0.0; 3]; size] }
    }

    /// Adds `factor g g^T`, where `g` has the values `vector` from row `first` on.
    pub(crate) fn add_square(&mut self, first: usize, vector: [f64; 3], factor: f64) {
        for i in 0..3 {
            for j in i..3 {
                let value = factor * vector[i] * vector[j];
                if value != 0.0 {
                    self.rows[first + i][j - i] += value;
                }
            }
        }
    }

    /// Adds to the element `(i, i)`.
    pub(crate) fn add(&mut self, i: usize, value: f64) {
        self.rows[i][0] += value;
    }

    /// The factors.
    pub(crate) fn factor(&self) -> Factor {
        let mut rows: Vec<[f64; 3]> = Vec::with_capacity(self.rows.len());
        for (i, &[mut pivot, mut first, second]) in self.rows.iter().enumerate() {
            if let Some([above, factor, _]) = i.checked_sub(1).map(|above| rows[above]) {
                pivot -= factor * factor / above;
                first -= rows[i - 1][2] / above * factor;
            }
            if let Some([above, _, factor]) = i.checked_sub(2).map(|above| rows[above]) {
                pivot -= factor * factor / above;
            }
            rows.push([pivot, first, second]);
        }
        let scaled =
            |[pivot, first, second]: [f64; 3]| [1.0 / pivot, first / pivot, second / pivot];
        Factor { rows: rows.into_iter().map(scaled).collect() }
    }
}

/// Factors `L D L^T` of a band matrix.
#[derive(Clone, Debug)]
pub(crate) struct Factor {
    /// `rows[i]` are `1 / d_i`, `l_(i+1, i)` and `l_(i+2, i)`.
    rows: Vec<[f64; 3]>,
}

impl Factor {
    /// Solves for both right-hand sides in place.
    pub(crate) fn solve(&self, sides: &mut [[f64; 2]]) {
        let mut above = [0.0; 2];
        let mut upper = [0.0; 2];
        let (mut of_above, mut of_upper, mut second_of_above) = (0.0, 0.0, 0.0);
        for (&[inverse, first, second], side) in self.rows.iter().zip(&mut *sides) {
            for s in 0..2 {
                let value = (side[s] - of_upper * upper[s]) - of_above * above[s];
                upper[s] = above[s];
                above[s] = value;
                side[s] = value * inverse;
            }
            of_above = first;
            of_upper = second_of_above;
            second_of_above = second;
        }
        let mut below = [0.0; 2];
        let mut lower = [0.0; 2];
        for (&[_, first, second], side) in self.rows.iter().zip(&mut *sides).rev() {
            for s in 0..2 {
                let value = (side[s] - second * lower[s]) - first * below[s];
                lower[s] = below[s];
                below[s] = value;
                side[s] = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_solved_back() {
        let size = 9;
        let mut band = Band::zero(size);
        for first in 0..size - 2 {
            band.add_square(first, [1.0, -0.5 * first as f64, 0.7], 2.0 + first as f64);
        }
        for i in 0..size {
            band.add(i, 1.0);
        }
        let truth: Vec<[f64; 2]> =
            (0..size).map(|i| [i as f64 - 3.0, 1.0 / (i + 1) as f64]).collect();
        let mut sides = vec![[0.0; 2]; size];
        for i in 0..size {
            for (offset, value) in band.rows[i].iter().enumerate().filter(|(o, _)| i + o < size) {
                for s in 0..2 {
                    sides[i][s] += value * truth[i + offset][s];
                    if offset > 0 {
                        sides[i + offset][s] += value * truth[i][s];
                    }
                }
            }
        }
        band.factor().solve(&mut sides);
        for (side, truth) in sides.iter().zip(&truth) {
            assert!((side[0] - truth[0]).abs() < 1e-11 && (side[1] - truth[1]).abs() < 1e-11);
        }
    }
}
