//! The Hertzian contact of wheel and rail, with separation.

use crate::vtrack::{POISSON, RAILHEAD_RADIUS_M, YOUNG_PA};

/// Newton's steps; three to five are taken, more means not-a-number.
const STEPS_MAX: usize = 60;
/// Relative change of the root at which it has converged: a few roundings.
const TOLERANCE: f64 = 1e-14;

/// The contact `F = C_H delta^1.5`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// `C_H` in N/m^1.5.
    coefficient: f64,
}

impl Contact {
    /// `C_H = 2 E sqrt(R) / (3 (1 - nu²))` (eq. B.5), times a factor.
    pub(crate) fn new(factor: f64) -> Self {
        let nominal = 2.0 * YOUNG_PA * RAILHEAD_RADIUS_M.sqrt() / (3.0 * (1.0 - POISSON * POISSON));
        Self { coefficient: factor * nominal }
    }

    /// Approach in m under a force in N.
    pub(crate) fn approach(self, force_n: f64) -> f64 {
        (force_n / self.coefficient).powf(2.0 / 3.0)
    }

    /// Force in N between two bodies: from the root of `a² + compliance C a³ = overlap` with
    /// `a² = delta`. `overlap_m` is the overlap without contact force; `compliance` in m/N is the common
    /// displacement per unit force.
    ///
    /// The left side is convex and grows, so that Newton's method from above cannot fail. None where
    /// the overlap is no number.
    #[inline]
    pub(crate) fn force(self, overlap_m: f64, compliance: f64) -> Option<f64> {
        if overlap_m <= 0.0 {
            return Some(0.0);
        }
        let cubic = self.coefficient * compliance;
        let mut root = overlap_m.sqrt();
        for _ in 0..STEPS_MAX {
            let square = root * root;
            let change =
                (square + cubic * square * root - overlap_m) / (2.0 * root + 3.0 * cubic * square);
            root -= change;
            if change.abs() <= TOLERANCE * root {
                return Some(self.coefficient * root * root * root);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_closes_the_overlap_and_is_none_apart() {
        let contact = Contact::new(1.0);
        for overlap in [1e-10, 1e-7, 5e-5] {
            let force = contact.force(overlap, 2e-9).unwrap();
            let closed = contact.approach(force) + 2e-9 * force;
            assert!((closed / overlap - 1.0).abs() < 1e-12, "{closed}");
        }
        assert_eq!(contact.force(-1e-9, 1e-9), Some(0.0));
        assert_eq!(contact.force(f64::NAN, 1e-9), None);
    }

    #[test]
    fn a_stiffer_contact_bears_more_in_proportion() {
        let [usual, stiff] = [1.0, 1.02].map(|factor| Contact::new(factor).force(5e-5, 0.0));
        assert!((stiff.unwrap() / usual.unwrap() - 1.02).abs() < 1e-12);
    }
}
