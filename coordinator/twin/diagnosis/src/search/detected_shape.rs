//! A shape of the rail that the passes alone show comes before other physics near it.
//!
//! The blow on a deep shape unloads the wheel, which the linear model does not contain. Its error beside the
//! shape looks like a crack or a missing railpad there.

use super::Fitted;
use super::extent::Extent;
use super::threshold::is_local_shape;
use crate::candidate::Candidate;
use crate::section::Section;

/// Smallest log evidence of the shape relative to that of the better candidate near it.
const SHARE_MIN: f64 = 0.5;

/// Whether a candidate is a shape of the rail at one of these stretches in m, which the passes alone show.
pub(super) fn is_detected(
    candidate: &Candidate,
    section: &Section,
    detected_shapes_m: &[[f64; 2]],
) -> bool {
    let Some(x_m) = candidate.extension.x_m else { return false };
    is_local_shape(candidate)
        && detected_shapes_m.iter().any(|&shape_m| section.are_beside(x_m, shape_m))
}

/// Whether a candidate is a shape of the rail beside one of these stretches in m, but at none of them: the passes
/// show the shape elsewhere.
pub(super) fn is_displaced(
    candidate: &Candidate,
    section: &Section,
    detected_shapes_m: &[[f64; 2]],
) -> bool {
    let is_at = |[from_m, to_m]: [f64; 2]| {
        candidate.extension.x_m.is_some_and(|x_m| x_m[0] <= to_m && from_m <= x_m[1])
    };
    is_detected(candidate, section, detected_shapes_m)
        && !detected_shapes_m.iter().any(|&shape_m| is_at(shape_m))
}

/// Moves a detected shape before better candidates, if the best one is local physics of another kind near it
/// and the shape has half of its evidence.
pub(super) fn detected_shape_first(
    fitted: &mut [Fitted],
    section: &Section,
    detected_shapes_m: &[[f64; 2]],
) {
    let ranked: Vec<(&Candidate, f64)> =
        fitted.iter().map(|fitted| (&fitted.candidate, fitted.log_evidence)).collect();
    if let Some(shape) = shape_near_best(&ranked, section, detected_shapes_m) {
        fitted[..=shape].rotate_right(1);
    }
}

/// Index of the shape that comes before the first candidate; `None` if there is none.
fn shape_near_best(
    ranked: &[(&Candidate, f64)],
    section: &Section,
    detected_shapes_m: &[[f64; 2]],
) -> Option<usize> {
    let (best, evidence) = ranked.first()?;
    if best.is_everywhere() || is_local_shape(best) {
        return None;
    }
    let near = Extent::of(best, section).with_reach();
    ranked.iter().position(|(other, other_evidence)| {
        *other_evidence >= SHARE_MIN * evidence
            && near.meets(Extent::of(other, section))
            && is_detected(other, section, detected_shapes_m)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;

    #[test]
    fn a_detected_shape_comes_before_a_crack_beside_it_and_before_no_other_physics() {
        let (section, all) = section_with_candidates();
        let find = |is_it: &dyn Fn(&Candidate) -> bool| all.iter().find(|it| is_it(it)).unwrap();
        let crack_at = |sleeper: usize| {
            find(&|it| {
                it.kind.physics == "cracked_sleeper"
                    && it.extension.sleepers.as_deref() == Some(&[sleeper])
            })
        };
        let squat_m = section.x_m(10);
        let is_there = |it: &Candidate| it.extension.x_m.is_some_and(|x_m| x_m[0] == squat_m);
        let squat = find(&|it| it.kind.physics == "squat" && is_there(it));
        let shown = [[squat_m - 1e-3, squat_m + 1e-3]];
        let of = |crack: &Candidate, evidence: f64, shown: &[[f64; 2]]| {
            shape_near_best(&[(crack, 50.0), (squat, evidence)], &section, shown)
        };
        assert_eq!(of(crack_at(11), 30.0, &shown), Some(1));
        assert_eq!(of(crack_at(11), 20.0, &shown), None);
        assert_eq!(of(crack_at(11), 30.0, &[]), None);
        assert_eq!(of(crack_at(20), 30.0, &shown), None);
    }

    #[test]
    fn a_shape_a_spacing_beside_the_detected_one_is_displaced() {
        let (section, all) = section_with_candidates();
        let squat_m = section.x_m(10);
        let squat_at = |x_m: f64| {
            all.iter()
                .find(|it| it.kind.physics == "squat" && it.extension.x_m == Some([x_m, x_m]))
                .unwrap()
        };
        let shown = [[squat_m - 1e-3, squat_m + 1e-3]];
        assert!(!is_displaced(squat_at(squat_m), &section, &shown));
        assert!(is_displaced(squat_at(section.x_m(11)), &section, &shown));
        // Two spacings away it is another shape.
        assert!(!is_displaced(squat_at(section.x_m(12)), &section, &shown));
    }
}
