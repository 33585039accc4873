//! An odometer with a wrong offset or scale.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, Measured,
    PlaceKind, Screening,
};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "position_error",
    summary: "recorded positions are shifted or stretched",
    family: EffectFamily::Position,
    group: LookAlikeGroup::MeasuringChain,
    classes: &[Class::Noise],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[
        KindParameter::new("offset_m", "m", "recorded minus true position at the first sample")
            .ranges([-2e-2, 2e-2], [-0.5, 0.5], 1e-2)
            .bound(Bound::Any)
            .or(0.0),
        KindParameter::new("scale", "1", "recorded over true way, minus one")
            .ranges([-0.03, 0.03], [-0.03, 0.03], 0.01)
            .bound(Bound::Any)
            .or(0.0),
    ],
    look_alikes: &["support_variation"],
    would_separate: "a marker on the track that every pass must see at its place",
    screening: Screening::not_tried(
        "passes show it by what they have in common, without a model of the track",
    ),
    build: |inputs| {
        if inputs.value("scale") <= -1.0 {
            return Err(inputs.refuse("scale", "more than -1: positions must grow"));
        }
        Ok(Arc::new(PositionError {
            offset_m: inputs.value("offset_m"),
            scale: inputs.value("scale"),
        }))
    },
};

/// `x_0 + offset + (1 + scale) (x - x_0)`, with `x_0` the true position at the first kept sample.
#[derive(Debug)]
struct PositionError {
    offset_m: f64,
    scale: f64,
}

impl Extension for PositionError {
    fn measure(&self, measured: &mut Measured) {
        let first = measured.position_m.get(measured.first).copied().unwrap_or_default();
        for position in &mut measured.position_m {
            *position = first + self.offset_m + (1.0 + self.scale) * (*position - first);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::Measured;
    use crate::extension::testing::{extension, instance};

    #[test]
    fn positions_are_shifted_at_the_start_and_stretched_from_there() {
        let error = instance("position_error").with("offset_m", 0.01).with("scale", 0.1);
        let mut measured = Measured {
            time_step_s: 1e-5,
            acceleration_m_s2: vec![1.0; 3],
            position_m: vec![0.5, 1.0, 1.5],
            first: 1,
        };
        extension(&error).measure(&mut measured);
        assert_eq!(measured.acceleration_m_s2, [1.0; 3]);
        for (found, expected) in measured.position_m.iter().zip([0.46, 1.01, 1.56]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
    }
}
