//! A port of the rail: its place, its force law, and the system behind it.
//!
//! This module contains railpads, clamps, softened joints and absorbers as ports. The modules `track`
//! and `pass_state` solve for their forces.

use crate::rail::{self, RailModes};
use crate::sleeper::Sleeper;
use crate::system::LinearSystem;

/// Distance in m of the knots of a port's static deflection line, and how far it reaches.
const KNOT_M: f64 = 5e-4;
const REACH_M: f64 = 0.25;
/// Terms of its sum over kept modes.
const TERMS: usize = 30;

/// Most branches of a port.
pub(crate) const BRANCHES: usize = 3;

/// Force of a port by its compression `y`: `k y + c y'`, more with branches or a load's law.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Law {
    /// `k` in N/m and `c` in N s/m, for a rotation N m/rad and N m s/rad.
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    /// Static flexibility in m/N of rail and sleeper at the port that their modes leave out.
    pub(crate) residual: f64,
    /// Springs and dampers in series beside it: two of a hidden effect, one of the nuisances.
    pub(crate) branches: [Branch; BRANCHES],
    /// A stiffness that grows with the load.
    pub(crate) power: Option<PowerLaw>,
    /// Whether it carries nothing at rest.
    pub(crate) floating: bool,
}

/// A Maxwell branch of stiffness `k_1` and relaxation time `tau`, exact where `y` is linear over a
/// step `h`: `s_1 = e s_0 + g (y_1 - y_0)`, `e = exp(-h / tau)`, `g = k_1 tau (1 - e) / h`.
/// The default is none.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Branch {
    pub(crate) stiffness: f64,
    pub(crate) relaxation_time_s: f64,
    pub(crate) kept: f64,
    pub(crate) gain: f64,
}

impl Branch {
    pub(crate) fn new(stiffness: f64, relaxation_time_s: f64, step_s: f64) -> Self {
        let kept = (-step_s / relaxation_time_s).exp();
        let gain = stiffness * relaxation_time_s * (1.0 - kept) / step_s;
        Self { stiffness, relaxation_time_s, kept, gain }
    }
}

impl Law {
    /// Whether its force follows from more than compression and rate at the moment.
    pub(crate) fn has_memory(&self) -> bool {
        self.power.is_some() || self.gain() > 0.0
    }

    /// Contribution of all branches to the stiffness within a step, in N/m.
    pub(crate) fn gain(&self) -> f64 {
        self.branches.iter().map(|branch| branch.gain).sum()
    }
}

/// `dT/dy = k (T / T_0)^gamma` with `T = T_toe` at `y = 0`, and never in tension.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PowerLaw {
    pub(crate) stiffness: f64,
    pub(crate) exponent: f64,
    /// `T_toe` and `T_0` in N.
    pub(crate) toe_n: f64,
    pub(crate) nominal_n: f64,
}

impl PowerLaw {
    /// Force in N above that at rest: the law integrated, `(T / T_0)^(1 - gamma)` is linear in `y`.
    pub(crate) fn force(&self, compression_m: f64) -> f64 {
        let rest = 1.0 - self.exponent;
        let slope = rest * self.stiffness / self.nominal_n;
        let root = (self.toe_n / self.nominal_n).powf(rest) + slope * compression_m;
        self.nominal_n * root.max(0.0).powf(1.0 / rest) - self.toe_n
    }
}

/// System behind a port, driven by the force of the port.
#[derive(Clone, Debug)]
pub(crate) enum Behind {
    /// Nothing: the ground, or the rail itself.
    Nothing,
    /// A sleeper.
    Sleeper(Box<Sleeper>),
    /// A mass.
    Mass(LinearSystem),
}

impl Behind {
    /// The system, and its displacement at the port by degree of freedom.
    pub(crate) fn system(&self) -> Option<(&LinearSystem, &[f64])> {
        match self {
            Self::Nothing => None,
            Self::Sleeper(sleeper) => Some((&sleeper.system, &sleeper.seat)),
            Self::Mass(mass) => Some((mass, &[1.0])),
        }
    }

    /// Static flexibility in m/N of the system behind the port.
    pub(crate) fn flexibility(&self) -> f64 {
        match self {
            Self::Sleeper(sleeper) => sleeper.flexibility,
            Self::Nothing | Self::Mass(_) => 0.0,
        }
    }
}

/// A port that is no seat.
#[derive(Clone, Debug)]
pub(crate) struct Extra {
    /// Displacement of the port by mode.
    pub(crate) shape: Vec<f64>,
    pub(crate) law: Law,
    pub(crate) behind: Behind,
    pub(crate) line: Line,
}

/// Static deflection of the rail, in m, along it under a unit force of a port: what the modes
/// leave out.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    from_m: f64,
    values: Vec<f64>,
}

impl Line {
    /// Deflection in m per unit force at a place in m.
    #[inline]
    pub(crate) fn at(&self, x_m: f64) -> f64 {
        let place = (x_m - self.from_m) / KNOT_M;
        if place < 0.0 || place as usize + 1 >= self.values.len() {
            return 0.0;
        }
        let knot = place as usize;
        let share = place - knot as f64;
        (1.0 - share) * self.values[knot] + share * self.values[knot + 1]
    }

    /// The line of a moment-like port at `x_m` that acts on the rotation `cos k x` of wave number
    /// `k` by `load(k)`: a wave deflects by `load / (E I k³)` under it.
    fn of_moment(rail: &RailModes, length_m: f64, x_m: f64, load: impl Fn(f64) -> f64) -> Self {
        let kept = rail.count();
        let first = std::f64::consts::PI / length_m;
        let waves: Vec<(f64, f64)> = (kept + 1..TERMS * kept)
            .map(|n| {
                let k = n as f64 * first;
                (k, 2.0 / length_m * load(k) / (rail::cross_section().bending * k.powi(3)))
            })
            .collect();
        let from_m = x_m - REACH_M;
        let values = (0..=(2.0 * REACH_M / KNOT_M) as usize).map(|knot| {
            let place = from_m + knot as f64 * KNOT_M;
            waves.iter().map(|(k, amplitude)| amplitude * (k * place).sin()).sum()
        });
        Self { from_m, values: values.collect() }
    }

    /// The line of a vertical force at `x_m`.
    fn of_force(rail: &RailModes, x_m: f64) -> Self {
        let from_m = x_m - REACH_M;
        let place = |knot: usize| from_m + knot as f64 * KNOT_M;
        let knots = 0..=(2.0 * REACH_M / KNOT_M) as usize;
        let values = knots.map(|knot| rail.residual_flexibility(place(knot) - x_m)).collect();
        Self { from_m, values }
    }
}

impl Extra {
    /// A spring against rotation of the rail at `x_m`.
    pub(crate) fn clamp(rail: &RailModes, length_m: f64, x_m: f64, stiffness: f64) -> Self {
        Self {
            shape: rail.rotations_at(x_m),
            law: Law { stiffness, ..Law::default() },
            behind: Behind::Nothing,
            line: Line::of_moment(rail, length_m, x_m, |k| (k * x_m).cos()),
        }
    }

    /// Rail that keeps a share `factor` of its bending stiffness over `softened_m` around `x_m`.
    ///
    /// The softened part bends by `(1 / factor - 1) M / E I` more: an initial curvature, as if a
    /// pair of moments `P = E I` times it opened the beam. Its force follows the mean curvature
    /// `y` of the modes, `P = c E I y / (1 + c s)` with `c = 1 / factor - 1`, where `s` is the part
    /// of the initial curvature that the modes show; all modes together show all of it.
    pub(crate) fn joint(
        rail: &RailModes,
        length_m: f64,
        x_m: f64,
        softened_m: f64,
        factor: f64,
    ) -> Self {
        let shape = rail.curvatures(x_m, softened_m);
        let bending = rail::cross_section().bending;
        // A pair of moments of unit size acts on the mean curvature times the length.
        let shown = bending * softened_m * rail.flexibility(&shape, &shape);
        let loss = 1.0 / factor - 1.0;
        let law = Law {
            stiffness: -loss * bending * softened_m / (1.0 + loss * shown),
            ..Law::default()
        };
        let wave = |k: f64| {
            let half = 0.5 * k * softened_m;
            -k * (k * x_m).sin() * half.sin() / half
        };
        let line = Line::of_moment(rail, length_m, x_m, wave);
        Self { shape, law, behind: Behind::Nothing, line }
    }

    /// A mass on a damped spring under the rail at `x_m`, tuned to a frequency in rad/s.
    pub(crate) fn absorber(
        rail: &RailModes,
        x_m: f64,
        mass: f64,
        omega: f64,
        damping_ratio: f64,
        step_s: f64,
    ) -> Self {
        let law = Law {
            stiffness: mass * omega * omega,
            damping: 2.0 * damping_ratio * mass * omega,
            residual: rail.residual_flexibility(0.0),
            floating: true,
            ..Law::default()
        };
        Self {
            shape: rail.deflections(x_m),
            law,
            behind: Behind::Mass(LinearSystem::oscillator(mass, 0.0, 0.0, step_s)),
            line: Line::of_force(rail, x_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_branch_follows_a_ramp_of_compression_exactly() {
        let (stiffness, tau, step) = (2e8, 1e-4, 5e-6);
        let branch = Branch::new(stiffness, tau, step);
        let (mut force, rate) = (0.0, 3.0);
        for _ in 0..40 {
            force = branch.kept * force + branch.gain * rate * step;
        }
        let exact = stiffness * tau * rate * (1.0 - (-40.0 * step / tau).exp());
        assert!((force / exact - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_stiffness_of_a_loaded_railpad_grows_with_the_power_of_its_load() {
        let law = PowerLaw { stiffness: 1e8, exponent: 0.5, toe_n: 400.0, nominal_n: 1400.0 };
        for compression in [0.0, 5e-6, 2e-5] {
            let slope = (law.force(compression + 1e-9) - law.force(compression - 1e-9)) / 2e-9;
            let load = law.force(compression) + law.toe_n;
            let exact = 1e8 * (load / 1400.0_f64).sqrt();
            assert!((slope / exact - 1.0).abs() < 1e-6, "{compression}: {slope} {exact}");
        }
        assert_eq!(law.force(-1.0), -400.0);
    }

    #[test]
    fn a_softened_length_sags_by_the_curvature_that_it_adds() {
        // A long simply supported beam, force at midspan, joint there: the sag grows by
        // (1/beta - 1) / (E I) times the integral of the squared moment of a unit force.
        let (length, softened, factor) = (2.0, 0.025, 0.2);
        let bending = rail::cross_section().bending;
        let rail = RailModes::new(length, 400);
        let joint = Extra::joint(&rail, length, 1.0, softened, factor);
        let middle = rail.deflections(1.0);
        let line = joint.line.at(1.0);
        let compression = rail.flexibility(&joint.shape, &middle) + line;
        let shown = rail.flexibility(&joint.shape, &joint.shape);
        let pair = joint.law.stiffness * compression / (1.0 + joint.law.stiffness * shown);
        let sag = -pair * (rail.flexibility(&middle, &joint.shape) + line);
        let moment = 0.25 * length;
        let exact = (1.0 / factor - 1.0) * softened * moment * moment / bending;
        // The moment falls by an eightieth over the joint; the waves beyond the modes are static.
        assert!((sag / exact - 1.0).abs() < 0.03, "{sag} {exact}");
    }
}
