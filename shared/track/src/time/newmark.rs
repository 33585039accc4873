//! The plain solver: one case, step by step, directly from the equations.

use super::cholesky::Cholesky;
use super::coupled::{self, Resistance};
use super::equilibrium::Equilibrium;
use super::kinematics::Kinematics;
use super::rolling::Rolling;
use super::{Pass, PassError, PassRecord};
use crate::model::{ForceLaw, HertzContact, RailPoint, Surface, TrackModel};
use nalgebra::{DMatrix, DVector};

/// Runs the vehicle over the track.
///
/// Average acceleration (Newmark, `β = 1/4`, `γ = 1/2`) for track and vehicle. Track and vehicle are
/// condensed to the motions of contacts and force laws; Newton's method gives the forces. Source: paper,
/// Appendix B.
///
/// # Errors
/// [`PassError`] if the pass leaves the track, or if track or surface are invalid.
pub fn pass(model: &TrackModel, pass: &Pass, surface: &Surface) -> Result<PassRecord, PassError> {
    pass.check(model)?;
    let mut motion = NewmarkState::start(model, pass, surface)?;
    let mut record = PassRecord::start(pass, motion.force_n);
    for step in 1..=pass.steps() {
        motion.advance(pass.position_m(step), &heights_m(model, pass, surface, step))?;
        record.push(motion.wheels[0].acceleration(), motion.force_n);
    }
    Ok(record)
}

/// Heights of the surface in m under all wheels after `step` steps.
fn heights_m(model: &TrackModel, pass: &Pass, surface: &Surface, step: usize) -> Vec<f64> {
    let further = model.vehicle().further_wheels_m.iter();
    let further = further.map(|&ahead_m| pass.further_height_m(model, surface, step, ahead_m));
    [pass.height_m(model, surface, step)].into_iter().chain(further).collect()
}

/// State of a force law during a pass.
struct Resisting<'a> {
    law: &'a ForceLaw,
    motion: Kinematics,
    /// Displacements of the track per unit force on its port, in a step.
    unit: Vec<f64>,
}

/// State of vehicle and track during a pass.
struct NewmarkState<'a> {
    model: &'a TrackModel,
    contact: HertzContact,
    local_flexibility: bool,
    dt: f64,
    /// Factor of `4 M / dt² + 2 C / dt + K`.
    dynamic_stiffness: Cholesky,
    track: Vec<Kinematics>,
    wheels: Vec<Rolling>,
    laws: Vec<Resisting<'a>>,
    /// Motions of all contacts and laws in the last step: where Newton's method starts.
    motions: DVector<f64>,
    /// Contact force of the first wheel.
    force_n: f64,
}

/// Wheels on the rail in one step, and the motions without contact forces.
struct FreeMotion {
    points: Vec<RailPoint>,
    /// Displacements of the track per unit contact force of each wheel.
    units: Vec<Vec<f64>>,
    /// Approaches without any contact force.
    overlaps: Vec<f64>,
    /// Displacements of the track without any contact force or law.
    free: Vec<f64>,
}

impl<'a> NewmarkState<'a> {
    fn start(model: &'a TrackModel, pass: &Pass, surface: &Surface) -> Result<Self, PassError> {
        let dt = pass.time_step_s;
        let matrices = model.matrices();
        let values = matrices.combination(4.0 / (dt * dt), 2.0 / dt, 1.0);
        let rest = Equilibrium::new(model, pass, &heights_m(model, pass, surface, 0))?;
        let dynamic_stiffness = Cholesky::new(matrices, &values)?;
        let resisting = |law: &'a ForceLaw| Resisting {
            law,
            motion: Kinematics::at_rest(law.port.motion(&rest.track)),
            unit: dynamic_stiffness.solve_port(&law.port),
        };
        let laws: Vec<_> = model.force_laws().iter().map(resisting).collect();
        let contact = HertzContact::new(model.design());
        let wheels = Rolling::at_rest(model.vehicle(), &rest.contacts_m, dt);
        let force_n = model.vehicle().wheel.load_n;
        let approaches = wheels.iter().map(|_| contact.approach(force_n));
        let motions = approaches.chain(laws.iter().map(|law| law.motion.displacement));
        Ok(Self {
            model,
            contact,
            local_flexibility: pass.local_flexibility,
            dt,
            motions: DVector::from_vec(motions.collect()),
            dynamic_stiffness,
            track: rest.track.into_iter().map(Kinematics::at_rest).collect(),
            wheels,
            laws,
            force_n,
        })
    }

    /// One time step, at whose end the first wheel stands at `x_m` and each over its height.
    fn advance(&mut self, x_m: f64, heights_m: &[f64]) -> Result<(), PassError> {
        let free_motion = self.free_motion(x_m, heights_m);
        let forces = match self.forces_of_one_contact(&free_motion) {
            Some(force_n) => vec![force_n],
            None => self.forces_of_all(&free_motion).unwrap_or(vec![f64::NAN]),
        };
        self.force_n = forces[0];
        if !self.force_n.is_finite() {
            return Err(PassError::NotFinite { position_m: x_m });
        }
        self.push(free_motion, &forces);
        Ok(())
    }

    fn free_motion(&mut self, x_m: f64, heights_m: &[f64]) -> FreeMotion {
        let free = self.track_without_contact();
        let layout = self.model.layout();
        let points: Vec<_> =
            self.wheels.iter().map(|wheel| layout.rail_point(x_m + wheel.ahead_m)).collect();
        let units = points.iter().map(|point| self.track_under_unit_force(point)).collect();
        let overlap = |((wheel, point), height_m): ((&mut Rolling, &RailPoint), &f64)| {
            wheel.lift_off(self.dt) - point.deflection(&free) - height_m
        };
        let overlaps = self.wheels.iter_mut().zip(&points).zip(heights_m).map(overlap).collect();
        FreeMotion { points, units, overlaps, free }
    }

    /// The contact force if there is one wheel and all laws have zero force. NaN if an input is NaN.
    fn forces_of_one_contact(&self, free_motion: &FreeMotion) -> Option<f64> {
        let ([overlap], [unit]) = (&free_motion.overlaps[..], &free_motion.units[..]) else {
            return None;
        };
        let force = self.contact.solve(*overlap, self.compliance(free_motion, 0));
        let force = force.unwrap_or(f64::NAN);
        let at_rest = |law: &Resisting| {
            let motion = law.law.port.motion(&free_motion.free) + force * law.law.port.motion(unit);
            Resistance::Law(law.law, law.motion, Some(self.dt)).rests_at(motion)
        };
        self.laws.iter().all(at_rest).then_some(force)
    }

    /// Displacement of one wheel relative to the track below it per unit contact force, in m/N.
    fn compliance(&self, free_motion: &FreeMotion, wheel: usize) -> f64 {
        let point = &free_motion.points[wheel];
        let local = if self.local_flexibility { point.local_flexibility } else { 0.0 };
        point.deflection(&free_motion.units[wheel]) + self.wheels[wheel].compliance() + local
    }

    /// Forces of all contacts, then of all laws.
    fn forces_of_all(&mut self, free_motion: &FreeMotion) -> Option<Vec<f64>> {
        let wheels = self.wheels.len();
        let count = wheels + self.laws.len();
        let port = |index: usize, displacement: &[f64]| match index.checked_sub(wheels) {
            None => -free_motion.points[index].deflection(displacement),
            Some(law) => self.laws[law].law.port.motion(displacement),
        };
        let compliance =
            DMatrix::from_fn(count, count, |row, column| match column.checked_sub(wheels) {
                None if row == column => self.compliance(free_motion, row),
                None => -port(row, &free_motion.units[column]),
                Some(law) => port(row, &self.laws[law].unit),
            });
        let law_motions = self.laws.iter().map(|law| law.law.port.motion(&free_motion.free));
        let free = free_motion.overlaps.iter().copied().chain(law_motions);
        let free = DVector::from_vec(free.collect());
        let contacts = (0..wheels).map(|_| Resistance::Contact(self.contact));
        let laws = self.laws.iter();
        let laws = laws.map(|law| Resistance::Law(law.law, law.motion, Some(self.dt)));
        let resistances: Vec<_> = contacts.chain(laws).collect();
        let (motions, forces) =
            coupled::solve(&resistances, &compliance, &free, self.motions.clone())?;
        self.motions = motions;
        Some(forces.iter().copied().collect())
    }

    /// Updates all states. `forces` has the contact forces, then the forces of the laws.
    fn push(&mut self, free_motion: FreeMotion, forces: &[f64]) {
        let mut displacement = free_motion.free;
        let mut add = |factor: f64, unit: &[f64]| {
            displacement.iter_mut().zip(unit).for_each(|(sum, unit)| *sum += factor * unit);
        };
        for (unit, force) in free_motion.units.iter().zip(forces) {
            add(*force, unit);
        }
        for (law, force) in self.laws.iter().zip(&forces[self.wheels.len()..]) {
            add(-force, &law.unit);
        }
        for law in &mut self.laws {
            law.motion.advance(law.law.port.motion(&displacement), self.dt);
        }
        for (dof, displacement) in self.track.iter_mut().zip(displacement) {
            dof.advance(displacement, self.dt);
        }
        for (wheel, force) in self.wheels.iter_mut().zip(forces) {
            wheel.advance(*force, self.dt);
        }
    }

    /// Displacements at the end of the step without contact force.
    fn track_without_contact(&self) -> Vec<f64> {
        let matrices = self.model.matrices();
        let inertia: Vec<_> = self.track.iter().map(|dof| dof.inertia(self.dt)).collect();
        let resistance: Vec<_> = self.track.iter().map(|dof| dof.resistance(self.dt)).collect();
        let mut displacement = matrices.product(matrices.mass(), &inertia);
        let damping = matrices.product(matrices.damping(), &resistance);
        displacement.iter_mut().zip(damping).for_each(|(sum, force)| *sum += force);
        self.dynamic_stiffness.solve(&mut displacement);
        displacement
    }

    /// Displacements that a unit contact force adds.
    fn track_under_unit_force(&self, point: &RailPoint) -> Vec<f64> {
        let mut displacement = vec![0.0; self.track.len()];
        for (dof, shape) in point.entries() {
            displacement[dof] = shape;
        }
        self.dynamic_stiffness.solve(&mut displacement);
        displacement
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mesh, Roughness, Support};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPACING_M: f64 = 0.125;
    const SPEED_M_S: f64 = 13.0 / 3.6;

    fn track(spans: usize, rail_elements: usize) -> TrackModel {
        let supports = vec![Support::from(&ParameterSet::nominal()); spans - 1];
        let mesh = Mesh::uniform(spans, rail_elements, 8);
        TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[]).unwrap()
    }

    fn over_spans(from: f64, to: f64) -> Pass {
        Pass {
            speed_m_s: SPEED_M_S,
            start_m: from * SPACING_M,
            end_m: to * SPACING_M,
            time_step_s: 1e-5,
            local_flexibility: true,
        }
    }

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
    }

    /// Acceleration rms over the last two of six spans on a smooth rail, by rail mesh.
    fn smooth_rail_rms(rail_elements: usize, local_flexibility: bool) -> f64 {
        let pass = Pass { local_flexibility, ..over_spans(9.0, 15.0) };
        let record = super::pass(&track(25, rail_elements), &pass, &Surface::smooth()).unwrap();
        let samples = record.acceleration_m_s2.len();
        rms(&record.acceleration_m_s2[samples * 2 / 3..])
    }

    #[test]
    fn on_a_smooth_rail_the_acceleration_does_not_depend_on_the_mesh() {
        let finest = smooth_rail_rms(32, true);
        for (elements, tolerance) in [(4, 0.05), (8, 0.01), (16, 0.01)] {
            let coarse = smooth_rail_rms(elements, true);
            assert!((coarse / finest - 1.0).abs() < tolerance, "{elements}: {coarse} {finest}");
        }
    }

    #[test]
    fn without_the_local_flexibility_the_mesh_is_a_false_roughness() {
        // Four elements a span are passed at 115 Hz, the resonance of the wheel on the track;
        // refining does not help, because the nodes always move stiffer than the rail between.
        let converged = smooth_rail_rms(32, true);
        for (elements, least) in [(4, 10.0), (8, 1.1), (16, 1.1), (32, 1.1)] {
            let ratio = smooth_rail_rms(elements, false) / converged;
            assert!(ratio > least, "{elements}: {ratio}");
        }
    }

    #[test]
    fn energy_is_conserved_but_for_the_dampers() {
        let (model, pass) = (track(6, 4), over_spans(2.0, 4.0));
        let surface = Surface::rough(1, 3.0, 1.0);
        let matrices = model.matrices();
        let mut motion = NewmarkState::start(&model, &pass, &surface).unwrap();
        let quadratic = |values: &[f64], x: &[f64]| -> f64 {
            matrices.product(values, x).iter().zip(x).map(|(f, x)| f * x).sum()
        };
        let part = |motion: &NewmarkState, pick: fn(&Kinematics) -> f64| -> Vec<f64> {
            motion.track.iter().map(pick).collect()
        };
        let energy = |motion: &NewmarkState| {
            0.5 * quadratic(matrices.mass(), &part(motion, |dof| dof.velocity))
                + 0.5 * quadratic(matrices.stiffness(), &part(motion, |dof| dof.displacement))
        };
        let (mut work, mut loss, mut turnover) = (0.0, 0.0, 0.0);
        let first = energy(&motion);
        for step in 1..=pass.steps() {
            let before = part(&motion, |dof| dof.displacement);
            let (x0, x1) = (pass.position_m(step - 1), pass.position_m(step));
            let force_before = motion.force_n;
            motion.advance(x1, &[pass.height_m(&model, &surface, step)]).unwrap();
            let after = part(&motion, |dof| dof.displacement);
            let moved: Vec<_> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
            // Under the trapezoidal rule the mean of the forces at both ends does the work.
            let point = |x: f64| model.layout().rail_point(x).deflection(&moved);
            let done = 0.5 * (force_before * point(x0) + motion.force_n * point(x1));
            work += done;
            turnover += done.abs();
            loss += quadratic(matrices.damping(), &moved) / pass.time_step_s;
        }
        let balance = energy(&motion) - first - work + loss;
        assert!(loss > 1e-3 * turnover, "the dampers do nothing");
        // Ten thousand additions of numbers of the size of the turnover.
        assert!(balance.abs() < 1e-9 * turnover, "{balance} of {turnover}");
    }

    #[test]
    fn the_wheel_at_rest_hangs_between_its_load_and_a_dense_solution() {
        let (model, pass) = (track(5, 4), over_spans(2.3, 3.0));
        let rest = Equilibrium::new(&model, &pass, &[1e-5]).unwrap();
        let matrices = model.matrices();
        let size = matrices.size();
        let mut stiffness = nalgebra::DMatrix::zeros(size, size);
        for (row, column, place) in matrices.places() {
            stiffness[(row, column)] = matrices.stiffness()[place];
        }
        let point = model.layout().rail_point(pass.start_m);
        let mut load = nalgebra::DVector::zeros(size);
        point.entries().for_each(|(dof, shape)| load[dof] = 4500.0 * shape);
        let dense = stiffness.cholesky().unwrap().solve(&load);
        let scale = dense.amax();
        for (sparse, dense) in rest.track.iter().zip(&dense) {
            // Condition number 1e6 at most, times rounding.
            assert!((sparse - dense).abs() < 1e-9 * scale, "{sparse} {dense}");
        }
        let approach = rest.contacts_m[0]
            - 1e-5
            - point.deflection(&rest.track)
            - 4500.0 * point.local_flexibility;
        let force = HertzContact::new(model.design()).force(approach);
        assert!((force / 4500.0 - 1.0).abs() < 1e-9, "{force}");
    }

    #[test]
    fn the_time_step_is_of_second_order() {
        // Few elements and a short step: every mode of this track, up to 100 kHz, is resolved.
        let model = track(4, 2);
        let smooth_waves = Roughness { shortest_m: 1e-2, ..Roughness::new(3.0) };
        let surface = smooth_waves.surface(2, 1.0);
        let coarse_step = 2e-6;
        let run = |division: usize| {
            let time_step_s = coarse_step / division as f64;
            let pass = Pass { time_step_s, ..over_spans(1.3, 1.6) };
            let record = super::pass(&model, &pass, &surface).unwrap();
            record.contact_force_n.into_iter().step_by(division).collect::<Vec<_>>()
        };
        let [finest, half, whole] = [8, 2, 1].map(run);
        let error = |forces: &[f64]| {
            let difference: Vec<_> = forces.iter().zip(&finest).map(|(a, b)| a - b).collect();
            rms(&difference)
        };
        // Against a run at an eighth, second order shows as (1 - 1/64) / (1/4 - 1/64) = 2^2.07.
        let order = (error(&whole) / error(&half)).log2();
        assert!((1.95..2.15).contains(&order), "observed order {order}");
    }

    #[test]
    fn a_wheel_on_a_deep_dip_lifts_off_and_lands() {
        let model = track(6, 4);
        let surface = Surface::rough(3, 3000.0, 1.0);
        let record = super::pass(&model, &over_spans(2.0, 4.0), &surface).unwrap();
        assert!(record.contact_force_n.contains(&0.0), "never lifted off");
        assert!(record.contact_force_n.iter().all(|&force| force >= 0.0));
        let mass = model.design().wheel.mass_kg;
        for (a, f) in record.acceleration_m_s2.iter().zip(&record.contact_force_n) {
            // The kinematic acceleration is a difference of positions: 1e-16 of 1e-4 m / dt².
            assert!((a - (4500.0 - f) / mass).abs() < 1e-6 * a.abs().max(1.0), "{a} {f}");
        }
    }

    #[test]
    fn a_pass_beyond_the_track_is_refused() {
        let error = super::pass(&track(5, 4), &over_spans(2.0, 5.1), &Surface::smooth());
        assert!(matches!(error, Err(PassError::Pass { .. })));
    }
}
