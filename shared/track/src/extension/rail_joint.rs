//! A joint of the rail: a dip of its surface, a loss of its bending stiffness, or both.

use super::kind::{DEPTH_DEVIATION, LENGTH_DEVIATION};
use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "rail_joint",
    summary: "a rail joint: the surface dips and the rail bends more easily",
    family: EffectFamily::RailBending,
    group: LookAlikeGroup::RailDefect,
    classes: &[Class::Frequency, Class::Wavelength, Class::Local, Class::Concentrated],
    place: PlaceKind::Point,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("dip_m", "m", "depth of the dip; negative: a hump")
            .ranges([2e-5, 3e-4], [5e-4, 2e-3], 8e-5)
            .bound(Bound::Any)
            .form_deviation(DEPTH_DEVIATION)
            .or(0.0),
        KindParameter::new("length_m", "m", "distance over which the dip falls to 1/e")
            .ranges([5e-3, 4e-2], [0.1, 0.5], 2e-2)
            .form_deviation(LENGTH_DEVIATION)
            .or(2e-2),
        KindParameter::new("dip_exponent", "1", "1: the dip is a kink; 2: it is rounded")
            .ranges([0.7, 3.0], [0.7, 3.0], 1.0)
            .or(1.0),
        KindParameter::new(
            "dip_length_ratio",
            "1",
            "length of the dip after the joint over its length before the joint",
        )
        .ranges([0.1, 10.0], [0.1, 10.0], 1.0)
        .or(1.0),
        KindParameter::new("bending_factor", "1", "what remains of the bending stiffness")
            .ranges([0.1, 0.6], [0.2, 0.5], 0.3)
            .or(1.0),
        KindParameter::new("bending_length_m", "m", "length of the rail that is softened")
            .ranges([1e-2, 8e-2], [0.5, 0.9], 2.5e-2)
            .or(2.5e-2),
    ],
    look_alikes: &["squat", "support_variation", "hanging_sleeper"],
    would_separate: "a slower pass: the dip's part moves with the speed, the bending's does not",
    screening: Screening::tried(&[Family::new(
        Places::Points,
        &["bending_factor", "dip_m", "length_m"],
        Trials::List(&[
            &[0.15, 0.0, 2e-2],
            &[0.4, 0.0, 2e-2],
            &[1.0, 6e-5, 2e-2],
            &[0.3, 6e-5, 2e-2],
        ]),
    )])
    .suggested(&["dip_m", "length_m", "bending_factor"]),
    build: |inputs| {
        let (centre_m, length_m) = (inputs.point_m(), inputs.value("bending_length_m"));
        Ok(Arc::new(RailJoint {
            centre_m,
            dip_m: inputs.value("dip_m"),
            dip_lengths_m: [-0.5, 0.5].map(|power| {
                inputs.value("length_m") * inputs.value("dip_length_ratio").powf(power)
            }),
            dip_exponent: inputs.value("dip_exponent"),
            softened_m: [centre_m - 0.5 * length_m, centre_m + 0.5 * length_m],
            bending_factor: inputs.value("bending_factor"),
        }))
    },
};

/// Dip `d exp(-(|x - x0| / l)^p)` over a rail whose bending stiffness is `beta EI` on a short length. With
/// `p = 1` it is a kink of angle `2 d / l` (Jenkins 1974). With a length ratio `r`, `l` is `l / sqrt(r)` before
/// the joint and `l sqrt(r)` after it.
#[derive(Debug)]
struct RailJoint {
    centre_m: f64,
    dip_m: f64,
    /// Before and after the joint.
    dip_lengths_m: [f64; 2],
    dip_exponent: f64,
    softened_m: [f64; 2],
    bending_factor: f64,
}

impl Extension for RailJoint {
    fn assemble(&self, assembly: &mut Assembly) {
        // A factor of one changes no bit, so that a joint may be a dip alone.
        if self.bending_factor != 1.0 {
            assembly.soften_rail(self.softened_m, self.bending_factor);
        }
    }

    fn profile_m(&self, x_m: f64) -> f64 {
        let distance_m = x_m - self.centre_m;
        let length_m = self.dip_lengths_m[usize::from(distance_m > 0.0)];
        self.dip_m * (-(distance_m.abs() / length_m).powf(self.dip_exponent)).exp()
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::Extension;
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, extension, instance, track,
    };
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{Mesh, Support, TrackModel};
    use tracktwin_parameters::TrackDesign;

    /// A support with almost no stiffness: the rail is a beam on its two ends.
    const NOTHING: Support = Support {
        railpad_stiffness: 0.0,
        railpad_damping: 0.0,
        ballast_stiffness: 1.0,
        ballast_damping: 0.0,
        sleeper_bending_stiffness: 5000.0,
    };

    /// Static deflection in m/N of a simply supported beam of two spans under its middle.
    fn deflection(joint: Option<f64>, elements: usize, softened_m: f64) -> f64 {
        let design = TrackDesign::v_track();
        let joint = joint.map(|factor| {
            let joint = instance("rail_joint").at([0.125, 0.125]);
            let joint = joint.with("bending_factor", factor).with("bending_length_m", softened_m);
            joint.build(&design, 2).unwrap()
        });
        let (mesh, joint) = (Mesh::uniform(2, elements, 2), Vec::from_iter(joint));
        let model = TrackModel::build(&design, &mesh, &[NOTHING], &joint).unwrap();
        let middle = ReceptancePoint::Rail(0.125);
        receptance(&model, middle, middle, &[0.0]).unwrap()[0].re
    }

    #[test]
    fn a_simply_supported_beam_sinks_deeper_by_the_work_of_the_softened_part() {
        let (factor, softened_m, length) = (0.2, 0.0625, 0.25_f64);
        // Unit load theorem: the moment is x / 2 up to the load in the middle.
        let moments = ((0.5 * length).powi(3) - (0.5 * (length - softened_m)).powi(3)) / 6.0;
        let bending_stiffness = TrackDesign::v_track().rail.bending_stiffness();
        let expected = moments * (1.0 / factor - 1.0) / bending_stiffness;
        let more = |elements| {
            deflection(Some(factor), elements, softened_m) - deflection(None, elements, softened_m)
        };
        // The softened part is two whole elements: static deflections are exact.
        assert!((more(4) / expected - 1.0).abs() < 1e-9, "{}", more(4) / expected);
        // Spread over longer elements it lies where the moment is smaller, but as much of it.
        let spread = more(1) / expected;
        assert!((0.3..0.9).contains(&spread), "{spread}");
    }

    #[test]
    fn a_joint_that_keeps_stiffness_and_height_is_none() {
        let (with, without) = (track(&[instance("rail_joint").at([0.8, 0.8])]), track(&[]));
        assert_eq!(with.matrices(), without.matrices());
        assert_eq!(with.profile_m(0.8), 0.0);
    }

    #[test]
    fn the_dip_is_a_kink_of_twice_its_depth_over_its_length() {
        let joint = instance("rail_joint").at([0.8, 0.8]).with("dip_m", 1e-4);
        let joint = extension(&joint.with("length_m", 0.01));
        assert_eq!(joint.profile_m(0.8), 1e-4);
        let slope = |side: f64| (joint.profile_m(0.8 + side) - joint.profile_m(0.8)) / side;
        // A hundred-thousandth of the length away: as far from the tangent, and rounding.
        let kink = slope(1e-7) - slope(-1e-7);
        assert!((kink / -2e-2 - 1.0).abs() < 1e-4, "{kink}");
    }

    #[test]
    fn a_rounded_dip_has_no_kink_and_one_side_may_be_longer() {
        let joint =
            instance("rail_joint").at([0.8, 0.8]).with("dip_m", 1e-4).with("length_m", 0.01);
        let rounded = extension(&joint.clone().with("dip_exponent", 2.0));
        let slope = |side: f64| (rounded.profile_m(0.8 + side) - rounded.profile_m(0.8)) / side;
        assert!(slope(1e-6).abs() < 1e-5, "{}", slope(1e-6));
        // At the length from the joint a dip of any exponent has 1/e of its depth.
        let depth = |x_m: f64, extension: &dyn Extension| extension.profile_m(x_m) / 1e-4;
        assert!((depth(0.81, &*rounded) - (-1.0_f64).exp()).abs() < 1e-9);
        let uneven = extension(&joint.with("dip_length_ratio", 4.0));
        for x_m in [0.8 - 0.005, 0.8 + 0.02] {
            assert!((depth(x_m, &*uneven) - (-1.0_f64).exp()).abs() < 1e-9, "{x_m}");
        }
    }

    #[test]
    fn a_passing_wheel_feels_dip_and_bending_in_both_solvers_alike() {
        let joint = instance("rail_joint").at([0.6, 0.6]);
        assert_felt_alike_in_both_solvers(&joint.clone().with("bending_factor", 0.15));
        assert_felt_alike_in_both_solvers(&joint.with("dip_m", 8e-5));
    }
}
