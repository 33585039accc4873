//! A squat: a short hollow of the railhead.

use super::kind::{DEPTH_DEVIATION, LENGTH_DEVIATION};
use super::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind, Places,
    Screening, Trials,
};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "squat",
    summary: "a short hollow of the railhead",
    family: EffectFamily::SurfaceShape,
    group: LookAlikeGroup::RailDefect,
    classes: &[Class::Wavelength, Class::Local, Class::Concentrated],
    place: PlaceKind::Point,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("depth_m", "m", "depth of the hollow")
            .ranges([5e-6, 6e-5], [1e-4, 5e-4], 2e-5)
            .form_deviation(DEPTH_DEVIATION),
        KindParameter::new("length_m", "m", "length of the hollow")
            .ranges([2e-3, 1e-2], [2e-2, 6e-2], 6e-3)
            .form_deviation(LENGTH_DEVIATION),
    ],
    look_alikes: &["rail_joint"],
    would_separate: "a look at the railhead, or passes of both directions over the place",
    screening: Screening::tried(&[Family::new(
        Places::Points,
        &["depth_m", "length_m"],
        Trials::List(&[&[2e-5, 3e-3], &[2e-5, 6e-3], &[2e-5, 1e-2]]),
    )])
    .suggested(&["depth_m", "length_m"]),
    build: |inputs| {
        Ok(Arc::new(Squat {
            centre_m: inputs.point_m(),
            depth_m: inputs.value("depth_m"),
            length_m: inputs.value("length_m"),
        }))
    },
};

/// Hollow `d/2 (1 + cos 2 pi (x - x0) / l)` over the length `l`.
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to the name")]
struct Squat {
    centre_m: f64,
    depth_m: f64,
    length_m: f64,
}

impl Extension for Squat {
    fn is_averaged(&self) -> bool {
        true
    }

    fn profile_m(&self, x_m: f64) -> f64 {
        let place = (x_m - self.centre_m) / self.length_m;
        if place.abs() < 0.5 { 0.5 * self.depth_m * (1.0 + (TAU * place).cos()) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, assert_followed, extension, instance,
    };

    #[test]
    fn the_hollow_is_as_deep_and_as_long_as_it_says() {
        let squat = instance("squat").at([0.7, 0.7]).with("depth_m", 2e-5);
        let squat = extension(&squat.with("length_m", 6e-3));
        assert_eq!(squat.profile_m(0.7), 2e-5);
        assert_eq!([squat.profile_m(0.6969), squat.profile_m(0.7031)], [0.0, 0.0]);
        // Half deep a quarter of its length from the middle.
        assert!((squat.profile_m(0.7015) / 1e-5 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_slow_wheel_follows_the_hollow_down_and_up() {
        let squat = instance("squat").at([0.75, 0.75]).with("depth_m", 1e-5);
        let squat = squat.with("length_m", 0.2);
        let hollow = extension(&squat);
        assert_followed(&squat, |x_m| hollow.profile_m(x_m));
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let squat = instance("squat").at([0.65, 0.65]).with("depth_m", 2e-5);
        assert_felt_alike_in_both_solvers(&squat.with("length_m", 6e-3));
    }
}
