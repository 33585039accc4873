//! Doubtful properties of a described track.

use super::TrackCheck;
use tracktwin_number::rounded;

/// Largest ratio of two bending stiffnesses of a sleeper that agree: the section of V-Track's sleepers has 0.47 times their
/// nominal value.
const SECTION_MAX: f64 = 2.5;

/// Largest length of a half sleeper divided by the distance of its rail seat from the middle. Sleepers of lines have 1.6 to
/// 2.0; the length of a whole sleeper would give more than three.
const HALF_LENGTH_MAX: f64 = 2.5;

/// Largest radius of a wheel divided by the sleeper spacing. Wheels of lines have 0.5 to 1.1; the diameter of a usual wheel
/// would give 1.5.
const RADIUS_MAX: f64 = 1.2;

impl TrackCheck {
    /// Returns doubtful properties of the description, one sentence for each.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        for speed in self.speeds.iter().filter(|speed| speed.without_contact > 1e-3) {
            doubts.push(format!(
                "at {} km/h the wheel is off the rail for {:.1} % of the time: lower \
                 irregularity_level, the speed or the unsprung mass",
                speed.speed_km_h,
                1e2 * speed.without_contact
            ));
        }
        let ratio = self.sleeper_section_ratio;
        if ratio.ln().abs() > SECTION_MAX.ln() {
            doubts.push(format!(
                "youngs_Pa times second_moment_m4 of the sleeper is {} times the nominal sleeper_EI_N_m2: the model bends \
                 the sleeper with the latter, and takes only the shear from the section",
                rounded(ratio, 2)
            ));
        }
        if let Some(ratio) = self.half_length_ratio.filter(|ratio| *ratio > HALF_LENGTH_MAX) {
            doubts.push(format!(
                "half_length_m is {} times rail_seat_m, on lines 1.6 to 2.0 times: state half the length of the sleeper, and \
                 the distance of the rail seat from the middle of the track",
                rounded(ratio, 2)
            ));
        }
        if self.wheel_radius_ratio > RADIUS_MAX {
            doubts.push(format!(
                "radius_m is {} times spacing_m, on lines 0.5 to 1.1 times: state the radius of the wheel, not its diameter",
                rounded(self.wheel_radius_ratio, 2)
            ));
        }
        for parameter in self.parameters.iter().filter(|it| it.change_db.abs() < 0.05) {
            doubts.push(format!(
                "{} can hardly be told: a change of 10 % changes no level by more than {:.2} dB",
                parameter.parameter,
                parameter.change_db.abs()
            ));
        }
        doubts
    }
}

#[cfg(test)]
mod tests {
    use super::super::check;
    use tracktwin_parameters::{Parameter, Preset, Track};

    #[test]
    fn whole_lengths_and_diameters_are_doubted_and_no_preset_is() {
        let doubts = |track: &Track| check(track).unwrap().doubts();
        for preset in Preset::ALL {
            let doubts = doubts(&preset.track());
            assert!(!doubts.iter().any(|it| it.contains("on lines")), "{preset:?} {doubts:?}");
        }
        let mut track = Preset::Concrete60E1.track();
        track.design.sleeper.half_length_m *= 2.0;
        track.design.wheel.radius_m *= 2.0;
        let doubts = doubts(&track);
        assert!(doubts.iter().any(|it| it.starts_with("half_length_m is 3.4 times")), "{doubts:?}");
        assert!(doubts.iter().any(|it| it.starts_with("radius_m is 1.5 times")), "{doubts:?}");
    }

    #[test]
    fn a_rough_rail_throws_the_wheel_off() {
        let mut track = Preset::Concrete60E1.track();
        track.nominal[Parameter::IrregularityLevel] = 20.0;
        let check = check(&track).unwrap();
        assert!(check.doubts().iter().any(|doubt| doubt.contains("off the rail")));
    }
}
