//! A wheel on its way over a track: state, and one time step.
//!
//! This module defines the order of the solution in a step. The module `ports` computes the forces of
//! the ports.

use crate::ports::PortState;
use crate::rail_state::RailState;
use crate::rest::Rest;
use crate::system::dot;
use crate::track::Track;
use crate::vtrack::WHEEL_LOAD_N;

/// Result of a step: acceleration at the sensor in m/s2 and contact force in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Felt {
    pub(crate) acceleration_m_s2: f64,
    pub(crate) force_n: f64,
}

/// Rail, ports and vehicle at one moment.
#[derive(Clone, Debug)]
pub(crate) struct PassState<'a> {
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

impl<'a> PassState<'a> {
    /// At rest under the wheel at `x_m`.
    pub(crate) fn at_rest(track: &'a Track, x_m: f64) -> Self {
        let rest = Rest::under_wheel(track, x_m);
        let ports = PortState::at_rest(track, &rest, x_m);
        let states = track.vehicle.contact.len();
        let wheel_m = rest.wheel_m;
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
        let force_n = self.track.contact.force(overlap_m, compliance)?;
        vehicle.system.push(0, force_n, next);
        self.vehicle.swap(0, 1);
        Some(force_n)
    }
}
