//! The Hertzian contact of wheel and rail, with separation.

use crate::vtrack::{POISSON, RAILHEAD_RADIUS_M, YOUNG_PA};

/// Newton's steps; three to five are taken, more means not-a-number.
const STEPS_MAX: usize = 60;
/// Relative change of the root at which it has converged: a few roundings.
const TOLERANCE: f64 = 1e-14;

/// Coefficient of `F = C_H delta^1.5` in N/m^1.5: `2 E sqrt(R) / (3 (1 - nu²))` (eq. B.5).
pub(crate) fn coefficient() -> f64 {
    2.0 * YOUNG_PA * RAILHEAD_RADIUS_M.sqrt() / (3.0 * (1.0 - POISSON * POISSON))
}

/// Approach in m under a force in N.
pub(crate) fn approach(force_n: f64) -> f64 {
    (force_n / coefficient()).powf(2.0 / 3.0)
}

/// Force in N between bodies that would overlap by `overlap_m` without it and give way by
/// `compliance` in m/N under it: the root of `a² + compliance C a³ = overlap`, `a² = delta`.
///
/// The left side is convex and grows, so that Newton's method from above cannot fail. None where
/// the overlap is no number.
#[inline]
pub(crate) fn force(overlap_m: f64, compliance: f64) -> Option<f64> {
    if overlap_m <= 0.0 {
        return Some(0.0);
    }
    let cubic = coefficient() * compliance;
    let mut root = overlap_m.sqrt();
    for _ in 0..STEPS_MAX {
        let square = root * root;
        let change =
            (square + cubic * square * root - overlap_m) / (2.0 * root + 3.0 * cubic * square);
        root -= change;
        if change.abs() <= TOLERANCE * root {
            return Some(coefficient() * root * root * root);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_closes_the_overlap_and_is_none_apart() {
        for overlap in [1e-10, 1e-7, 5e-5] {
            let force = force(overlap, 2e-9).unwrap();
            let closed = approach(force) + 2e-9 * force;
            assert!((closed / overlap - 1.0).abs() < 1e-12, "{closed}");
        }
        assert_eq!(force(-1e-9, 1e-9), Some(0.0));
        assert_eq!(force(f64::NAN, 1e-9), None);
    }
}
