//! Positions and numbers of the degrees of freedom.

use super::{Mesh, Port};
use crate::element::BeamElement;
use tracktwin_parameters::TrackDesign;

/// Geometry of the meshed track and the numbers of its degrees of freedom.
///
/// Order: the rail from left to right, the sleepers one after another, each from the symmetry plane to
/// its tip, and last the degrees of freedom that extensions append. A held degree of freedom has no
/// number.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    rail_nodes_m: Vec<f64>,
    rail_elements: Vec<BeamElement>,
    sleepers: Vec<SleeperLayout>,
    structural_dofs: usize,
}

/// One half sleeper in the layout.
#[derive(Clone, Debug, PartialEq)]
pub struct SleeperLayout {
    /// Position along the track in m.
    pub position_m: f64,
    /// The rail node above it.
    pub rail_node: usize,
    /// Distance of the sleeper's nodes from the symmetry plane in m.
    pub nodes_m: Vec<f64>,
    /// The node that carries the railpad.
    pub seat_node: usize,
    first_dof: usize,
}

/// A point of the rail where a load acts or a displacement is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RailPoint {
    /// The element that the point lies in.
    pub element: usize,
    /// The element's degrees of freedom `w₁ θ₁ w₂ θ₂`; `None` where held.
    pub dofs: [Option<usize>; 4],
    /// Deflection at the point for a unit value of each degree of freedom.
    pub shape: [f64; 4],
    /// Deflection in m/N under a unit load that the shape functions leave out
    /// ([`BeamElement::clamped_flexibility`]).
    pub local_flexibility: f64,
}

impl RailPoint {
    /// Numbers and shape values of the degrees of freedom that are free.
    pub fn entries(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.dofs.iter().zip(self.shape).filter_map(|(dof, value)| dof.map(|dof| (dof, value)))
    }

    /// Deflection in m at the point for displacements of all degrees of freedom.
    pub fn deflection(&self, displacement: &[f64]) -> f64 {
        self.entries().map(|(dof, value)| value * displacement[dof]).sum()
    }
}

impl SleeperLayout {
    /// Number of the degree of freedom of the deflection at a node.
    pub fn deflection_dof(&self, node: usize) -> usize {
        // The rotation at the symmetry plane is held and has no number.
        if node == 0 { self.first_dof } else { self.first_dof + 2 * node - 1 }
    }

    /// Number of the degree of freedom of the rotation at a node. `None` at the symmetry plane (node 0),
    /// which holds the rotation.
    pub fn rotation_dof(&self, node: usize) -> Option<usize> {
        (node > 0).then_some(self.first_dof + 2 * node)
    }

    /// Numbers of all degrees of freedom of the sleeper, without those of extensions.
    pub fn dofs(&self) -> std::ops::Range<usize> {
        self.first_dof..self.first_dof + 2 * self.nodes_m.len() - 1
    }

    /// The node at the free end.
    pub fn tip_node(&self) -> usize {
        self.nodes_m.len() - 1
    }

    /// Share of the sleeper's length that belongs to each node.
    pub(super) fn tributary_shares(&self) -> Vec<f64> {
        let nodes = &self.nodes_m;
        let total = nodes[nodes.len() - 1] - nodes[0];
        (0..nodes.len())
            .map(|node| {
                let before = nodes[node.saturating_sub(1)];
                let after = nodes[(node + 1).min(nodes.len() - 1)];
                0.5 * (after - before) / total
            })
            .collect()
    }
}

impl Layout {
    pub(super) fn new(design: &TrackDesign, mesh: &Mesh) -> Self {
        let spacing = design.sleeper.spacing_m;
        let (mut rail_nodes_m, mut rail_elements) = (vec![0.0], Vec::new());
        let mut seats = Vec::new();
        for (span, &elements) in mesh.rail_elements.iter().enumerate() {
            let length = spacing / elements as f64;
            for element in 1..=elements {
                rail_nodes_m.push(spacing * span as f64 + length * element as f64);
                rail_elements.push(rail_element(design, length));
            }
            seats.push(rail_elements.len());
        }
        seats.pop();
        let rail_dofs = 2 * rail_elements.len();
        let (nodes_m, seat_node) = sleeper_nodes(design, mesh.sleeper_elements);
        let sleeper_dofs = 2 * nodes_m.len() - 1;
        let sleepers: Vec<_> = seats
            .iter()
            .enumerate()
            .map(|(index, &rail_node)| SleeperLayout {
                position_m: spacing * (index + 1) as f64,
                rail_node,
                nodes_m: nodes_m.clone(),
                seat_node,
                first_dof: rail_dofs + index * sleeper_dofs,
            })
            .collect();
        let structural_dofs = rail_dofs + sleepers.len() * sleeper_dofs;
        Self { rail_nodes_m, rail_elements, sleepers, structural_dofs }
    }

    /// Positions of the rail's nodes in m.
    pub fn rail_nodes_m(&self) -> &[f64] {
        &self.rail_nodes_m
    }

    /// The rail's elements, from left to right.
    pub fn rail_elements(&self) -> &[BeamElement] {
        &self.rail_elements
    }

    pub(super) fn set_rail_element(&mut self, element: usize, beam: BeamElement) {
        self.rail_elements[element] = beam;
    }

    /// The sleepers, from left to right.
    pub fn sleepers(&self) -> &[SleeperLayout] {
        &self.sleepers
    }

    /// Length of the track in m.
    pub fn length_m(&self) -> f64 {
        self.rail_nodes_m[self.rail_nodes_m.len() - 1]
    }

    /// Number of degrees of freedom of rail and sleepers, without those of extensions.
    pub fn structural_dofs(&self) -> usize {
        self.structural_dofs
    }

    /// Number of degrees of freedom of the rail.
    pub fn rail_dofs(&self) -> usize {
        2 * self.rail_elements.len()
    }

    /// Numbers of the degrees of freedom of deflection and rotation at a rail node. The deflection is
    /// held at both end nodes and is then `None`.
    pub fn rail_node_dofs(&self, node: usize) -> [Option<usize>; 2] {
        let last = self.rail_elements.len();
        match node {
            0 => [None, Some(0)],
            node if node == last => [None, Some(2 * last - 1)],
            node => [Some(2 * node - 1), Some(2 * node)],
        }
    }

    pub(super) fn rail_element_dofs(&self, element: usize) -> [Option<usize>; 4] {
        let [w1, theta1] = self.rail_node_dofs(element);
        let [w2, theta2] = self.rail_node_dofs(element + 1);
        [w1, theta1, w2, theta2]
    }

    pub(super) fn sleeper_element_dofs(sleeper: &SleeperLayout, node: usize) -> [Option<usize>; 4] {
        [
            Some(sleeper.deflection_dof(node)),
            sleeper.rotation_dof(node),
            Some(sleeper.deflection_dof(node + 1)),
            sleeper.rotation_dof(node + 1),
        ]
    }

    /// The point of the rail at `x_m`. A position beyond an end of the track gives that end.
    pub fn rail_point(&self, x_m: f64) -> RailPoint {
        let after = self.rail_nodes_m.partition_point(|&node| node <= x_m);
        let element = after.clamp(1, self.rail_elements.len()) - 1;
        let beam = &self.rail_elements[element];
        let xi = ((x_m - self.rail_nodes_m[element]) / beam.length).clamp(0.0, 1.0);
        RailPoint {
            element,
            dofs: self.rail_element_dofs(element),
            shape: beam.shape(xi),
            local_flexibility: beam.clamped_flexibility(xi),
        }
    }

    /// Port of the rail's deflection at `x_m`.
    pub fn rail_port(&self, x_m: f64) -> Port {
        self.rail_point(x_m).entries().collect()
    }

    /// Port of the railpad over sleeper `index` (from 0): rail minus rail seat.
    ///
    /// # Panics
    /// When the track has no such sleeper.
    pub fn railpad_port(&self, index: usize) -> Port {
        let sleeper = &self.sleepers[index];
        let rail = self.rail_node_dofs(sleeper.rail_node)[0];
        let seat = sleeper.deflection_dof(sleeper.seat_node);
        rail.map(|dof| (dof, 1.0)).into_iter().chain([(seat, -1.0)]).collect()
    }

    /// Port between a node of sleeper `index` (from 0) and the ground.
    ///
    /// # Panics
    /// When the track has no such sleeper, or the sleeper no such node.
    pub fn sleeper_port(&self, index: usize, node: usize) -> Port {
        let sleeper = &self.sleepers[index];
        assert!(node < sleeper.nodes_m.len(), "sleeper {index} has no node {node}");
        Port::from_iter([(sleeper.deflection_dof(node), 1.0)])
    }
}

fn rail_element(design: &TrackDesign, length: f64) -> BeamElement {
    BeamElement {
        length,
        bending_stiffness: design.rail.bending_stiffness(),
        shear_stiffness: design.rail.shear_stiffness(),
        mass_per_length: design.rail.mass_per_length(),
        rotary_inertia_per_length: design.rail.rotary_inertia_per_length(),
    }
}

/// Nodes of a half sleeper, one of them at the rail seat, and which one.
///
/// The elements are shared between both sides of the seat in proportion to their lengths.
fn sleeper_nodes(design: &TrackDesign, elements: usize) -> (Vec<f64>, usize) {
    let (seat, tip) = (design.sleeper.rail_seat_m, design.sleeper.half_length_m);
    let wanted = (elements as f64 * seat / tip).round() as usize;
    let inner = match (seat > 0.0, seat < tip) {
        (false, _) => 0,
        (true, false) => elements,
        (true, true) => wanted.clamp(1, elements.max(2) - 1),
    };
    let outer = if seat < tip { (elements - inner.min(elements)).max(1) } else { 0 };
    let inside = (0..inner).map(|node| seat * node as f64 / inner as f64);
    let outside = (1..=outer).map(|node| seat + (tip - seat) * node as f64 / outer as f64);
    (inside.chain([seat]).chain(outside).collect(), inner)
}
