//! A wheel that is not round.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening,
};
use std::f64::consts::TAU;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "wheel_out_of_round",
    summary: "waves around the wheel's tread",
    family: EffectFamily::Wheel,
    group: LookAlikeGroup::Wheel,
    classes: &[Class::Wavelength, Class::WheelAngle, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("order", "1", "how many waves there are on a turn")
            .ranges([1.0, 60.0], [1.0, 30.0], 20.0)
            .bound(Bound::Whole),
        KindParameter::new("amplitude_m", "m", "amplitude of the waves").ranges(
            [2e-7, 5e-6],
            [1e-5, 1e-3],
            2e-6,
        ),
        KindParameter::new("phase_rad", "rad", "phase at x = 0")
            .ranges([0.0, TAU], [0.0, TAU], 0.0)
            .bound(Bound::Any)
            .or(0.0),
    ],
    look_alikes: &["corrugation", "roughness_spectrum"],
    would_separate: "more laps: the wheel's waves lie elsewhere on the track in every lap",
    screening: Screening::tried(&[]).suggested(&["amplitude_m"]),
    build: |inputs| {
        Ok(Arc::new(WheelOutOfRound {
            wave_number: inputs.value("order") / inputs.design.wheel.radius_m,
            amplitude_m: inputs.value("amplitude_m"),
            phase_rad: inputs.value("phase_rad"),
        }))
    },
};

/// `a cos(n x / R + phi)`.
#[derive(Debug)]
struct WheelOutOfRound {
    /// Wave number along the tread in rad/m.
    wave_number: f64,
    amplitude_m: f64,
    phase_rad: f64,
}

impl Extension for WheelOutOfRound {
    fn wheel_profile_m(&self, rolled_m: f64) -> f64 {
        self.amplitude_m * (self.wave_number * rolled_m + self.phase_rad).cos()
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, assert_followed, extension, instance,
    };
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn a_slow_wheel_follows_its_own_waves() {
        let waves = instance("wheel_out_of_round").with("order", 3.0).with("amplitude_m", 1e-5);
        let shape = extension(&waves);
        assert_followed(&waves, |x_m| shape.wheel_profile_m(x_m));
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let waves = instance("wheel_out_of_round").with("order", 20.0);
        assert_felt_alike_in_both_solvers(&waves.with("amplitude_m", 2e-6));
    }

    #[test]
    fn an_order_is_a_whole_number() {
        let waves = instance("wheel_out_of_round").with("order", 2.5).with("amplitude_m", 1e-5);
        let error = waves.build(&TrackDesign::v_track(), 12).unwrap_err();
        assert!(error.to_string().contains("order is 2.5 but must be a whole number"), "{error}");
    }
}
