//! The forces of all ports during a step: railpads, clamps, joints and absorbers.

use crate::port::{BRANCHES, Behind, Law};
use crate::rail_state::RailState;
use crate::rest::Rest;
use crate::system::dot;
use crate::track::{Track, seat_m};
use crate::vtrack::SPACING_M;

/// Distance in m from the wheel within which the residual flexibility of the modes acts on seats.
const NEAR_M: f64 = 0.25;

/// Forces of the ports, and the motion of the systems behind them.
#[derive(Clone, Debug)]
pub(crate) struct PortState {
    forces: Vec<f64>,
    /// State of the system behind each port, now and at the next step.
    states: Vec<[Vec<f64>; 2]>,
    /// Forces on it at the step's begin: the port's, then the ballast's behind a gap.
    pushes: Vec<Vec<f64>>,
    /// Forces of ballast behind a gap, a step before.
    earlier: Vec<Vec<f64>>,
    /// Forces on the rail seats of linked sleepers, now and a step before.
    links: [Vec<f64>; 2],
    follow: Option<Follow>,
    /// Static deflection in m beyond the modes at each port under a unit contact force.
    lines: Vec<f64>,
    /// What the contact force made of it a step before, in m.
    beside_m: Vec<f64>,
    /// Displacement and velocity of the rail at each port.
    rail: [Vec<f64>; 2],
    asked: Vec<f64>,
    folded: Vec<f64>,
}

/// Compressions, if a law is more than its linear part.
#[derive(Clone, Debug)]
struct Follow {
    /// In m, now and a step before.
    compressions: [Vec<f64>; 2],
    /// Forces of the Maxwell branches in N.
    branches: Vec<[f64; BRANCHES]>,
}

impl PortState {
    /// At rest under the wheel at `x_m`.
    pub(crate) fn at_rest(track: &Track, rest: &Rest, x_m: f64) -> Self {
        let ports = rest.forces.len();
        let states: Vec<[Vec<f64>; 2]> =
            (0..ports).map(|port| resting(track, rest, port)).collect();
        let inputs = |port: usize| {
            let mut forces = vec![0.0; track.behind[port].system().map_or(0, |own| own.0.inputs())];
            if let Some(first) = forces.first_mut() {
                *first = rest.forces[port];
            }
            forces
        };
        let pushes: Vec<Vec<f64>> = (0..ports).map(inputs).collect();
        let follows = track.laws.iter().any(Law::has_memory);
        let mut state = Self {
            forces: rest.forces.clone(),
            earlier: pushes.iter().map(|forces| vec![0.0; forces.len()]).collect(),
            pushes,
            states,
            links: [vec![0.0; track.seats()], vec![0.0; track.seats()]],
            follow: follows.then(|| Follow {
                compressions: [rest.compressions.clone(), rest.compressions.clone()],
                branches: vec![[0.0; BRANCHES]; ports],
            }),
            lines: vec![0.0; ports],
            beside_m: vec![0.0; ports],
            rail: [vec![0.0; ports], vec![0.0; ports]],
            asked: vec![0.0; ports],
            folded: vec![0.0; track.seats()],
        };
        state.find_lines(track, x_m);
        state.remember_lines(crate::vtrack::WHEEL_LOAD_N);
        state.find_links(track);
        let (first, second) = state.links.split_at_mut(1);
        second[0].clone_from(&first[0]);
        state.find_gaps(track);
        state.earlier.clone_from(&state.pushes);
        state
    }

    /// Forces of all ports at the step's end, from their free motion under the foreseen contact
    /// force with the wheel at `x_m`.
    #[inline]
    pub(crate) fn share(&mut self, track: &Track, rail: &RailState, x_m: f64, foreseen_n: f64) {
        self.lift_off(track);
        self.find_lines(track, x_m);
        for (amplitudes, places) in rail.foreseen.iter().zip(&mut self.rail) {
            let (seats, extras) = places.split_at_mut(track.seats());
            track.transform.at_seats(amplitudes, &mut self.folded, seats);
            for (value, extra) in extras.iter_mut().zip(&track.extras) {
                *value = dot(&extra.shape, amplitudes);
            }
        }
        for port in 0..self.forces.len() {
            self.asked[port] = self.ask(track, port, foreseen_n);
        }
        for (force, row) in self.forces.iter_mut().zip(track.sharing.chunks_exact(self.asked.len()))
        {
            *force = dot(row, &self.asked);
        }
    }

    /// Free force of each port: with zero force of all ports at the end of the step.
    #[inline]
    fn ask(&self, track: &Track, port: usize, foreseen_n: f64) -> f64 {
        let law = &track.laws[port];
        let beside_m = self.lines[port] * foreseen_n;
        let mut compression = self.rail[0][port] + beside_m;
        let changed_m = beside_m - self.beside_m[port] + law.residual * self.forces[port];
        let mut rate = self.rail[1][port] + changed_m / track.step_s;
        if let Some((system, shape)) = track.behind[port].system() {
            let (displacements, velocities) = self.states[port][1].split_at(system.dofs());
            for ((shape, displacement), velocity) in shape.iter().zip(displacements).zip(velocities)
            {
                compression -= shape * displacement;
                rate -= shape * velocity;
            }
        }
        let mut force = law.stiffness * compression + law.damping * rate;
        if let Some(follow) = &self.follow {
            let [now, before] = [&follow.compressions[0], &follow.compressions[1]];
            for (branch, held_n) in law.branches.iter().zip(&follow.branches[port]) {
                force += branch.gain * (compression - now[port]) + branch.kept * held_n;
            }
            if let Some(power) = law.power {
                let next = 2.0 * now[port] - before[port];
                force += power.force(next) - law.stiffness * next;
            }
        }
        force
    }

    /// What is behind the ports moves on without their forces at the step's end.
    #[inline]
    fn lift_off(&mut self, track: &Track) {
        for (port, behind) in track.behind.iter().enumerate() {
            let Some((system, _)) = behind.system() else { continue };
            let [state, next] = &mut self.states[port];
            system.free(state, &self.pushes[port], next);
            for input in 1..self.pushes[port].len() {
                let foreseen = 2.0 * self.pushes[port][input] - self.earlier[port][input];
                system.push(input, foreseen, next);
            }
        }
        for &([a, b], _) in &track.links {
            for sleeper in [a, b] {
                let foreseen = 2.0 * self.links[0][sleeper] - self.links[1][sleeper];
                if let Some((system, _)) = track.behind[sleeper].system() {
                    system.push(0, foreseen, &mut self.states[sleeper][1]);
                }
            }
        }
    }

    /// The ports' forces on the modes, in place of whatever stands there.
    #[inline]
    pub(crate) fn push(&mut self, track: &Track, forces: &mut [f64]) {
        forces.fill(0.0);
        let (seats, extras) = self.forces.split_at(track.seats());
        track.transform.push(seats, &mut self.folded, forces);
        for (port, extra) in extras.iter().zip(&track.extras) {
            for (force, shape) in forces.iter_mut().zip(&extra.shape) {
                *force -= port * shape;
            }
        }
    }

    /// Deflection in m under the wheel that the ports' forces add beyond the modes; up.
    #[inline]
    pub(crate) fn beside_wheel(&self) -> f64 {
        dot(&self.lines, &self.forces)
    }

    /// Updates the systems behind the ports under the forces of the ports. The rail has already been
    /// updated.
    #[inline]
    pub(crate) fn finish(&mut self, track: &Track, rail: &RailState, force_n: f64) {
        for (port, behind) in track.behind.iter().enumerate() {
            let Some((system, _)) = behind.system() else { continue };
            let force = self.forces[port];
            let [state, next] = &mut self.states[port];
            system.push(0, force, next);
            std::mem::swap(state, next);
            self.pushes[port][0] = force;
        }
        self.remember_lines(force_n);
        if self.follow.is_some() {
            self.find_compressions(track, rail);
        }
        if !track.links.is_empty() {
            self.links.swap(0, 1);
            self.find_links(track);
        }
        self.find_gaps(track);
    }

    /// The static lines at the wheel's place, of the ports that are near.
    #[inline]
    fn find_lines(&mut self, track: &Track, x_m: f64) {
        self.lines.fill(0.0);
        let first = ((x_m - NEAR_M) / SPACING_M).ceil() as usize;
        for seat in first.max(1) - 1..track.seats() {
            if seat_m(seat) > x_m + NEAR_M {
                break;
            }
            self.lines[seat] = track.beside(seat, x_m);
        }
        for port in track.seats()..self.lines.len() {
            self.lines[port] = track.beside(port, x_m);
        }
    }

    #[inline]
    fn remember_lines(&mut self, force_n: f64) {
        for (beside_m, line) in self.beside_m.iter_mut().zip(&self.lines) {
            *beside_m = line * force_n;
        }
    }

    /// Forces of the springs between sleepers.
    fn find_links(&mut self, track: &Track) {
        self.links[0].fill(0.0);
        for &([a, b], stiffness) in &track.links {
            let force = stiffness * (self.seat_m(track, b) - self.seat_m(track, a));
            self.links[0][a] += force;
            self.links[0][b] -= force;
        }
        for &(pair, _) in &track.links {
            for sleeper in pair {
                self.pushes[sleeper][0] = self.forces[sleeper] + self.links[0][sleeper];
            }
        }
    }

    /// Displacement in m of a sleeper's rail seat.
    fn seat_m(&self, track: &Track, sleeper: usize) -> f64 {
        let shape = track.behind[sleeper].system().map_or(&[][..], |own| own.1);
        shape.iter().zip(&self.states[sleeper][0]).map(|(a, b)| a * b).sum()
    }

    /// Forces of ballast behind gaps.
    fn find_gaps(&mut self, track: &Track) {
        for (port, behind) in track.behind.iter().enumerate() {
            let Behind::Sleeper(sleeper) = behind else { continue };
            let Some(gap) = &sleeper.gap else { continue };
            let [now, before] = [&mut self.pushes[port], &mut self.earlier[port]];
            before[1..].copy_from_slice(&now[1..]);
            now[1..].fill(0.0);
            gap.push(&self.states[port][0], &mut now[1..]);
        }
    }

    /// Compressions of the railpads after the step, and their branches' forces.
    fn find_compressions(&mut self, track: &Track, rail: &RailState) {
        let seats = track.seats();
        track.transform.at_seats(&rail.amplitudes, &mut self.folded, &mut self.rail[0][..seats]);
        let Some(follow) = &mut self.follow else { return };
        follow.compressions.swap(0, 1);
        for port in 0..seats {
            let shape = track.behind[port].system().map_or(&[][..], |own| own.1);
            let behind: f64 = shape.iter().zip(&self.states[port][0]).map(|(a, b)| a * b).sum();
            let law = &track.laws[port];
            let given = law.residual * self.forces[port];
            let now = self.rail[0][port] - behind + self.beside_m[port] - given;
            let change = now - follow.compressions[1][port];
            for (branch, held_n) in law.branches.iter().zip(&mut follow.branches[port]) {
                *held_n = branch.kept * *held_n + branch.gain * change;
            }
            follow.compressions[0][port] = now;
        }
    }
}

/// What is behind a port at rest: sleepers pressed down, masses where the rail holds them.
fn resting(track: &Track, rest: &Rest, port: usize) -> [Vec<f64>; 2] {
    let mut state = match &track.behind[port] {
        Behind::Nothing => Vec::new(),
        Behind::Sleeper(sleeper) => {
            sleeper.pressed.iter().map(|displacement| displacement * rest.forces[port]).collect()
        }
        Behind::Mass(_) => vec![rest.compressions[port]],
    };
    state.resize(2 * state.len(), 0.0);
    [state.clone(), state]
}
