//! The plain solver: one case, one step after the other, as the equations say it.

use super::cholesky::Cholesky;
use super::equilibrium::Equilibrium;
use super::{Pass, PassError, PassRecord};
use crate::model::{HertzContact, RailPoint, Surface, TrackModel};

/// Runs the wheel over the track.
///
/// Average acceleration (Newmark, `β = 1/4`, `γ = 1/2`) for track and wheel; the contact force of
/// each step is found by Newton's method on the contact point alone, to which track and wheel are
/// condensed. Source: paper, Appendix B.
///
/// # Errors
/// [`PassError`] if the pass leaves the track, or the track or its surface makes no sense.
pub fn pass(model: &TrackModel, pass: &Pass, surface: &Surface) -> Result<PassRecord, PassError> {
    pass.check(model)?;
    let mut motion = Motion::start(model, pass, surface)?;
    let mut record = PassRecord::start(pass, motion.force_n);
    for step in 1..=pass.steps() {
        motion.advance(pass.position_m(step), pass.height_m(surface, step))?;
        record.push(motion.wheel.acceleration, motion.force_n);
    }
    Ok(record)
}

/// Displacement, velocity and acceleration of one degree of freedom.
#[derive(Clone, Copy, Default)]
struct Kinematics {
    displacement: f64,
    velocity: f64,
    acceleration: f64,
}

impl Kinematics {
    /// Moves on to a new displacement under constant average acceleration.
    fn advance(&mut self, displacement: f64, dt: f64) {
        let moved = displacement - self.displacement;
        let velocity = 2.0 / dt * moved - self.velocity;
        self.acceleration = 2.0 / dt * (velocity - self.velocity) - self.acceleration;
        self.velocity = velocity;
        self.displacement = displacement;
    }

    /// What the mass would have to be pushed with to stay at displacement zero, per mass.
    fn inertia(&self, dt: f64) -> f64 {
        4.0 / (dt * dt) * self.displacement + 4.0 / dt * self.velocity + self.acceleration
    }

    /// The same for a damper, per damping.
    fn resistance(&self, dt: f64) -> f64 {
        2.0 / dt * self.displacement + self.velocity
    }
}

/// Wheel and track on their way.
struct Motion<'a> {
    model: &'a TrackModel,
    contact: HertzContact,
    local_flexibility: bool,
    dt: f64,
    /// Factor of `4 M / dt² + 2 C / dt + K`.
    dynamic_stiffness: Cholesky,
    track: Vec<Kinematics>,
    wheel: Kinematics,
    force_n: f64,
}

impl<'a> Motion<'a> {
    fn start(model: &'a TrackModel, pass: &Pass, surface: &Surface) -> Result<Self, PassError> {
        let dt = pass.time_step_s;
        let matrices = model.matrices();
        let values = matrices.combination(4.0 / (dt * dt), 2.0 / dt, 1.0);
        let rest = Equilibrium::new(model, pass, pass.height_m(surface, 0))?;
        let at_rest = |displacement| Kinematics { displacement, ..Kinematics::default() };
        Ok(Self {
            model,
            contact: HertzContact::new(model.design()),
            local_flexibility: pass.local_flexibility,
            dt,
            dynamic_stiffness: Cholesky::new(matrices, &values)?,
            track: rest.track.into_iter().map(at_rest).collect(),
            wheel: at_rest(rest.wheel_m),
            force_n: model.design().wheel.load_n,
        })
    }

    /// One time step, at whose end the wheel stands at `x_m` over a surface of height `height_m`.
    fn advance(&mut self, x_m: f64, height_m: f64) -> Result<(), PassError> {
        let point = self.model.layout().rail_point(x_m);
        let free = self.track_without_contact();
        let unit = self.track_under_unit_force(&point);
        let (wheel_free, wheel_compliance) = self.wheel_without_contact();
        let local = if self.local_flexibility { point.local_flexibility } else { 0.0 };
        let compliance = point.deflection(&unit) + wheel_compliance + local;
        let overlap = wheel_free - point.deflection(&free) - height_m;
        self.force_n = self
            .contact
            .solve(overlap, compliance)
            .ok_or(PassError::NotFinite { position_m: x_m })?;
        for (dof, (free, unit)) in self.track.iter_mut().zip(free.iter().zip(&unit)) {
            dof.advance(free + self.force_n * unit, self.dt);
        }
        self.wheel.advance(wheel_free - self.force_n * wheel_compliance, self.dt);
        Ok(())
    }

    /// Displacements at the end of the step if the wheel lifted off.
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

    /// The wheel's displacement at the end of the step without contact, and what a unit contact
    /// force takes from it.
    fn wheel_without_contact(&self) -> (f64, f64) {
        let wheel = &self.model.design().wheel;
        let compliance = self.dt * self.dt / (4.0 * wheel.mass_kg);
        let force = wheel.mass_kg * self.wheel.inertia(self.dt) + wheel.load_n;
        (compliance * force, compliance)
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
        let mut motion = Motion::start(&model, &pass, &surface).unwrap();
        let quadratic = |values: &[f64], x: &[f64]| -> f64 {
            matrices.product(values, x).iter().zip(x).map(|(f, x)| f * x).sum()
        };
        let part = |motion: &Motion, pick: fn(&Kinematics) -> f64| -> Vec<f64> {
            motion.track.iter().map(pick).collect()
        };
        let energy = |motion: &Motion| {
            0.5 * quadratic(matrices.mass(), &part(motion, |dof| dof.velocity))
                + 0.5 * quadratic(matrices.stiffness(), &part(motion, |dof| dof.displacement))
        };
        let (mut work, mut loss, mut turnover) = (0.0, 0.0, 0.0);
        let first = energy(&motion);
        for step in 1..=pass.steps() {
            let before = part(&motion, |dof| dof.displacement);
            let (x0, x1) = (pass.position_m(step - 1), pass.position_m(step));
            let force_before = motion.force_n;
            motion.advance(x1, pass.height_m(&surface, step)).unwrap();
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
        let rest = Equilibrium::new(&model, &pass, 1e-5).unwrap();
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
        let approach =
            rest.wheel_m - 1e-5 - point.deflection(&rest.track) - 4500.0 * point.local_flexibility;
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
