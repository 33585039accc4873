//! Small linear systems with an exact time step for forces that are linear over the step.

use nalgebra::DMatrix;

/// `M u'' + C u' + K u = B f` with its step: `z = (u, u')` becomes `E z + S f_0 + T f_1`, where
/// `f_0` and `f_1` are the forces at the step's begin and end.
///
/// The step is the exponential of the system that has force and slope among its states (Van Loan
/// 1978, *IEEE Trans. Autom. Control* 23); no time step is too long for it, only for the forces.
#[derive(Clone, Debug)]
pub(crate) struct LinearSystem {
    states: usize,
    inputs: usize,
    /// `E`, row by row.
    transition: Vec<f64>,
    /// `S` and `T`, row by row.
    from_start: Vec<f64>,
    from_end: Vec<f64>,
    /// Accelerations by state and by force, row by row.
    acceleration_by_state: Vec<f64>,
    acceleration_by_force: Vec<f64>,
}

impl LinearSystem {
    /// The system of these matrices and inputs `B` (a column each) with a step in s.
    pub(crate) fn new(
        mass: &DMatrix<f64>,
        damping: &DMatrix<f64>,
        stiffness: &DMatrix<f64>,
        inputs: &DMatrix<f64>,
        step_s: f64,
    ) -> Self {
        let (dofs, forces) = (mass.nrows(), inputs.ncols());
        let inverse = mass.clone().try_inverse().expect("masses are positive");
        let by_displacement = -(&inverse * stiffness);
        let by_velocity = -(&inverse * damping);
        let by_force = &inverse * inputs;
        let states = 2 * dofs;
        let mut rates = DMatrix::zeros(states + 2 * forces, states + 2 * forces);
        rates.view_mut((0, dofs), (dofs, dofs)).fill_with_identity();
        rates.view_mut((dofs, 0), (dofs, dofs)).copy_from(&by_displacement);
        rates.view_mut((dofs, dofs), (dofs, dofs)).copy_from(&by_velocity);
        rates.view_mut((dofs, states), (dofs, forces)).copy_from(&by_force);
        rates *= step_s;
        rates.view_mut((states, states + forces), (forces, forces)).fill_with_identity();
        let exponential = rates.exp();
        let end = exponential.view((0, states + forces), (states, forces)).into_owned();
        let start = exponential.view((0, states), (states, forces)) - &end;
        let mut by_state = DMatrix::zeros(dofs, states);
        by_state.view_mut((0, 0), (dofs, dofs)).copy_from(&by_displacement);
        by_state.view_mut((0, dofs), (dofs, dofs)).copy_from(&by_velocity);
        Self {
            states,
            inputs: forces,
            transition: rows(&exponential.view((0, 0), (states, states)).into_owned()),
            from_start: rows(&start),
            from_end: rows(&end),
            acceleration_by_state: rows(&by_state),
            acceleration_by_force: rows(&by_force),
        }
    }

    /// One mass on spring and damper, driven by a force on it.
    pub(crate) fn oscillator(mass: f64, damping: f64, stiffness: f64, step_s: f64) -> Self {
        let number = |value| DMatrix::from_element(1, 1, value);
        Self::new(&number(mass), &number(damping), &number(stiffness), &number(1.0), step_s)
    }

    /// Displacements, half of the states.
    pub(crate) fn dofs(&self) -> usize {
        self.states / 2
    }

    /// Forces that drive it.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// The state after a step whose force at the end is zero: `E z + S f_0`, into `free`.
    #[inline]
    pub(crate) fn free(&self, state: &[f64], start: &[f64], free: &mut [f64]) {
        let rows = self.transition.chunks_exact(self.states);
        for ((value, row), inputs) in
            free.iter_mut().zip(rows).zip(self.from_start.chunks_exact(self.inputs))
        {
            *value = dot(row, state) + dot(inputs, start);
        }
    }

    /// Adds what the force `input` at the step's end does to the state.
    #[inline]
    pub(crate) fn push(&self, input: usize, force: f64, state: &mut [f64]) {
        for (value, inputs) in state.iter_mut().zip(self.from_end.chunks_exact(self.inputs)) {
            *value += inputs[input] * force;
        }
    }

    /// What a unit of force `input` at the step's end adds to each state.
    pub(crate) fn gain(&self, input: usize) -> Vec<f64> {
        let mut state = vec![0.0; self.states];
        self.push(input, 1.0, &mut state);
        state
    }

    /// Coefficients `E` and, for the single input, `S` and `T`, of a system of one displacement.
    pub(crate) fn single(&self) -> ([f64; 4], [f64; 2], [f64; 2]) {
        let [e, start, end] = [&self.transition, &self.from_start, &self.from_end];
        ([e[0], e[1], e[2], e[3]], [start[0], start[1]], [end[0], end[1]])
    }

    /// Acceleration of a displacement in a state under forces.
    pub(crate) fn acceleration(&self, dof: usize, state: &[f64], forces: &[f64]) -> f64 {
        let by_state = &self.acceleration_by_state[dof * self.states..][..self.states];
        let by_force = &self.acceleration_by_force[dof * self.inputs..][..self.inputs];
        dot(by_state, state) + dot(by_force, forces)
    }
}

/// Sum of products.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (heads, tails) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = heads.remainder().iter().zip(tails.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in heads.zip(tails) {
        for (lane, (x, y)) in lanes.iter_mut().zip(x.iter().zip(y)) {
            *lane += x * y;
        }
    }
    lanes.iter().sum::<f64>() + rest
}

fn rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damped_oscillator_follows_its_closed_form_with_a_step_of_a_third_of_its_period() {
        let (mass, omega, zeta, step) = (2.0, 300.0_f64, 0.1, 7e-3);
        let (damping, stiffness) = (2.0 * mass * zeta * omega, mass * omega * omega);
        let system = LinearSystem::oscillator(mass, damping, stiffness, step);
        let (mut state, mut free) = (vec![1e-3, 0.0], vec![0.0; 2]);
        for _ in 0..5 {
            system.free(&state, &[0.0], &mut free);
            state.copy_from_slice(&free);
        }
        let (time, damped) = (5.0 * step, omega * (1.0 - zeta * zeta).sqrt());
        let phase = (damped * time).cos() + zeta * omega / damped * (damped * time).sin();
        let exact = 1e-3 * (-zeta * omega * time).exp() * phase;
        assert!((state[0] - exact).abs() < 1e-14, "{} against {exact}", state[0]);
    }

    #[test]
    fn a_free_mass_under_a_growing_force_follows_a_cubic() {
        let system = LinearSystem::oscillator(2.0, 0.0, 0.0, 0.1);
        let mut state = vec![0.0; 2];
        system.free(&[0.0, 1.0], &[3.0], &mut state);
        system.push(0, 9.0, &mut state);
        let [displacement, velocity] = [0.1 + 0.01 * (3.0 / 3.0 + 9.0 / 6.0) / 2.0, 1.0 + 0.3];
        assert!((state[0] - displacement).abs() < 1e-14 && (state[1] - velocity).abs() < 1e-14);
        assert_eq!(system.acceleration(0, &state, &[9.0]), 4.5);
    }
}
