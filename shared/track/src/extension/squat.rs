//! A squat: a short hollow of the railhead.

use super::{Class, Extension, Kind, KindParameter, PlaceKind};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "squat",
    summary: "a short hollow of the railhead",
    classes: &[Class::Wavelength, Class::Local, Class::Concentrated],
    place: PlaceKind::Point,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("depth_m", "m", "depth of the hollow").ranges(
            [5e-6, 6e-5],
            [1e-4, 5e-4],
            2e-5,
        ),
        KindParameter::new("length_m", "m", "length of the hollow").ranges(
            [2e-3, 1e-2],
            [2e-2, 6e-2],
            6e-3,
        ),
    ],
    look_alikes: &["rail_joint"],
    would_separate: "a look at the railhead, or passes of both directions over the place",
    build: |inputs| {
        Ok(Arc::new(Squat {
            centre_m: inputs.point_m(),
            depth_m: inputs.value("depth_m"),
            length_m: inputs.value("length_m"),
        }))
    },
};

/// Hollow `d/2 (1 + cos 2 pi (x - x0) / l)` over the length `l` (mismatch catalogue 4).
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to the name")]
struct Squat {
    centre_m: f64,
    depth_m: f64,
    length_m: f64,
}

impl Extension for Squat {
    fn profile_m(&self, x_m: f64) -> f64 {
        let place = (x_m - self.centre_m) / self.length_m;
        if place.abs() < 0.5 { 0.5 * self.depth_m * (1.0 + (TAU * place).cos()) } else { 0.0 }
    }
}
