//! The vehicle on the rail: the wheel, and the parts connected to it.

use crate::hidden::Hidden;
use crate::system::LinearSystem;
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Split of the two frequencies of a mode pair of the wheel's disc, up and down from its middle.
const PAIR_SPLIT: f64 = 0.04;

/// The unsprung masses, about their static equilibrium, driven by what the contact force is above
/// the static load.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    pub(crate) system: LinearSystem,
    /// Displacement of the contact point by degree of freedom; velocities follow as zeros.
    pub(crate) contact: Vec<f64>,
    /// Degree of freedom of the sensor.
    pub(crate) sensor: usize,
}

/// An oscillator in series with the contact: modal mass, damping and stiffness.
struct Series {
    mass: f64,
    damping: f64,
    stiffness: f64,
}

impl Series {
    fn new(mass: f64, frequency_hz: f64, damping_ratio: f64) -> Self {
        let omega = TAU * frequency_hz;
        Self { mass, damping: 2.0 * damping_ratio * mass * omega, stiffness: mass * omega * omega }
    }
}

impl Vehicle {
    /// A wheel with this mass in kg and the hidden effects of the vehicle.
    pub(crate) fn new(left_out: &[Hidden], wheel_kg: f64, step_s: f64) -> Self {
        let series: Vec<Series> = left_out.iter().flat_map(series_of).collect();
        let axle_box = left_out.iter().find_map(|hidden| match hidden {
            Hidden::FlexibleAxleBox { mass_kg, stiffness_n_per_m, damping_n_s_per_m } => {
                Some([*mass_kg, *damping_n_s_per_m, *stiffness_n_per_m])
            }
            _ => None,
        });
        let dofs = 1 + series.len() + usize::from(axle_box.is_some());
        let [mut mass, mut damping, mut stiffness] = [0; 3].map(|_| DMatrix::zeros(dofs, dofs));
        let mut inputs = DMatrix::zeros(dofs, 1);
        mass[(0, 0)] = wheel_kg;
        inputs[(0, 0)] = -1.0;
        let mut contact = vec![0.0; dofs];
        contact[0] = 1.0;
        for (dof, part) in (1..).zip(&series) {
            mass[(dof, dof)] = part.mass;
            damping[(dof, dof)] = part.damping;
            stiffness[(dof, dof)] = part.stiffness;
            inputs[(dof, 0)] = 1.0;
            contact[dof] = -1.0;
        }
        let mut sensor = 0;
        if let Some([box_kg, box_damping, box_stiffness]) = axle_box {
            sensor = dofs - 1;
            mass[(0, 0)] -= box_kg;
            mass[(sensor, sensor)] = box_kg;
            for (matrix, value) in [(&mut damping, box_damping), (&mut stiffness, box_stiffness)] {
                for (row, column, sign) in
                    [(0, 0, 1.0), (sensor, sensor, 1.0), (0, sensor, -1.0), (sensor, 0, -1.0)]
                {
                    matrix[(row, column)] += sign * value;
                }
            }
        }
        contact.resize(2 * dofs, 0.0);
        let system = LinearSystem::new(&mass, &damping, &stiffness, &inputs, step_s);
        Self { system, contact, sensor }
    }
}

/// What an effect puts between wheel and contact.
fn series_of(hidden: &Hidden) -> Vec<Series> {
    match hidden {
        Hidden::RailCrossSection { frequency_hz, stiffness_n_per_m, loss_factor } => {
            let mass = stiffness_n_per_m / (TAU * frequency_hz).powi(2);
            vec![Series::new(mass, *frequency_hz, 0.5 * loss_factor)]
        }
        // Each of the pair gives way by half: together they weigh what one mode would.
        Hidden::WheelMode { frequency_hz, mass_kg, damping_ratio } => [-PAIR_SPLIT, PAIR_SPLIT]
            .map(|split| Series::new(2.0 * mass_kg, frequency_hz * (1.0 + split), *damping_ratio))
            .into(),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::dot;
    use crate::vtrack::WHEEL_MASS_KG;

    const STEP_S: f64 = 5e-6;

    /// Amplitude of contact and sensor, over force, by driving the vehicle for long enough.
    fn driven(left_out: &[Hidden], frequency_hz: f64) -> [f64; 2] {
        let vehicle = Vehicle::new(left_out, WHEEL_MASS_KG, STEP_S);
        let mut state = vec![0.0; vehicle.contact.len()];
        let mut free = state.clone();
        let (omega, steps) = (TAU * frequency_hz, 40_000);
        let force = |step: usize| (omega * STEP_S * step as f64).sin();
        // A free body drifts at a constant speed: accelerations know nothing of it.
        let mut sums = [[0.0; 2]; 2];
        let mut before = [0.0; 3];
        for step in 0..steps {
            vehicle.system.free(&state, &[force(step)], &mut free);
            vehicle.system.push(0, force(step + 1), &mut free);
            std::mem::swap(&mut state, &mut free);
            let displacement = dot(&vehicle.contact, &state);
            before = [before[1], before[2], displacement];
            if step > steps / 2 {
                let bend = (before[0] - 2.0 * before[1] + before[2]) / STEP_S.powi(2);
                let felt = vehicle.system.acceleration(vehicle.sensor, &state, &[force(step + 1)]);
                let time = omega * STEP_S * step as f64;
                for (sum, value) in sums.iter_mut().zip([bend, felt]) {
                    sum[0] += value * time.sin();
                    sum[1] += value * time.cos();
                }
            }
        }
        let half = 0.25 * steps as f64;
        sums.map(|sum| sum[0].hypot(sum[1]) / half / (omega * omega))
    }

    #[test]
    fn a_rigid_wheel_is_a_mass() {
        let [contact, sensor] = driven(&[], 1000.0);
        let exact = 1.0 / (WHEEL_MASS_KG * (TAU * 1000.0_f64).powi(2));
        // Second differences and the sum's unfinished period: half a per mille.
        assert!((contact / exact - 1.0).abs() < 2e-3 && (sensor / exact - 1.0).abs() < 2e-3);
    }

    #[test]
    fn an_axle_box_on_a_spring_resonates_against_the_wheel() {
        let (box_kg, stiffness) = (10.0, 4e8);
        let hidden = Hidden::FlexibleAxleBox {
            mass_kg: box_kg,
            stiffness_n_per_m: stiffness,
            damping_n_s_per_m: 3e3,
        };
        let frequency_hz = 1000.0;
        let [_, sensor] = driven(&[hidden], frequency_hz);
        // Undamped two masses: u_2 / F = k / (w² (w² m_1 m_2 - k (m_1 + m_2))).
        let square = (TAU * frequency_hz).powi(2);
        let wheel_kg = WHEEL_MASS_KG - box_kg;
        let exact =
            stiffness / (square * (square * wheel_kg * box_kg - stiffness * WHEEL_MASS_KG)).abs();
        // The damper takes a hundredth where the frequency is some way below resonance, 1140 Hz.
        assert!((sensor / exact - 1.0).abs() < 0.03, "{sensor} {exact}");
    }

    #[test]
    fn the_cross_section_and_the_disc_give_way_in_series_with_the_wheel() {
        let section = Hidden::RailCrossSection {
            frequency_hz: 8000.0,
            stiffness_n_per_m: 1e9,
            loss_factor: 0.05,
        };
        let [contact, sensor] = driven(&[section], 2000.0);
        let wheel = 1.0 / (WHEEL_MASS_KG * (TAU * 2000.0_f64).powi(2));
        let local = 1.0 / (1e9 * (1.0 - 0.25_f64.powi(2)));
        assert!((contact / (wheel - local).abs() - 1.0).abs() < 0.01, "{contact}");
        assert!((sensor / wheel - 1.0).abs() < 0.01, "{sensor}");
        let disc = Hidden::WheelMode { frequency_hz: 2000.0, mass_kg: 5.0, damping_ratio: 0.01 };
        let [contact, _] = driven(&[disc], 1000.0);
        let mode = |f: f64| 1.0 / (10.0 * TAU * TAU * (f * f - 1e6));
        let exact = 1.0 / (WHEEL_MASS_KG * TAU * TAU * 1e6) - mode(1920.0) - mode(2080.0);
        assert!((contact / exact.abs() - 1.0).abs() < 0.01, "{contact} {exact}");
    }
}
