//! In which order the degrees of freedom are eliminated, and what that fills in.

use crate::model::{Layout, Matrices};

/// Order and pattern of the factor `L`, common to all cases on one pattern.
///
/// Appended degrees of freedom go first, then every sleeper from its far ends to the rail seat,
/// last the rail from left to right: a track without extensions fills nothing in, and a load on
/// the rail reaches only the last rows.
#[derive(Clone, Debug)]
pub(super) struct Elimination {
    /// The degree of freedom eliminated at each place.
    pub(super) order: Vec<usize>,
    /// The place of each degree of freedom.
    pub(super) place: Vec<usize>,
    /// Columns of `L` left of the diagonal, row by row, ascending.
    pub(super) rows: Vec<Vec<usize>>,
}

impl Elimination {
    pub(super) fn new(layout: &Layout, matrices: &Matrices) -> Self {
        let order = order(layout, matrices.size());
        let mut place = vec![0; order.len()];
        for (position, &dof) in order.iter().enumerate() {
            place[dof] = position;
        }
        let rows = factor_rows(matrices, &order, &place);
        Self { order, place, rows }
    }
}

fn order(layout: &Layout, size: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (layout.structural_dofs()..size).collect();
    for sleeper in layout.sleepers() {
        let seat_m = sleeper.nodes_m[sleeper.seat_node];
        let from_seat = |node: &usize| (sleeper.nodes_m[*node] - seat_m).abs();
        let mut nodes: Vec<usize> = (0..=sleeper.tip_node()).collect();
        nodes.sort_by(|a, b| from_seat(b).total_cmp(&from_seat(a)));
        for node in nodes {
            order.extend(sleeper.rotation_dof(node));
            order.push(sleeper.deflection_dof(node));
        }
    }
    order.extend(0..layout.rail_dofs());
    order
}

/// Pattern of `L` by the elimination tree (Davis, *Direct Methods for Sparse Linear Systems*,
/// 2006, 4.1): row `k` holds every column met on the way from its matrix entries up to `k`.
fn factor_rows(matrices: &Matrices, order: &[usize], place: &[usize]) -> Vec<Vec<usize>> {
    let mut parent = vec![usize::MAX; order.len()];
    let mut visited_for = vec![usize::MAX; order.len()];
    let mut rows = Vec::with_capacity(order.len());
    for (row, &dof) in order.iter().enumerate() {
        visited_for[row] = row;
        let mut pattern = Vec::new();
        for entry in matrices.row_starts()[dof]..matrices.row_starts()[dof + 1] {
            let mut column = place[matrices.columns()[entry]];
            while column < row && visited_for[column] != row {
                if parent[column] == usize::MAX {
                    parent[column] = row;
                }
                visited_for[column] = row;
                pattern.push(column);
                column = parent[column];
            }
        }
        pattern.sort_unstable();
        rows.push(pattern);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mesh, Support, TrackModel};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    #[test]
    fn a_track_without_extensions_fills_nothing_in() {
        let supports = vec![Support::from(&ParameterSet::nominal()); 4];
        let mesh = Mesh::uniform(5, 8, 8);
        let model = TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[]).unwrap();
        let matrices = model.matrices();
        let elimination = Elimination::new(model.layout(), matrices);
        let filled: usize = elimination.rows.iter().map(Vec::len).sum();
        let entries = matrices.places().filter(|(row, column, _)| column < row).count();
        assert_eq!(filled, entries);
    }
}
