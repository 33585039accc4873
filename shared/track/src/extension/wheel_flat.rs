//! A flat of the wheel's tread.

use super::kind::LENGTH_DEVIATION;
use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening,
};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "wheel_flat",
    summary: "a flat of the wheel's tread, met once a turn",
    family: EffectFamily::Wheel,
    group: LookAlikeGroup::Wheel,
    classes: &[Class::Wavelength, Class::WheelAngle, Class::Concentrated],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("length_m", "m", "length of the flat along the tread")
            .ranges([1e-3, 8e-3], [2e-2, 8e-2], 3.5e-3)
            .form_deviation(LENGTH_DEVIATION),
        KindParameter::new(
            "depth_factor",
            "1",
            "depth of the flat over that of a worn flat of its length",
        )
        .ranges([0.5, 8.0], [0.5, 8.0], 1.0)
        .or(1.0),
        KindParameter::new("phase_m", "m", "where the flat first meets the rail, from x = 0")
            .ranges([0.0, 0.41], [0.0, 2.89], 0.0)
            .bound(Bound::Any)
            .or(0.0),
    ],
    look_alikes: &["wheel_out_of_round", "squat"],
    would_separate: "more laps: the flat's places walk along the track, a squat's stay",
    screening: Screening::tried(&[]).suggested(&["length_m", "depth_factor"]),
    build: |inputs| {
        let (length_m, radius_m) = (inputs.value("length_m"), inputs.design.wheel.radius_m);
        Ok(Arc::new(WheelFlat {
            length_m,
            depth_m: inputs.value("depth_factor") * length_m * length_m / (16.0 * radius_m),
            circumference_m: TAU * radius_m,
            phase_m: inputs.value("phase_m"),
        }))
    },
};

/// A worn flat of length `l` on a wheel of radius `R`: `d/2 (1 + cos 2 pi s / l)` deep at a
/// distance `s` along the tread from its middle, with `d` a multiple of `l² / (16 R)`. New flats are
/// twice as deep, pits several times (measured profiles: `docs/extensions.md`).
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to the name")]
struct WheelFlat {
    length_m: f64,
    depth_m: f64,
    circumference_m: f64,
    phase_m: f64,
}

impl Extension for WheelFlat {
    fn wheel_profile_m(&self, rolled_m: f64) -> f64 {
        let half_turn = 0.5 * self.circumference_m;
        let after = (rolled_m - self.phase_m + half_turn).rem_euclid(self.circumference_m);
        let place = (after - half_turn) / self.length_m;
        if place.abs() < 0.5 { 0.5 * self.depth_m * (1.0 + (TAU * place).cos()) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, assert_followed, extension, instance,
    };
    use std::f64::consts::TAU;

    const CIRCUMFERENCE_M: f64 = TAU * 0.065;

    #[test]
    fn the_flat_comes_back_every_turn_and_is_as_deep_as_its_length_asks() {
        let flat = instance("wheel_flat").with("length_m", 3.5e-3).with("phase_m", 0.1);
        let flat = extension(&flat);
        let depth_m = 3.5e-3_f64.powi(2) / (16.0 * 0.065);
        for turn in [-1.0, 0.0, 1.0, 7.0] {
            let met_m = 0.1 + turn * CIRCUMFERENCE_M;
            assert!((flat.wheel_profile_m(met_m) / depth_m - 1.0).abs() < 1e-9, "{turn}");
            assert_eq!(flat.wheel_profile_m(met_m + 1.8e-3), 0.0);
        }
        assert_eq!(flat.profile_m(0.1), 0.0);
    }

    #[test]
    fn a_pit_is_deeper_by_its_factor() {
        let flat = instance("wheel_flat").with("length_m", 3.5e-3).with("phase_m", 0.1);
        let (worn, pit) = (extension(&flat), extension(&flat.with("depth_factor", 5.0)));
        for met_m in [0.0995, 0.1, 0.101] {
            let ratio = pit.wheel_profile_m(met_m) / worn.wheel_profile_m(met_m);
            assert!((ratio - 5.0).abs() < 1e-9, "{met_m}");
        }
    }

    #[test]
    fn a_slow_wheel_follows_a_long_flat() {
        let flat = instance("wheel_flat").with("length_m", 0.2).with("phase_m", 0.75);
        let shape = extension(&flat);
        assert_followed(&flat, |x_m| shape.wheel_profile_m(x_m));
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let flat = instance("wheel_flat").with("length_m", 3.5e-3);
        assert_felt_alike_in_both_solvers(&flat.with("phase_m", 0.6));
    }
}
