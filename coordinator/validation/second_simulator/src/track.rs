//! The track in motion: rail, sleepers and hidden effects.
//!
//! This module assembles the track from a scene. It computes the two parts of a time step: before and
//! after the contact force is known.

use crate::band::Factor;
use crate::body::Body;
use crate::element::{Element, Law, Point, Stiffening, Void};
use crate::rail::{Place, Rail, SoftRail};
use crate::scale::Scale;
use crate::scheme::{REACH, Weights};
use crate::seat::{BEYOND, Seat, index_of};
use crate::sleeper::{self, FASTENER_DAMPING_S, LAYER, Layout};
use crate::system::Matrices;
use std::f64::consts::TAU;
use tracktwin_parameters::TrackDesign;
use tracktwin_reference_simulator::{Hidden, Scene};

/// Decay rate in 1/s at the rail's very ends, from none where the scene ends: about half of a wave comes back.
const END_DECAY: f64 = 3e3;
/// Share of a layer's stiffness and damping between neighbouring sleepers.
const SHARED_LAYER: f64 = 0.1;

/// Rail, bodies under it, and forces that the matrix does not have.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    rail: Rail,
    factor: Factor,
    bodies: Vec<Body>,
    elements: Vec<Element>,
    /// By row of the rail: right-hand sides, then accelerations without and per contact force.
    sides: Vec<[f64; 2]>,
}

/// The rail under the wheel in a step, while the contact force is unknown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnderWheel {
    /// Displacement at the step's end without contact force, in m.
    pub(crate) free_m: f64,
    /// Displacement per contact force of the step in m/N.
    pub(crate) compliance: f64,
}

impl Track {
    /// The track of a scene at rest without a wheel.
    pub(crate) fn new(
        scene: &Scene,
        design: &TrackDesign,
        scale: &Scale,
        layout: &Layout,
        seats: &[Seat],
    ) -> Self {
        let cells = scale.cells;
        let length_m = scene.length_m();
        let beyond_m = BEYOND as f64 * scale.spacing_m;
        let decay = |x_m: f64| {
            let outside_m = (-x_m).max(x_m - length_m).max(0.0);
            END_DECAY * (outside_m / beyond_m).powi(2)
        };
        let soft: Vec<SoftRail> = scene.left_out.iter().filter_map(soft_rail).collect();
        let nodes_m = nodes_m(seats, cells);
        let mut rail = Rail::new(&design.rail, scale.rail_damping_s, nodes_m, &soft, decay);
        let at_seat = |(index, seat): (usize, &Seat)| {
            Body::new(cells * index, &sleeper::matrices(seat, &design.sleeper, layout))
        };
        let mut bodies: Vec<Body> = seats.iter().enumerate().map(at_seat).collect();
        for (index, seat) in seats.iter().enumerate().filter(|(_, seat)| seat.clamp[1] > 0.0) {
            rail.clamp(cells * index, seat.clamp[1], FASTENER_DAMPING_S * seat.clamp[1]);
        }
        bodies.extend(scene.left_out.iter().filter_map(|hidden| absorber(hidden, &rail)));
        let mut band = rail.matrix(Weights::STEP);
        for body in &bodies {
            band.add(Rail::row(body.node), body.on_rail()[0]);
        }
        Self {
            factor: band.factor(),
            sides: vec![[0.0; 2]; rail.size()],
            elements: elements(scene, scale, layout, seats),
            rail,
            bodies,
        }
    }

    /// Moves to rest under a force in N at each place, voids open; returns the displacements there in m.
    pub(crate) fn rest_under(&mut self, places: &[Place], force_n: f64) -> Vec<f64> {
        let mut band = self.rail.matrix(Weights::REST);
        for body in &self.bodies {
            band.add(Rail::row(body.node), body.on_rail()[1]);
        }
        self.sides.fill([0.0; 2]);
        for (row, weight) in places.iter().flat_map(Place::rows) {
            self.sides[row][0] += weight * force_n;
        }
        band.factor().solve(&mut self.sides);
        for (displacement, side) in self.rail.motion.displacement.iter_mut().zip(&self.sides) {
            *displacement = side[0];
        }
        for body in &mut self.bodies {
            body.rest_under(self.sides[Rail::row(body.node)][0]);
        }
        places.iter().map(|place| place.of(|row| self.sides[row][0])).collect()
    }

    /// The rail's place under a wheel.
    pub(crate) fn place(&self, x_m: f64) -> Place {
        self.rail.place(x_m)
    }

    /// Begins a step that ends with the wheels at `places`. The unit forces of all wheels share a right-hand
    /// side: within a step a force reaches some tenths of a metre, not the next wheel.
    pub(crate) fn begin(&mut self, places: &[Place]) {
        self.rail.begin(&mut self.sides);
        for side in &mut self.sides {
            side[1] = 0.0;
        }
        for (row, weight) in places.iter().flat_map(Place::rows) {
            self.sides[row][1] += weight;
        }
        for body in &mut self.bodies {
            body.system.begin();
        }
        for element in &mut self.elements {
            let (rail, bodies) = (&self.rail, &self.bodies);
            let force = element.step(|point| match point {
                Point::Rail(node) => rail.extrapolated(node),
                Point::Body(body, i) => bodies[body].system.motion.extrapolated(i),
            });
            for (point, force) in [(Some(element.from), -force), (element.to, force)] {
                match point {
                    Some(Point::Rail(node)) => self.sides[Rail::row(node)][0] += force,
                    Some(Point::Body(body, i)) => self.bodies[body].system.force[i] += force,
                    None => {}
                }
            }
        }
        for body in &mut self.bodies {
            self.sides[Rail::row(body.node)][0] += body.release();
        }
        self.factor.solve(&mut self.sides);
    }

    /// The rail under a wheel of the step that has begun.
    pub(crate) fn under(&self, place: &Place) -> UnderWheel {
        let motion = &self.rail.motion;
        UnderWheel {
            free_m: place.of(|row| motion.predicted(row) + REACH * self.sides[row][0]),
            compliance: REACH * place.of(|row| self.sides[row][1]),
        }
    }

    /// Ends the step under its contact forces in N at `places`, which ascend.
    pub(crate) fn end(&mut self, places: &[Place], forces_n: &[f64]) {
        let mut first = 0;
        for (index, force_n) in forces_n.iter().enumerate() {
            let next = places.get(index + 1);
            let last = next.map_or(self.sides.len(), |next| places[index].middle(next));
            for (row, [free, per_force]) in (first..last).zip(&self.sides[first..last]) {
                self.rail.motion.advance(row, free + per_force * force_n);
            }
            first = last;
        }
        for body in &mut self.bodies {
            body.advance(self.rail.motion.acceleration[Rail::row(body.node)]);
        }
    }
}

/// Nodes in m: every seat, and between two the others evenly.
fn nodes_m(seats: &[Seat], cells: usize) -> Vec<f64> {
    let between = |pair: &[Seat]| {
        let [from, to] = [pair[0].x_m, pair[1].x_m];
        (0..cells).map(move |cell| from + (to - from) * cell as f64 / cells as f64)
    };
    let inner = seats.windows(2).flat_map(between);
    inner.chain(seats.last().map(|seat| seat.x_m)).collect()
}

fn soft_rail(hidden: &Hidden) -> Option<SoftRail> {
    match *hidden {
        Hidden::RailJoint { x_m: [x_m, _], bending_factor, bending_length_m, .. } => {
            Some(SoftRail { x_m, length_m: bending_length_m, factor: bending_factor })
        }
        _ => None,
    }
}

/// A mass on a damped spring under the rail's nearest node.
fn absorber(hidden: &Hidden, rail: &Rail) -> Option<Body> {
    let Hidden::RailAbsorber { x_m: [x_m, _], mass_kg, frequency_hz, damping_ratio } = *hidden
    else {
        return None;
    };
    let mut matrices = Matrices::zero(2);
    matrices.mass[(0, 0)] = mass_kg;
    let omega = TAU * frequency_hz;
    let damping = 2.0 * damping_ratio * mass_kg * omega;
    matrices.connect(0, Some(1), mass_kg * omega * omega, damping);
    Some(Body::new(rail.nearest(x_m), &matrices))
}

fn elements(scene: &Scene, scale: &Scale, layout: &Layout, seats: &[Seat]) -> Vec<Element> {
    let mut elements = Vec::new();
    let under = layout.seat;
    for (index, seat) in seats.iter().enumerate() {
        if let Some([exponent, reference_n, toe_n]) = seat.stiffening {
            let reference_n = reference_n + toe_n;
            let law = Stiffening { pad: seat.pad, exponent, reference_n, toe_n };
            let (from, to) = (Point::Rail(scale.cells * index), Point::Body(index, under));
            elements.push(Element::new(from, Some(to), Law::Stiffening(law)));
        }
        let layer = seat.layer.map(|_| Point::Body(index, LAYER));
        if let Some(gap_m) = seat.gap_m {
            let at = |&(node, share): &(usize, f64)| {
                let ballast = seat.ballast.map(|whole| whole * share);
                let void = Law::Void(Void { gap_m, ballast, closing_m: scale.closing_m });
                Element::new(Point::Body(index, node), layer, void)
            };
            elements.extend(layout.ballast.iter().map(at));
        }
        let next = seats.get(index + 1).and_then(|next| next.layer);
        if let (Some(from), Some([_, stiffness, damping]), Some(_)) = (layer, seat.layer, next) {
            let law = Law::Linear([SHARED_LAYER * stiffness, SHARED_LAYER * damping]);
            elements.push(Element::new(from, Some(Point::Body(index + 1, LAYER)), law));
        }
    }
    for hidden in &scene.left_out {
        if let Hidden::LinkedSleepers { sleepers, stiffness_n_per_m } = *hidden {
            let [from, to] = sleepers.map(|number| Point::Body(index_of(number), under));
            let law = Law::Linear([stiffness_n_per_m, FASTENER_DAMPING_S * stiffness_n_per_m]);
            elements.push(Element::new(from, Some(to), law));
        }
    }
    elements
}

#[cfg(test)]
mod tests;
