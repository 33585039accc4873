//! Puts elements and extensions together into the three matrices.

use super::matrices::{Matrices, Term};
use super::{Layout, Support};
use crate::element::{BeamElement, ElementMatrix, SpringDamper};
use tracktwin_parameters::TrackDesign;

/// A relative motion `bᵀ u` that something acts on: the entries of the sparse vector `b`.
///
/// An element of stiffness `k` on the port adds `k b bᵀ`.
#[derive(Clone, Debug, PartialEq)]
pub struct Port {
    entries: Vec<(usize, f64)>,
}

impl Port {
    /// Degrees of freedom and their weights.
    pub fn entries(&self) -> &[(usize, f64)] {
        &self.entries
    }

    /// The relative motion for displacements of all degrees of freedom.
    pub fn motion(&self, displacement: &[f64]) -> f64 {
        self.entries.iter().map(|&(dof, weight)| weight * displacement[dof]).sum()
    }

    /// The motion of this port relative to another's.
    #[must_use]
    pub fn minus(mut self, other: &Port) -> Self {
        self.entries.extend(other.entries.iter().map(|&(dof, weight)| (dof, -weight)));
        self
    }
}

impl FromIterator<(usize, f64)> for Port {
    fn from_iter<I: IntoIterator<Item = (usize, f64)>>(entries: I) -> Self {
        Self { entries: entries.into_iter().collect() }
    }
}

/// A track being assembled.
#[derive(Debug)]
pub struct Assembly {
    layout: Layout,
    terms: Vec<Term>,
    dofs: usize,
}

impl Assembly {
    /// The track of the design alone.
    pub(super) fn new(design: &TrackDesign, layout: Layout, supports: &[Support]) -> Self {
        let dofs = layout.structural_dofs();
        let mut assembly = Self { layout, terms: Vec::new(), dofs };
        assembly.add_rail(design);
        for (index, support) in supports.iter().enumerate() {
            assembly.add_sleeper(design, index, support);
            assembly.add_spring_damper(&assembly.layout.railpad_port(index), support.railpad());
            assembly.add_ballast(index, support.ballast());
        }
        assembly
    }

    /// Where everything stands.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Appends a degree of freedom, which nothing holds yet, and returns its port.
    pub fn append_dof(&mut self) -> Port {
        self.dofs += 1;
        Port::from_iter([(self.dofs - 1, 1.0)])
    }

    /// Adds a spring and damper on a port.
    pub fn add_spring_damper(&mut self, port: &Port, element: SpringDamper) {
        self.add_on_port(port, 0.0, element.damping, element.stiffness);
    }

    /// Adds a mass in kg that follows a port's motion.
    pub fn add_mass(&mut self, port: &Port, mass_kg: f64) {
        self.add_on_port(port, mass_kg, 0.0, 0.0);
    }

    /// Layout and matrices of what has been put together.
    pub(super) fn finish(self) -> (Layout, Matrices) {
        (self.layout, Matrices::from_terms(self.dofs, self.terms))
    }

    fn add_on_port(&mut self, port: &Port, mass: f64, damping: f64, stiffness: f64) {
        for &(row, b_row) in port.entries() {
            for &(column, b_column) in port.entries() {
                let weight = b_row * b_column;
                self.terms.push(Term {
                    row,
                    column,
                    mass: mass * weight,
                    damping: damping * weight,
                    stiffness: stiffness * weight,
                });
            }
        }
    }

    fn add_rail(&mut self, design: &TrackDesign) {
        for element in 0..self.layout.rail_elements().len() {
            let beam = self.layout.rail_elements()[element];
            let dofs = self.layout.rail_element_dofs(element);
            self.add_beam(&beam, dofs, design.rail_damping_s);
        }
    }

    fn add_sleeper(&mut self, design: &TrackDesign, index: usize, support: &Support) {
        let sleeper = self.layout.sleepers()[index].clone();
        for node in 0..sleeper.tip_node() {
            let length = sleeper.nodes_m[node + 1] - sleeper.nodes_m[node];
            let beam = sleeper_element(design, support, length);
            self.add_beam(&beam, Layout::sleeper_element_dofs(&sleeper, node), 0.0);
        }
    }

    fn add_ballast(&mut self, index: usize, ballast: SpringDamper) {
        let shares = self.layout.sleepers()[index].tributary_shares();
        for (node, share) in shares.into_iter().enumerate() {
            let port = self.layout.sleeper_port(index, node);
            self.add_spring_damper(&port, ballast.share(share));
        }
    }

    /// Adds a beam whose damping is `damping_s` times its stiffness.
    fn add_beam(&mut self, beam: &BeamElement, dofs: [Option<usize>; 4], damping_s: f64) {
        let (k, m): (ElementMatrix, ElementMatrix) = (beam.stiffness(), beam.mass());
        for (i, row) in dofs.iter().enumerate() {
            for (j, column) in dofs.iter().enumerate() {
                if let (&Some(row), &Some(column)) = (row, column) {
                    let (mass, stiffness) = (m[i][j], k[i][j]);
                    let damping = damping_s * stiffness;
                    self.terms.push(Term { row, column, mass, damping, stiffness });
                }
            }
        }
    }
}

/// The parameter `EI_s` scales bending and shear stiffness alike; inertia stays nominal.
fn sleeper_element(design: &TrackDesign, support: &Support, length: f64) -> BeamElement {
    let section = &design.sleeper.section;
    let scale = support.sleeper_bending_stiffness / section.bending_stiffness();
    BeamElement {
        length,
        bending_stiffness: support.sleeper_bending_stiffness,
        shear_stiffness: section.shear_stiffness() * scale,
        mass_per_length: section.mass_per_length(),
        rotary_inertia_per_length: section.rotary_inertia_per_length(),
    }
}
