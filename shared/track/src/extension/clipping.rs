//! A sensor or converter at the end of its range.

use super::{
    Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, Measured, PlaceKind,
    Screening,
};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "clipping",
    summary: "accelerations beyond a limit are recorded as the limit",
    family: EffectFamily::Sensor,
    group: LookAlikeGroup::MeasuringChain,
    classes: &[Class::Noise],
    place: PlaceKind::Nowhere,
    measuring_chain: true,
    parameters: &[KindParameter::new("limit_m_s2", "m/s2", "largest acceleration of either sign")
        .ranges([5.0, 500.0], [50.0, 5000.0], 50.0)],
    look_alikes: &["gain_error"],
    would_separate: "a sensor of larger range",
    screening: Screening::not_tried("the samples of a pass show it without a model of the track"),
    build: |inputs| Ok(Arc::new(Clipping { limit_m_s2: inputs.value("limit_m_s2") })),
};

/// The nearest value within `-limit` to `limit`.
#[derive(Debug)]
struct Clipping {
    limit_m_s2: f64,
}

impl Extension for Clipping {
    fn measure(&self, measured: &mut Measured) {
        for value in &mut measured.acceleration_m_s2 {
            *value = value.clamp(-self.limit_m_s2, self.limit_m_s2);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::Measured;
    use crate::extension::testing::{instance, track};

    #[test]
    fn a_chain_changes_the_signal_in_the_order_in_which_it_is_listed() {
        let gain = instance("gain_error").with("factor", 2.0);
        let clipping = instance("clipping").with("limit_m_s2", 3.0);
        let recorded = |chain: [_; 2]| {
            let mut measured = Measured {
                time_step_s: 1e-5,
                acceleration_m_s2: vec![-5.0, 1.0, 2.0],
                position_m: vec![0.0, 1.0, 2.0],
                first: 0,
            };
            track(&chain).measure(&mut measured);
            measured.acceleration_m_s2
        };
        assert_eq!(recorded([gain.clone(), clipping.clone()]), [-3.0, 2.0, 3.0]);
        assert_eq!(recorded([clipping, gain]), [-6.0, 2.0, 4.0]);
    }
}
