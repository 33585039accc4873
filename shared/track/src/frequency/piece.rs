//! Parts of the track that are connected to the rail.

use super::banded::Banded;
use super::lane::Lane;
use crate::model::Matrices;

/// A group of connected degrees of freedom outside the rail, such as those of a sleeper.
pub(super) struct Piece {
    /// Its degrees of freedom, the last ones next to the rail.
    pub(super) dofs: Vec<usize>,
    pub(super) width: usize,
    /// Places in the matrices, with local row and column, of the lower triangle.
    pub(super) inner: Vec<(usize, usize, usize)>,
    /// Rail degrees of freedom connected to the piece, each with local rows and places in the matrices.
    pub(super) touched: Vec<(usize, Vec<(usize, usize)>)>,
}

impl Piece {
    pub(super) fn touch(&mut self, rail_dof: usize, local_row: usize, place: usize) {
        match self.touched.iter_mut().find(|(dof, _)| *dof == rail_dof) {
            Some((_, entries)) => entries.push((local_row, place)),
            None => self.touched.push((rail_dof, vec![(local_row, place)])),
        }
    }

    /// Largest distance, in degrees of freedom, between the rail degrees of freedom that the piece
    /// connects.
    pub(super) fn reach(&self) -> usize {
        let dofs = self.touched.iter().map(|(dof, _)| *dof);
        dofs.clone().max().unwrap_or(0) - dofs.min().unwrap_or(0)
    }

    /// Adds `-A_rp A_pp⁻¹ A_pr` to the rail's lower triangle.
    #[inline(always)]
    pub(super) fn condense(
        &self,
        value: &impl Fn(usize) -> Lane,
        mut add: impl FnMut(usize, usize, Lane),
    ) {
        let mut own = Banded::zeros(self.dofs.len(), self.width);
        for &(row, column, place) in &self.inner {
            own.add(row, column, value(place));
        }
        own.factor();
        let mut solved = Vec::with_capacity(self.touched.len());
        for (_, entries) in &self.touched {
            let mut column = vec![Lane::default(); self.dofs.len()];
            for &(row, place) in entries {
                column[row] = column[row] + value(place);
            }
            let first = entries.iter().map(|&(row, _)| row).min().unwrap_or(0);
            own.forward(&mut column, first);
            solved.push(column);
        }
        for (a, left) in solved.iter().enumerate() {
            for (b, right) in solved.iter().enumerate().take(a + 1) {
                let mut sum = Lane::default();
                for (row, (x, y)) in left.iter().zip(right).enumerate() {
                    sum = sum - *x * *y * own.inverse_pivot(row);
                }
                let (row, column) = (self.touched[a].0, self.touched[b].0);
                add(row.max(column), row.min(column), sum);
            }
        }
    }
}

/// Groups of connected degrees of freedom outside the rail. In each group, those next to the rail come
/// last.
pub(super) fn pieces(matrices: &Matrices, rail_dofs: usize) -> Vec<Piece> {
    let mut seen = vec![false; matrices.size()];
    let mut pieces = Vec::new();
    for start in rail_dofs..matrices.size() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut dofs = vec![start];
        let mut next = 0;
        while next < dofs.len() {
            let row = dofs[next];
            next += 1;
            for place in matrices.row_starts()[row]..matrices.row_starts()[row + 1] {
                let column = matrices.columns()[place];
                if column >= rail_dofs && !seen[column] {
                    seen[column] = true;
                    dofs.push(column);
                }
            }
        }
        // Sleepers count from the rail seat outwards, so that descending numbers end next to it.
        dofs.sort_unstable_by(|a, b| b.cmp(a));
        pieces.push(Piece { dofs, width: 0, inner: Vec::new(), touched: Vec::new() });
    }
    pieces
}
