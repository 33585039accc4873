//! A wheel on its way over a track: state, and one time step.
//!
//! Owns the order in which a step is solved; what the ports do is `ports`'.

use crate::contact;
use crate::ports::PortState;
use crate::rest::Rest;
use crate::system::dot;
use crate::track::Track;
use crate::vtrack::WHEEL_LOAD_N;

/// What a step gives: what the sensor feels in m/s2 and the contact force in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Felt {
    pub(crate) acceleration_m_s2: f64,
    pub(crate) force_n: f64,
}

/// Rail, ports and vehicle at one moment.
#[derive(Clone, Debug)]
pub(crate) struct Motion<'a> {
    track: &'a Track,
    rail: RailState,
    ports: PortState,
    /// State of the vehicle about its rest, and room for the next.
    vehicle: [Vec<f64>; 2],
    /// What a unit contact force at a step's end moves the contact point of the vehicle, in m/N.
    given: f64,
    /// Contact force in N now and a step before.
    force_n: [f64; 2],
    /// Height of the wheel's centre at rest in m.
    wheel_m: f64,
}

/// The rail's modes.
#[derive(Clone, Debug)]
pub(crate) struct RailState {
    pub(crate) amplitudes: Vec<f64>,
    pub(crate) velocities: Vec<f64>,
    /// Force on every mode.
    pub(crate) forces: Vec<f64>,
    /// Deflection of every mode under the wheel.
    shape: Vec<f64>,
    /// Amplitudes and velocities under the contact force foreseen for the step's end alone.
    pub(crate) foreseen: [Vec<f64>; 2],
}

impl<'a> Motion<'a> {
    /// At rest under the wheel at `x_m`.
    pub(crate) fn at_rest(track: &'a Track, x_m: f64) -> Self {
        let rest = Rest::under_wheel(track, x_m);
        let ports = PortState::at_rest(track, &rest, x_m);
        let states = track.vehicle.contact.len();
        let wheel_m = rest.wheel_m();
        let gain = track.vehicle.system.gain(0);
        Self {
            track,
            rail: RailState::at_rest(rest),
            ports,
            vehicle: [vec![0.0; states], vec![0.0; states]],
            given: -dot(&track.vehicle.contact, &gain),
            force_n: [WHEEL_LOAD_N; 2],
            wheel_m,
        }
    }

    /// Moves on by a step, at whose end the wheel is at `x_m` over a surface `height_m` lower.
    ///
    /// Ports are solved for the contact force foreseen from the last two, then the contact for its
    /// force exactly: an error of second order in what the force changes from step to step. None
    /// where the force is no number.
    #[inline]
    pub(crate) fn step(&mut self, x_m: f64, height_m: f64) -> Option<Felt> {
        let foreseen_n = (2.0 * self.force_n[0] - self.force_n[1]).max(0.0);
        self.rail.foresee(self.track, x_m, foreseen_n);
        self.ports.share(self.track, &self.rail, x_m, foreseen_n);
        self.ports.push(self.track, &mut self.rail.forces);
        let force_n = self.touch(height_m)?;
        self.rail.finish(self.track, force_n);
        self.ports.finish(self.track, &self.rail, force_n);
        self.force_n = [force_n, self.force_n[0]];
        let vehicle = &self.track.vehicle;
        let dynamic = [force_n - WHEEL_LOAD_N];
        let acceleration_m_s2 =
            vehicle.system.acceleration(vehicle.sensor, &self.vehicle[0], &dynamic);
        Some(Felt { acceleration_m_s2, force_n })
    }

    /// Contact force in N at the step's end; moves the vehicle.
    #[inline]
    fn touch(&mut self, height_m: f64) -> Option<f64> {
        let vehicle = &self.track.vehicle;
        let [state, next] = &mut self.vehicle;
        vehicle.system.free(state, &[self.force_n[0] - WHEEL_LOAD_N], next);
        // The vehicle counts the force from the static load.
        vehicle.system.push(0, -WHEEL_LOAD_N, next);
        let (modes_m, given) = self.rail.under_wheel(self.track);
        let rail_m = modes_m - self.ports.beside_wheel();
        let overlap_m = self.wheel_m + dot(&vehicle.contact, next) - rail_m - height_m;
        let compliance = self.given + given + self.track.local;
        let force_n = contact::force(overlap_m, compliance)?;
        vehicle.system.push(0, force_n, next);
        self.vehicle.swap(0, 1);
        Some(force_n)
    }
}

impl RailState {
    fn at_rest(rest: Rest) -> Self {
        let modes = rest.amplitudes.len();
        Self {
            amplitudes: rest.amplitudes,
            velocities: vec![0.0; modes],
            forces: rest.loads,
            shape: vec![0.0; modes],
            foreseen: [vec![0.0; modes], vec![0.0; modes]],
        }
    }

    /// Amplitudes and velocities at the step's end without its forces, and with the contact force
    /// that is foreseen.
    #[inline]
    fn foresee(&mut self, track: &Track, x_m: f64, foreseen_n: f64) {
        sines(track.rail.wave_numbers[0] * x_m, &mut self.shape);
        let [e_qq, e_qv, e_vq, e_vv] = &track.steps.transition;
        let ([s_q, s_v], [t_q, t_v]) = (&track.steps.start, &track.steps.end);
        let count = self.shape.len();
        let (q, v, f) =
            (&mut self.amplitudes[..count], &mut self.velocities[..count], &self.forces[..count]);
        let [wish_q, wish_v] = &mut self.foreseen;
        let (wish_q, wish_v) = (&mut wish_q[..count], &mut wish_v[..count]);
        let (e_qq, e_qv, e_vq, e_vv) =
            (&e_qq[..count], &e_qv[..count], &e_vq[..count], &e_vv[..count]);
        let (s_q, s_v, t_q, t_v) = (&s_q[..count], &s_v[..count], &t_q[..count], &t_v[..count]);
        for n in 0..count {
            let amplitude = e_qq[n] * q[n] + e_qv[n] * v[n] + s_q[n] * f[n];
            let velocity = e_vq[n] * q[n] + e_vv[n] * v[n] + s_v[n] * f[n];
            let load = self.shape[n] * foreseen_n;
            q[n] = amplitude;
            v[n] = velocity;
            wish_q[n] = amplitude + t_q[n] * load;
            wish_v[n] = velocity + t_v[n] * load;
        }
    }

    /// Deflection in m of the modes under the wheel with the ports' forces but without the contact
    /// force at the step's end, and what a unit of that adds.
    #[inline]
    fn under_wheel(&self, track: &Track) -> (f64, f64) {
        let t_q = &track.steps.end[0];
        let mut sums = [[0.0; 8]; 2];
        let count = self.shape.len() / 8 * 8;
        let mut add = |lane: usize, n: usize| {
            let shape = self.shape[n];
            let end = t_q[n] * shape;
            sums[0][lane] += shape * self.amplitudes[n] + end * self.forces[n];
            sums[1][lane] += shape * end;
        };
        for n in (0..count).step_by(8) {
            for lane in 0..8 {
                add(lane, n + lane);
            }
        }
        for n in count..self.shape.len() {
            add(0, n);
        }
        (sums[0].iter().sum(), sums[1].iter().sum())
    }

    /// Adds what the forces at the step's end do: those of the ports and that of the contact.
    #[inline]
    fn finish(&mut self, track: &Track, force_n: f64) {
        let [t_q, t_v] = &track.steps.end;
        let count = self.shape.len();
        let (q, v, f) = (
            &mut self.amplitudes[..count],
            &mut self.velocities[..count],
            &mut self.forces[..count],
        );
        let (t_q, t_v, shape) = (&t_q[..count], &t_v[..count], &self.shape[..count]);
        for n in 0..count {
            f[n] += shape[n] * force_n;
            q[n] += t_q[n] * f[n];
            v[n] += t_v[n] * f[n];
        }
    }
}

/// `sin(n angle)` for `n` from 1, by `sin((n + 8) a) = 2 cos(8 a) sin(n a) - sin((n - 8) a)`.
#[inline]
fn sines(angle: f64, into: &mut [f64]) {
    let twice = 2.0 * (8.0 * angle).cos();
    let mut before = [0.0; 8];
    let mut now = [0.0; 8];
    for lane in 0..8 {
        let order = 1.0 + lane as f64;
        now[lane] = (order * angle).sin();
        before[lane] = ((order - 8.0) * angle).sin();
    }
    for chunk in into.chunks_mut(8) {
        for (value, now) in chunk.iter_mut().zip(&now) {
            *value = *now;
        }
        for lane in 0..8 {
            let next = twice * now[lane] - before[lane];
            before[lane] = now[lane];
            now[lane] = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_by_recurrence_are_sines() {
        let mut values = vec![0.0; 243];
        sines(1.234, &mut values);
        for (index, value) in values.iter().enumerate() {
            let exact = (1.234 * (index as f64 + 1.0)).sin();
            // The recurrence loses some digits where the angle is near a multiple of pi / 8.
            assert!((value - exact).abs() < 1e-11, "{index}: {value} {exact}");
        }
    }
}
