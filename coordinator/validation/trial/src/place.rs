//! Places of hidden effects, and the sleepers next to them.

use crate::known::is_artefact;
use tracktwin_diagnosis::Hypothesis;
use tracktwin_reference_simulator::{Hidden, Scene};

/// Largest length of a local effect in sleeper spacings: three, and the rounding of places.
const LOCAL_SPACINGS: f64 = 3.01;

/// Whether a hypothesis has the place of an effect to within one sleeper spacing. If one of them is local, the other
/// may be longer by three spacings, and not be everywhere.
pub(crate) fn is_placed(hidden: &Hidden, hypothesis: &Hypothesis, spacing_m: f64) -> bool {
    let said = hypothesis.location.as_ref().map(|location| location.x_m);
    let (hidden, said) = match (hidden.place(spacing_m), said) {
        (Some(hidden), Some(said)) => (hidden, said),
        (Some(one), None) | (None, Some(one)) => return !is_local(one, spacing_m),
        (None, None) => return true,
    };
    let longer_m = (hidden[1] - hidden[0]) - (said[1] - said[0]);
    let is_any_local = is_local(hidden, spacing_m) || is_local(said, spacing_m);
    let is_alike = !is_any_local || longer_m.abs() <= LOCAL_SPACINGS * spacing_m;
    let reach_m = 1.01 * spacing_m;
    is_alike && hidden[0] - reach_m <= said[1] && said[0] <= hidden[1] + reach_m
}

/// The place of a local effect in m. `None` if the effect acts everywhere or on a longer stretch.
pub(crate) fn local(hidden: &Hidden, spacing_m: f64) -> Option<[f64; 2]> {
    hidden.place(spacing_m).filter(|place| is_local(*place, spacing_m))
}

/// The place of a local hypothesis in m. `None` if it holds everywhere or on a longer stretch.
pub(crate) fn local_location(hypothesis: &Hypothesis, spacing_m: f64) -> Option<[f64; 2]> {
    let location = hypothesis.location.as_ref().map(|location| location.x_m);
    location.filter(|place| is_local(*place, spacing_m))
}

fn is_local([from_m, to_m]: [f64; 2], spacing_m: f64) -> bool {
    to_m - from_m <= LOCAL_SPACINGS * spacing_m
}

/// Whether a place is next to a hidden effect. True for all places if an effect acts everywhere or
/// nothing is hidden.
pub(crate) fn near(scene: &Scene, x_m: f64) -> bool {
    let mut physical = scene.left_out.iter().filter(|hidden| !is_artefact(hidden)).peekable();
    let spacing_m = scene.spacing_m();
    let is_near = |hidden: &Hidden| {
        hidden.place(spacing_m).is_none_or(|[from_m, to_m]| {
            from_m - 1.01 * spacing_m <= x_m && x_m <= to_m + 1.01 * spacing_m
        })
    };
    physical.peek().is_none() || physical.any(is_near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::hypothesis;

    #[test]
    fn a_right_name_at_a_wrong_place_is_wrong() {
        let hidden = Hidden::Squat { x_m: [2.5, 2.5], depth_m: 2e-5, length_m: 6e-3 };
        let places = [Some([2.5; 2]), Some([2.6; 2]), Some([2.7; 2]), Some([1.0; 2]), None];
        let placed = places.map(|x_m| is_placed(&hidden, &hypothesis("squat", x_m), 0.125));
        assert_eq!(placed, [true, true, false, false, false]);
        let on_a_line = places.map(|x_m| is_placed(&hidden, &hypothesis("squat", x_m), 0.6));
        assert_eq!(on_a_line, [true, true, true, false, false]);
    }

    #[test]
    fn an_effect_under_one_sleeper_is_not_under_all_and_the_other_way_round() {
        let layer = |sleepers: Option<Vec<usize>>| Hidden::SubgradeLayer {
            sleepers,
            mass_kg: 1.0,
            stiffness_n_per_m: 3e7,
            damping_n_s_per_m: 1e3,
        };
        // At one sleeper, at four, at nine, at all of the section, and everywhere.
        let said = [Some([2.5; 2]), Some([2.25, 2.625]), Some([2.0, 3.0]), Some([1.0, 3.9]), None];
        let placed =
            |it: &Hidden| said.map(|x_m| is_placed(it, &hypothesis("subgrade_layer", x_m), 0.125));
        assert_eq!(placed(&layer(Some(vec![19]))), [true, true, false, false, false]);
        assert_eq!(placed(&layer(None)), [false, false, true, true, true]);
        assert_eq!(placed(&layer(Some((15..25).collect()))), [false, false, true, true, true]);
        assert_eq!(placed(&layer(Some((16..21).collect()))), [false, true, true, true, true]);
        assert_eq!(local(&layer(Some(vec![18, 21])), 0.6), Some([19.0 * 0.6, 22.0 * 0.6]));
    }
}
