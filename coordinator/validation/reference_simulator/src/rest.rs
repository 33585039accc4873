//! Static equilibrium of the track under the standing wheel: the initial state of a pass.

use crate::track::Track;
use crate::vtrack::WHEEL_LOAD_N;
use nalgebra::{DMatrix, DVector};

/// Times that railpads whose stiffness follows their load are worked out anew; each gains a digit.
const TURNS: usize = 30;

/// Rest under the wheel at a place.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    /// Amplitude of every mode in m, and the force on it in N.
    pub(crate) amplitudes: Vec<f64>,
    pub(crate) loads: Vec<f64>,
    /// Force of every port in N and its compression in m.
    pub(crate) forces: Vec<f64>,
    pub(crate) compressions: Vec<f64>,
    /// Height of the wheel's centre in m.
    pub(crate) wheel_m: f64,
}

impl Rest {
    /// The track under a wheel that stands at `x_m`.
    pub(crate) fn under_wheel(track: &Track, x_m: f64) -> Self {
        let shapes = track.shapes();
        let ports = shapes.len();
        let wheel = track.rail.deflections(x_m);
        let beside: Vec<f64> = (0..ports).map(|port| track.beside(port, x_m)).collect();
        let rail = &track.rail;
        let mutual =
            DMatrix::from_fn(ports, ports, |a, b| rail.flexibility(&shapes[a], &shapes[b]));
        let under_wheel = DVector::from_fn(ports, |port, _| {
            WHEEL_LOAD_N * (rail.flexibility(&shapes[port], &wheel) + beside[port])
        });
        let flexibilities = DMatrix::from_diagonal(&DVector::from_fn(ports, |port, _| {
            track.laws[port].residual + track.behind[port].flexibility()
        })) + mutual;
        let (forces, compressions) = shared(track, &flexibilities, &under_wheel);
        let loads: Vec<f64> = (0..wheel.len())
            .map(|mode| {
                let ports: f64 = shapes.iter().zip(&forces).map(|(shape, p)| shape[mode] * p).sum();
                WHEEL_LOAD_N * wheel[mode] - ports
            })
            .collect();
        let stiffnesses = rail.masses.iter().zip(&rail.frequencies).map(|(m, w)| m * w * w);
        let amplitudes: Vec<f64> = loads.iter().zip(stiffnesses).map(|(f, k)| f / k).collect();
        let modes: f64 = wheel.iter().zip(&amplitudes).map(|(shape, q)| shape * q).sum();
        let others: f64 = beside.iter().zip(&forces).map(|(line, p)| line * p).sum();
        let contact_m = modes + WHEEL_LOAD_N * rail.residual_flexibility(0.0) - others;
        let wheel_m = contact_m + track.contact.approach(WHEEL_LOAD_N);
        Self { amplitudes, loads, forces, compressions, wheel_m }
    }
}

/// Forces of the ports and their compressions, residual flexibilities included.
fn shared(
    track: &Track,
    flexibilities: &DMatrix<f64>,
    under_wheel: &DVector<f64>,
) -> (Vec<f64>, Vec<f64>) {
    let ports = under_wheel.len();
    let mut secants: Vec<f64> =
        track.laws.iter().map(|law| if law.floating { 0.0 } else { law.stiffness }).collect();
    let nonlinear = track.laws.iter().any(|law| law.power.is_some());
    let mut compressions = DVector::zeros(ports);
    for _ in 0..if nonlinear { TURNS } else { 1 } {
        let stiffness = DMatrix::from_diagonal(&DVector::from_vec(secants.clone()));
        let matrix = DMatrix::identity(ports, ports) + flexibilities * stiffness;
        compressions = matrix.lu().solve(under_wheel).expect("the track carries its wheel");
        for (port, law) in track.laws.iter().enumerate() {
            let y: f64 = compressions[port];
            if let Some(power) = law.power.filter(|_| y != 0.0) {
                secants[port] = 0.5 * (secants[port] + power.force(y) / y);
            }
        }
    }
    let forces = compressions.iter().zip(&secants).map(|(y, k)| k * y).collect();
    (forces, compressions.as_slice().to_vec())
}
