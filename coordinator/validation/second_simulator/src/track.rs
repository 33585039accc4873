//! The track in motion: rail, sleepers and hidden effects.
//!
//! This module assembles the track from a scene. It computes the two parts of a time step: before and
//! after the contact force is known.

use crate::band::Factor;
use crate::body::Body;
use crate::element::{Element, Law, Point, Stiffening, Void};
use crate::rail::{Place, Rail, SoftRail};
use crate::scheme::{REACH, Weights};
use crate::seat::{BEYOND, Seat, index_of};
use crate::sleeper::{self, BALLAST_NODES, FASTENER_DAMPING_S, LAYER, SEAT};
use crate::system::Matrices;
use std::f64::consts::TAU;
use tracktwin_parameters::TrackDesign;
use tracktwin_reference_simulator::{Hidden, SPACING_M, Scene};

/// Cells of the rail's grid in a span.
const CELLS: usize = 12;
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
    pub(crate) fn new(scene: &Scene, design: &TrackDesign, seats: &[Seat]) -> Self {
        let length_m = scene.length_m();
        let beyond_m = BEYOND as f64 * SPACING_M;
        let decay = |x_m: f64| {
            let outside_m = (-x_m).max(x_m - length_m).max(0.0);
            END_DECAY * (outside_m / beyond_m).powi(2)
        };
        let soft: Vec<SoftRail> = scene.left_out.iter().filter_map(soft_rail).collect();
        let mut rail = Rail::new(&design.rail, nodes_m(seats), &soft, decay);
        let at_seat = |(index, seat): (usize, &Seat)| {
            Body::new(CELLS * index, &sleeper::matrices(seat, &design.sleeper))
        };
        let mut bodies: Vec<Body> = seats.iter().enumerate().map(at_seat).collect();
        for (index, seat) in seats.iter().enumerate().filter(|(_, seat)| seat.clamp[1] > 0.0) {
            rail.clamp(CELLS * index, seat.clamp[1], FASTENER_DAMPING_S * seat.clamp[1]);
        }
        bodies.extend(scene.left_out.iter().filter_map(|hidden| absorber(hidden, &rail)));
        let mut band = rail.matrix(Weights::STEP);
        for body in &bodies {
            band.add(Rail::row(body.node), body.on_rail()[0]);
        }
        Self {
            factor: band.factor(),
            sides: vec![[0.0; 2]; rail.size()],
            elements: elements(scene, seats),
            rail,
            bodies,
        }
    }

    /// Moves to rest under a force in N at `x_m`, voids open; returns the displacement there in m.
    pub(crate) fn rest_under(&mut self, x_m: f64, force_n: f64) -> f64 {
        let place = self.rail.place(x_m);
        let mut band = self.rail.matrix(Weights::REST);
        for body in &self.bodies {
            band.add(Rail::row(body.node), body.on_rail()[1]);
        }
        self.sides.fill([0.0; 2]);
        for (row, weight) in place.rows() {
            self.sides[row][0] = weight * force_n;
        }
        band.factor().solve(&mut self.sides);
        for (displacement, side) in self.rail.motion.displacement.iter_mut().zip(&self.sides) {
            *displacement = side[0];
        }
        for body in &mut self.bodies {
            body.rest_under(self.sides[Rail::row(body.node)][0]);
        }
        place.of(|row| self.sides[row][0])
    }

    /// The rail's place under the wheel.
    pub(crate) fn place(&self, x_m: f64) -> Place {
        self.rail.place(x_m)
    }

    /// Begins a step that ends with the wheel at `place`.
    pub(crate) fn begin(&mut self, place: &Place) -> UnderWheel {
        self.rail.begin(&mut self.sides);
        for side in &mut self.sides {
            side[1] = 0.0;
        }
        for (row, weight) in place.rows() {
            self.sides[row][1] = weight;
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
        let motion = &self.rail.motion;
        UnderWheel {
            free_m: place.of(|row| motion.predicted(row) + REACH * self.sides[row][0]),
            compliance: REACH * place.of(|row| self.sides[row][1]),
        }
    }

    /// Ends the step under its contact force in N.
    pub(crate) fn end(&mut self, force_n: f64) {
        for (row, [free, per_force]) in self.sides.iter().enumerate() {
            self.rail.motion.advance(row, free + per_force * force_n);
        }
        for body in &mut self.bodies {
            body.advance(self.rail.motion.acceleration[Rail::row(body.node)]);
        }
    }
}

/// Nodes in m: every seat, and between two the others evenly.
fn nodes_m(seats: &[Seat]) -> Vec<f64> {
    let between = |pair: &[Seat]| {
        let [from, to] = [pair[0].x_m, pair[1].x_m];
        (0..CELLS).map(move |cell| from + (to - from) * cell as f64 / CELLS as f64)
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

fn elements(scene: &Scene, seats: &[Seat]) -> Vec<Element> {
    let mut elements = Vec::new();
    for (index, seat) in seats.iter().enumerate() {
        if let Some([exponent, reference_n, toe_n]) = seat.stiffening {
            let reference_n = reference_n + toe_n;
            let law = Stiffening { pad: seat.pad, exponent, reference_n, toe_n };
            let (from, to) = (Point::Rail(CELLS * index), Point::Body(index, SEAT));
            elements.push(Element::new(from, Some(to), Law::Stiffening(law)));
        }
        let layer = seat.layer.map(|_| Point::Body(index, LAYER));
        if let Some(gap_m) = seat.gap_m {
            let ballast = seat.ballast.map(|whole| whole / BALLAST_NODES.len() as f64);
            let void = Law::Void(Void { gap_m, ballast });
            let at = |node| Element::new(Point::Body(index, node), layer, void);
            elements.extend(BALLAST_NODES.map(at));
        }
        let next = seats.get(index + 1).and_then(|next| next.layer);
        if let (Some(from), Some([_, stiffness, damping]), Some(_)) = (layer, seat.layer, next) {
            let law = Law::Linear([SHARED_LAYER * stiffness, SHARED_LAYER * damping]);
            elements.push(Element::new(from, Some(Point::Body(index + 1, LAYER)), law));
        }
    }
    for hidden in &scene.left_out {
        if let Hidden::LinkedSleepers { sleepers, stiffness_n_per_m } = *hidden {
            let [from, to] = sleepers.map(|number| Point::Body(index_of(number), SEAT));
            let law = Law::Linear([stiffness_n_per_m, FASTENER_DAMPING_S * stiffness_n_per_m]);
            elements.push(Element::new(from, Some(to), law));
        }
    }
    elements
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::STEP_S;
    use crate::seat::testing::seat;
    use tracktwin_reference_simulator::SleeperTruth;

    fn scene(spans: usize) -> Scene {
        let sleeper = SleeperTruth {
            railpad_stiffness_n_m: 1.5e8,
            ballast_stiffness_n_m: 1.2e7,
            sleeper_ei_n_m2: 5000.0,
        };
        Scene::uniform(spans, sleeper)
    }

    fn seats_of(spans: usize, base: &Seat) -> Vec<Seat> {
        let at =
            |index: usize| Seat { x_m: (index as f64 - BEYOND as f64) * SPACING_M, ..base.clone() };
        (0..spans + 1 + 2 * BEYOND).map(at).collect()
    }

    #[test]
    fn the_deflection_at_rest_is_that_of_a_beam_on_an_elastic_foundation() {
        let design = TrackDesign::v_track();
        // Supports so soft that they act as one foundation, under stiff sleepers.
        let base = Seat { ballast: [1.2e6, 90.0], ei: 5e7, ..seat() };
        let mut track = Track::new(&scene(80), &design, &seats_of(80, &base));
        let deflection = track.rest_under(5.0, 4500.0);
        // Winkler's foundation under a beam that shears too: Fourier integral in closed form.
        let foundation = 1.0 / (1.0 / 1.2e6 + 1.0 / 1.5e8) / SPACING_M;
        let ei = design.rail.bending_stiffness();
        let shear = ei / design.rail.shear_stiffness();
        let root = (foundation * shear + 2.0 * (ei * foundation).sqrt()).sqrt();
        let winkler = 4500.0 / (2.0 * root) * (foundation.powf(-0.5) + shear * ei.powf(-0.5));
        assert!((deflection / winkler - 1.0).abs() < 0.01, "{deflection} and {winkler}");
    }

    /// Acceleration of the rail at `x_m` after a blow of one step there.
    fn ring(track: &mut Track, x_m: f64, steps: usize) -> Vec<f64> {
        let place = track.place(x_m);
        let mut heard = Vec::with_capacity(steps);
        for step in 0..steps {
            track.begin(&place);
            track.end(if step == 0 { 1000.0 } else { 0.0 });
            heard.push(place.of(|row| track.rail.motion.acceleration[row]));
        }
        heard
    }

    /// Power at a frequency in Hz.
    fn power(heard: &[f64], frequency_hz: f64) -> f64 {
        let turn = TAU * frequency_hz * STEP_S;
        let (mut re, mut im) = (0.0, 0.0);
        for (step, value) in heard.iter().enumerate() {
            re += value * (turn * step as f64).cos();
            im += value * (turn * step as f64).sin();
        }
        re * re + im * im
    }

    #[test]
    fn the_pinned_pinned_resonance_is_that_of_a_timoshenko_beam() {
        let design = TrackDesign::v_track();
        let base = Seat { pad: [6e8, 100.0], ..seat() };
        let mut track = Track::new(&scene(30), &design, &seats_of(30, &base));
        let heard = ring(&mut track, 15.5 * SPACING_M, 6000);
        let (_, found) = (4000..9000)
            .step_by(10)
            .map(|hz| (power(&heard[100..], f64::from(hz)), f64::from(hz)))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        // A pinned beam of one span: the lower root of Timoshenko's equation.
        let rail = &design.rail;
        let wave = std::f64::consts::PI / SPACING_M;
        let (ei, ga) = (rail.bending_stiffness(), rail.shear_stiffness());
        let (mass, inertia) = (rail.mass_per_length(), rail.rotary_inertia_per_length());
        let b = ei * mass * wave * wave + ga * (mass + inertia * wave * wave);
        let square = (b - (b * b - 4.0 * mass * inertia * ei * ga * wave.powi(4)).sqrt())
            / (2.0 * mass * inertia);
        let closed = square.sqrt() / TAU;
        // The scheme's period at this frequency is a few per cent long.
        assert!((found / closed - 1.0).abs() < 0.05, "{found} and {closed}");
    }
}
