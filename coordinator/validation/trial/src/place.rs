//! Places of hidden effects, and the sleepers next to them.

use crate::known::is_artefact;
use tracktwin_diagnosis::Hypothesis;
use tracktwin_reference_simulator::{Hidden, Scene};

/// Largest length of a local effect in sleeper spacings.
const LOCAL_SPACINGS: f64 = 3.0;

/// Whether a hypothesis has the place of an effect to within one sleeper spacing. True if either of them
/// acts everywhere.
pub(crate) fn is_placed(hidden: &Hidden, hypothesis: &Hypothesis, spacing_m: f64) -> bool {
    let (Some([from_m, to_m]), Some(location)) = (hidden.place(spacing_m), &hypothesis.location)
    else {
        return true;
    };
    from_m - 1.01 * spacing_m <= location.x_m[1] && location.x_m[0] <= to_m + 1.01 * spacing_m
}

/// The place of an effect that has one.
pub(crate) fn local(hidden: &Hidden, spacing_m: f64) -> Option<[f64; 2]> {
    hidden.place(spacing_m).filter(|[from_m, to_m]| to_m - from_m <= LOCAL_SPACINGS * spacing_m)
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
pub(crate) mod testing {
    use std::collections::BTreeMap;
    use tracktwin_diagnosis::{Hypothesis, Location};

    /// A squat at a place in m, or nowhere.
    pub(crate) fn hypothesis(x_m: Option<f64>) -> Hypothesis {
        Hypothesis {
            family: Some("rail_bending".to_owned()),
            family_probability: 0.9,
            physics: "squat".to_owned(),
            probability: 0.5,
            accepted: false,
            location: x_m.map(|x_m| Location { x_m: [x_m, x_m], sleepers: Vec::new() }),
            port: None,
            behaviour: None,
            parameters: BTreeMap::new(),
            assumed: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: String::new(),
            detectability: 0.0,
            log_evidence: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::hypothesis;
    use super::*;

    #[test]
    fn a_right_name_at_a_wrong_place_is_wrong() {
        let hidden = Hidden::Squat { x_m: [2.5, 2.5], depth_m: 2e-5, length_m: 6e-3 };
        let places = [Some(2.5), Some(2.6), Some(2.7), Some(1.0), None];
        let placed = places.map(|x_m| is_placed(&hidden, &hypothesis(x_m), 0.125));
        assert_eq!(placed, [true, true, false, false, true]);
        let on_a_line = places.map(|x_m| is_placed(&hidden, &hypothesis(x_m), 0.6));
        assert_eq!(on_a_line, [true, true, true, false, true]);
    }
}
