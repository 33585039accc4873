//! State of the modes of the rail, and its update in a time step.

use crate::rest::Rest;
use crate::track::Track;

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

impl RailState {
    pub(crate) fn at_rest(rest: Rest) -> Self {
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
    pub(crate) fn foresee(&mut self, track: &Track, x_m: f64, foreseen_n: f64) {
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
    pub(crate) fn under_wheel(&self, track: &Track) -> (f64, f64) {
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
    pub(crate) fn finish(&mut self, track: &Track, force_n: f64) {
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
