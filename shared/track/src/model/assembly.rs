//! Assembly of elements and extensions into mass, damping and stiffness matrix.

use super::matrices::{Matrices, Term};
use super::{ForceLaw, Layout, Support};
use crate::element::{BeamElement, ElementMatrix, SpringDamper};
use std::collections::BTreeMap;
use tracktwin_parameters::TrackDesign;

/// A relative motion `bᵀ u` on which an element acts, stored as the entries of the sparse vector `b`.
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

    /// The relative motion `bᵀ u`, from the displacements `u` of all degrees of freedom.
    pub fn motion(&self, displacement: &[f64]) -> f64 {
        self.entries.iter().map(|&(dof, weight)| weight * displacement[dof]).sum()
    }

    /// The port of the relative motion between this port and another.
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
    design: TrackDesign,
    layout: Layout,
    supports: Vec<Support>,
    /// Bending flexibility of softened sleeper elements over that of their sleeper, by sleeper and element.
    softened: BTreeMap<(usize, usize), f64>,
    /// What the ballast of a sleeper stands on, if it is not the ground, by sleeper.
    under_ballast: BTreeMap<usize, Port>,
    terms: Vec<Term>,
    dofs: usize,
    force_laws: Vec<ForceLaw>,
}

/// The result of an [`Assembly`].
pub(super) struct Assembled {
    pub(super) layout: Layout,
    pub(super) matrices: Matrices,
    pub(super) force_laws: Vec<ForceLaw>,
}

impl Assembly {
    /// The track of the design alone.
    pub(super) fn new(design: &TrackDesign, layout: Layout, supports: &[Support]) -> Self {
        let dofs = layout.structural_dofs();
        let mut assembly = Self {
            design: design.clone(),
            layout,
            supports: supports.to_vec(),
            softened: BTreeMap::new(),
            under_ballast: BTreeMap::new(),
            terms: Vec::new(),
            dofs,
            force_laws: Vec::new(),
        };
        assembly.add_rail();
        for index in 0..supports.len() {
            for element in 0..assembly.layout.sleepers()[index].tip_node() {
                assembly.add_sleeper_element(index, element, 1.0);
            }
            assembly.add_support(index, 1.0);
        }
        assembly
    }

    /// Design of the track. The supports are separate.
    pub fn design(&self) -> &TrackDesign {
        &self.design
    }

    /// Positions and degrees of freedom of the track.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Railpad, half sleeper and ballast of each sleeper.
    pub fn supports(&self) -> &[Support] {
        &self.supports
    }

    /// Replaces railpad and ballast of sleeper `index` (from 0). The sleeper itself does not change.
    ///
    /// # Panics
    /// When the track has no such sleeper.
    pub fn set_support(&mut self, index: usize, support: Support) {
        let sleeper_bending_stiffness = self.supports[index].sleeper_bending_stiffness;
        self.add_support(index, -1.0);
        self.supports[index] = Support { sleeper_bending_stiffness, ..support };
        self.add_support(index, 1.0);
    }

    /// Ports of the ballast under sleeper `index` (from 0), and the spring and damper on each.
    ///
    /// # Panics
    /// When the track has no such sleeper.
    pub fn ballast(&self, index: usize) -> Vec<(Port, SpringDamper)> {
        let ballast = self.supports[index].ballast();
        let shares = self.layout.sleepers()[index].tributary_shares();
        let port = |node| {
            let sleeper = self.layout.sleeper_port(index, node);
            match self.under_ballast.get(&index) {
                Some(base) => sleeper.minus(base),
                None => sleeper,
            }
        };
        let of = |(node, share)| (port(node), ballast.share(share));
        shares.into_iter().enumerate().map(of).collect()
    }

    /// Lets the ballast of sleeper `index` (from 0) stand on a port instead of the ground.
    ///
    /// # Panics
    /// When the track has no such sleeper.
    pub fn stand_ballast_on(&mut self, index: usize, base: Port) {
        self.add_ballast(index, -1.0);
        self.under_ballast.insert(index, base);
        self.add_ballast(index, 1.0);
    }

    /// Multiplies the bending stiffness of the rail by `factor` between two places in m.
    ///
    /// An element that lies partly in this range gets the bending stiffness whose flexibility is the
    /// weighted mean of both parts. The shear stiffness does not change.
    pub fn soften_rail(&mut self, softened_m: [f64; 2], factor: f64) {
        for element in 0..self.layout.rail_elements().len() {
            let element_m = [0, 1].map(|side| self.layout.rail_nodes_m()[element + side]);
            if let Some(added) = added_flexibility(element_m, softened_m, factor) {
                let before = self.layout.rail_elements()[element];
                self.add_rail_element(element, -1.0);
                let bending_stiffness = before.bending_stiffness / (1.0 + added);
                self.layout.set_rail_element(element, BeamElement { bending_stiffness, ..before });
                self.add_rail_element(element, 1.0);
            }
        }
    }

    /// Multiplies the bending stiffness of sleeper `index` (from 0) by `factor` between two distances from the
    /// symmetry plane in m.
    ///
    /// An element that lies partly in this range gets the bending stiffness whose flexibility is the
    /// weighted mean of both parts. The shear stiffness does not change. Several calls add their
    /// flexibilities.
    ///
    /// # Panics
    /// When the track has no such sleeper.
    pub fn soften_sleeper(&mut self, index: usize, softened_m: [f64; 2], factor: f64) {
        for element in 0..self.layout.sleepers()[index].tip_node() {
            let nodes_m = &self.layout.sleepers()[index].nodes_m;
            let element_m = [nodes_m[element], nodes_m[element + 1]];
            if let Some(added) = added_flexibility(element_m, softened_m, factor) {
                self.add_sleeper_element(index, element, -1.0);
                *self.softened.entry((index, element)).or_insert(1.0) += added;
                self.add_sleeper_element(index, element, 1.0);
            }
        }
    }

    /// Adds a force law. Its field `linear` is the part that the matrices contain for it.
    pub fn add_force_law(&mut self, law: ForceLaw) {
        self.force_laws.push(law);
    }

    /// Appends a degree of freedom without stiffness and mass, and returns its port.
    pub fn append_dof(&mut self) -> Port {
        self.dofs += 1;
        Port::from_iter([(self.dofs - 1, 1.0)])
    }

    /// Adds a spring and a damper on a port.
    pub fn add_spring_damper(&mut self, port: &Port, element: SpringDamper) {
        self.add_on_port(port, 0.0, element.damping, element.stiffness);
    }

    /// Adds a mass in kg that follows a port's motion.
    pub fn add_mass(&mut self, port: &Port, mass_kg: f64) {
        self.add_on_port(port, mass_kg, 0.0, 0.0);
    }

    /// The assembled matrices and force laws.
    pub(super) fn finish(self) -> Assembled {
        let matrices = Matrices::from_terms(self.dofs, self.terms);
        Assembled { layout: self.layout, matrices, force_laws: self.force_laws }
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

    fn add_rail(&mut self) {
        for element in 0..self.layout.rail_elements().len() {
            self.add_rail_element(element, 1.0);
        }
    }

    /// Adds a rail element with its present stiffness, multiplied by `factor`.
    fn add_rail_element(&mut self, element: usize, factor: f64) {
        let beam = self.layout.rail_elements()[element];
        let dofs = self.layout.rail_element_dofs(element);
        self.add_beam(&beam, dofs, self.design.rail_damping_s, factor);
    }

    /// Adds an element of a sleeper with its present stiffness, multiplied by `factor`.
    fn add_sleeper_element(&mut self, index: usize, element: usize, factor: f64) {
        let sleeper = &self.layout.sleepers()[index];
        let length = sleeper.nodes_m[element + 1] - sleeper.nodes_m[element];
        let dofs = Layout::sleeper_element_dofs(sleeper, element);
        let mut beam = sleeper_element(&self.design, &self.supports[index], length);
        beam.bending_stiffness /= self.softened.get(&(index, element)).unwrap_or(&1.0);
        self.add_beam(&beam, dofs, 0.0, factor);
    }

    /// Adds railpad and ballast with their present values, `factor` times.
    fn add_support(&mut self, index: usize, factor: f64) {
        let railpad = self.supports[index].railpad().share(factor);
        self.add_spring_damper(&self.layout.railpad_port(index), railpad);
        self.add_ballast(index, factor);
    }

    /// Adds the ballast with its present values, `factor` times.
    fn add_ballast(&mut self, index: usize, factor: f64) {
        for (port, ballast) in self.ballast(index) {
            self.add_spring_damper(&port, ballast.share(factor));
        }
    }

    /// Adds a beam whose damping is `damping_s` times its stiffness, `factor` times.
    fn add_beam(
        &mut self,
        beam: &BeamElement,
        dofs: [Option<usize>; 4],
        damping_s: f64,
        factor: f64,
    ) {
        let (k, m): (ElementMatrix, ElementMatrix) = (beam.stiffness(), beam.mass());
        for (i, row) in dofs.iter().enumerate() {
            for (j, column) in dofs.iter().enumerate() {
                if let (&Some(row), &Some(column)) = (row, column) {
                    let (mass, stiffness) = (factor * m[i][j], factor * k[i][j]);
                    let damping = damping_s * stiffness;
                    self.terms.push(Term { row, column, mass, damping, stiffness });
                }
            }
        }
    }
}

/// Flexibility that an element gains, over its own, if the bending stiffness in a range has this factor: the
/// weighted mean of both parts. `None` if the element lies outside. Positions in m.
fn added_flexibility([start, end]: [f64; 2], [from, to]: [f64; 2], factor: f64) -> Option<f64> {
    let share = (end.min(to) - start.max(from)) / (end - start);
    (share > 0.0).then(|| share * (1.0 / factor - 1.0))
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
