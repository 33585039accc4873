//! Forces between points of the track, computed from extrapolated displacements.
//!
//! This module contains nonlinear forces and the forces between neighbouring sleepers. A force follows
//! from displacements that are extrapolated over one step of 10 us, with an error of third order. The
//! matrix of the track is therefore constant.

use crate::scheme::NEW;

/// A point of the track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Point {
    /// A node of the rail.
    Rail(usize),
    /// A body and its coordinate.
    Body(usize, usize),
}

/// Force over the approach of two points.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Law {
    /// Spring and damper: N/m and N s/m.
    Linear([f64; 2]),
    /// Ballast under a gap.
    Void(Void),
    /// A railpad under load, less the one that the matrix has.
    Stiffening(Stiffening),
}

/// Ballast under a gap: it pushes, stiffer as it closes, and some of its stones always rub.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Void {
    /// In m.
    pub(crate) gap_m: f64,
    /// N/m and N s/m of the ballast under full contact.
    pub(crate) ballast: [f64; 2],
    /// Way in m over which the ballast comes to its full stiffness.
    pub(crate) closing_m: f64,
}

/// Share of the ballast's damping that stays while the gap is open.
const OPEN_DAMPING: f64 = 0.2;

impl Void {
    fn force(self, approach: f64, speed: f64) -> f64 {
        let [stiffness, damping] = self.ballast;
        let way = approach - self.gap_m;
        let closing_m = self.closing_m;
        let closed = (way / closing_m).clamp(0.0, 1.0);
        let push = if way < closing_m {
            stiffness * closing_m * closed * closed / 2.0
        } else {
            stiffness * (way - closing_m / 2.0)
        };
        let rub = damping * OPEN_DAMPING * speed;
        // Nothing pulls beyond what rubs.
        (push + damping * (1.0 - OPEN_DAMPING) * closed * speed).max(0.0) + rub
    }
}

/// A railpad of tangent stiffness `k (T / T_0)^gamma`; its damping follows its stiffness.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiffening {
    /// `k` in N/m and its damping in N s/m: what the matrix has.
    pub(crate) pad: [f64; 2],
    /// `gamma`.
    pub(crate) exponent: f64,
    /// `T_0` in N, the toe load included.
    pub(crate) reference_n: f64,
    /// Load without a wheel in N.
    pub(crate) toe_n: f64,
}

impl Stiffening {
    /// Load at a compression, from `dT/dx = k (T / T_0)^gamma`, in N.
    pub(crate) fn load_n(&self, compression: f64) -> f64 {
        let way = self.pad[0] * compression / self.reference_n;
        let rest = 1.0 - self.exponent;
        let toe = self.toe_n / self.reference_n;
        let load = if rest < 1e-6 {
            toe * way.exp()
        } else {
            (toe.powf(rest) + rest * way).max(0.0).powf(1.0 / rest)
        };
        self.reference_n * load
    }

    fn force(&self, compression: f64, speed: f64) -> f64 {
        let load = self.load_n(compression);
        let stiffer = (load / self.reference_n).powf(self.exponent);
        load - self.toe_n - self.pad[0] * compression + (stiffer - 1.0) * self.pad[1] * speed
    }
}

/// A law between two points, or between a point and the ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    /// The one that approaches the other as it moves down.
    pub(crate) from: Point,
    /// The ground, if none.
    pub(crate) to: Option<Point>,
    law: Law,
    /// At the end of the last step, in N.
    last_n: f64,
}

impl Element {
    /// Between these points, without force yet.
    pub(crate) const fn new(from: Point, to: Option<Point>, law: Law) -> Self {
        Self { from, to, law, last_n: 0.0 }
    }

    /// The step's force in N that holds `from` back, where `motion` gives displacement and velocity.
    pub(crate) fn step(&mut self, motion: impl Fn(Point) -> [f64; 2]) -> f64 {
        let [from, from_speed] = motion(self.from);
        let [to, to_speed] = self.to.map_or([0.0; 2], motion);
        let (approach, speed) = (from - to, from_speed - to_speed);
        let force = match self.law {
            Law::Linear([stiffness, damping]) => stiffness * approach + damping * speed,
            Law::Void(void) => void.force(approach, speed),
            Law::Stiffening(pad) => pad.force(approach, speed),
        };
        let mean = NEW * force + (1.0 - NEW) * self.last_n;
        self.last_n = force;
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_void_pushes_only_and_grows_stiffer() {
        let void = Void { gap_m: 1e-4, ballast: [3e6, 200.0], closing_m: 2e-5 };
        assert_eq!(void.force(0.5e-4, 0.0), 0.0);
        assert_eq!(void.force(0.5e-4, 1.0), 40.0);
        assert_eq!(void.force(1.1e-4, -100.0), -4000.0);
        let slope = |x: f64| (void.force(x + 1e-7, 0.0) - void.force(x - 1e-7, 0.0)) / 2e-7;
        assert!((slope(1.1e-4) / 1.5e6 - 1.0).abs() < 1e-6);
        assert!((slope(1.5e-4) / 3e6 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_stiffening_pad_has_its_stiffness_at_the_reference_load() {
        for exponent in [0.4, 1.0] {
            let pad = Stiffening { pad: [1.5e8, 6e3], exponent, reference_n: 2500.0, toe_n: 500.0 };
            assert!((pad.load_n(0.0) - 500.0).abs() < 1e-9);
            let loads =
                (0..4000).map(|step| (f64::from(step) * 1e-8, pad.load_n(f64::from(step) * 1e-8)));
            let (x, _) =
                loads.min_by(|a, b| (a.1 - 2500.0).abs().total_cmp(&(b.1 - 2500.0).abs())).unwrap();
            let slope = (pad.load_n(x + 1e-9) - pad.load_n(x - 1e-9)) / 2e-9;
            assert!((slope / 1.5e8 - 1.0).abs() < 0.01, "{exponent}: {slope}");
        }
    }
}
