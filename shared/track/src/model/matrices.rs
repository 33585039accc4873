//! Mass, damping and stiffness matrix on one common sparsity pattern.

use super::Port;
use crate::element::SpringDamper;

/// One contribution to the three matrices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) mass: f64,
    pub(super) damping: f64,
    pub(super) stiffness: f64,
}

/// The symmetric matrices `M`, `C`, `K`, row by row, both triangles stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrices {
    row_starts: Vec<usize>,
    columns: Vec<usize>,
    mass: Vec<f64>,
    damping: Vec<f64>,
    stiffness: Vec<f64>,
}

impl Matrices {
    /// Sums the terms that meet in one entry, in the order in which they came.
    pub(super) fn from_terms(size: usize, mut terms: Vec<Term>) -> Self {
        terms.sort_by_key(|term| (term.row, term.column));
        let mut matrices = Self {
            row_starts: vec![0; size + 1],
            columns: Vec::new(),
            mass: Vec::new(),
            damping: Vec::new(),
            stiffness: Vec::new(),
        };
        let mut place = None;
        for Term { row, column, mass, damping, stiffness } in terms {
            if place != Some((row, column)) {
                place = Some((row, column));
                matrices.columns.push(column);
                matrices.mass.push(0.0);
                matrices.damping.push(0.0);
                matrices.stiffness.push(0.0);
                matrices.row_starts[row + 1] = matrices.columns.len();
            }
            let last = matrices.columns.len() - 1;
            matrices.mass[last] += mass;
            matrices.damping[last] += damping;
            matrices.stiffness[last] += stiffness;
        }
        for row in 0..size {
            matrices.row_starts[row + 1] =
                matrices.row_starts[row + 1].max(matrices.row_starts[row]);
        }
        matrices
    }

    /// The matrices with springs and dampers on ports added.
    pub(super) fn with(&self, elements: &[(&Port, SpringDamper)]) -> Self {
        let (mass, damping, stiffness) = (&self.mass, &self.damping, &self.stiffness);
        let present = self.places().map(|(row, column, place)| Term {
            row,
            column,
            mass: mass[place],
            damping: damping[place],
            stiffness: stiffness[place],
        });
        let mut terms: Vec<_> = present.collect();
        for (port, element) in elements {
            for &(row, b_row) in port.entries() {
                for &(column, b_column) in port.entries() {
                    let SpringDamper { stiffness, damping } = element.share(b_row * b_column);
                    terms.push(Term { row, column, mass: 0.0, damping, stiffness });
                }
            }
        }
        Self::from_terms(self.size(), terms)
    }

    /// Whether both have the same sparsity pattern.
    pub(super) fn has_pattern_of(&self, other: &Self) -> bool {
        self.row_starts == other.row_starts && self.columns == other.columns
    }

    /// Number of degrees of freedom.
    pub fn size(&self) -> usize {
        self.row_starts.len() - 1
    }

    /// First entry of each row, and the number of entries at the end.
    pub fn row_starts(&self) -> &[usize] {
        &self.row_starts
    }

    /// Column of each entry, ascending within a row.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// Mass matrix, one entry per place of the pattern, in kg, kg m and kg m2.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Damping matrix, one entry per place of the pattern, in N s/m, N s and N m s.
    pub fn damping(&self) -> &[f64] {
        &self.damping
    }

    /// Stiffness matrix, one entry per place of the pattern, in N/m, N and N m.
    pub fn stiffness(&self) -> &[f64] {
        &self.stiffness
    }

    /// The values of `m M + c C + k K`, one entry per place of the pattern.
    pub fn combination(&self, m: f64, c: f64, k: f64) -> Vec<f64> {
        let damped =
            self.mass.iter().zip(&self.damping).map(|(mass, damping)| m * mass + c * damping);
        damped.zip(&self.stiffness).map(|(sum, stiffness)| sum + k * stiffness).collect()
    }

    /// Place of an entry, if the pattern has it.
    pub(crate) fn place(&self, row: usize, column: usize) -> Option<usize> {
        let first = self.row_starts[row];
        let columns = &self.columns[first..self.row_starts[row + 1]];
        columns.binary_search(&column).ok().map(|offset| first + offset)
    }

    /// Row, column and place of every entry.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..self.size()).flat_map(move |row| {
            (self.row_starts[row]..self.row_starts[row + 1])
                .map(move |place| (row, self.columns[place], place))
        })
    }

    /// Product of a matrix on this pattern with a vector.
    pub fn product(&self, values: &[f64], vector: &[f64]) -> Vec<f64> {
        (0..self.size())
            .map(|row| {
                let places = self.row_starts[row]..self.row_starts[row + 1];
                places.map(|place| values[place] * vector[self.columns[place]]).sum()
            })
            .collect()
    }
}
