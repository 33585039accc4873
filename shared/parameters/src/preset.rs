//! Tracks that come with the program: a design, its nominal values, ranges and speeds.

use crate::{Axis, Parameter, ParameterSet, ParameterSpace, Scale, TrackDesign};
use serde::{Deserialize, Serialize};

/// A track to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The downscaled test rig of the paper (Table D1).
    #[default]
    VTrack,
    /// V-Track enlarged five times by the scale factors of Table D1, with the surface of a real rail: a model
    /// of the rig at another scale, not of a line with 60E1 rails.
    RealScale,
}

/// Level `A_irr` of a real rail's surface in 1e-4 m2 rad/m, and its range.
///
/// Roughness is not enlarged with the track: V-Track's levels would throw a wheel of 5.5 t off the rail. The
/// one-third-octave levels of eq. B.6 at 0.05 are those of the limit for a reference track at a wavelength of
/// 0.4 m (17.1 dB re 1 um), and at 0.1 those at 0.2 m (11.0 dB). The limit falls by 2 dB a one-third octave
/// there and eq. B.6 by 3, so that shorter waves lie below it.
///
/// Source: ISO 3095:2013, Figure 2.
const REAL_LEVEL: f64 = 0.05;
const REAL_LEVELS: [f64; 2] = [0.02, 0.1];

impl Preset {
    /// Length on this track over length on V-Track.
    pub const fn length_ratio(self) -> f64 {
        match self {
            Self::VTrack => 1.0,
            Self::RealScale => 5.0,
        }
    }

    /// Sections, masses, spacing and load.
    pub fn design(self) -> TrackDesign {
        TrackDesign::v_track().enlarged(self.length_ratio())
    }

    /// Every parameter at its nominal value.
    pub fn nominal(self) -> ParameterSet {
        Parameter::ALL.iter().fold(ParameterSet::nominal(), |set, &parameter| {
            let value = match (self, parameter) {
                (Self::RealScale, Parameter::IrregularityLevel) => REAL_LEVEL,
                _ => parameter.enlarged(parameter.nominal(), self.length_ratio()),
            };
            set.with(parameter, value)
        })
    }

    /// The range of one parameter.
    pub fn axis(self, parameter: Parameter) -> Axis {
        let [low, high] = match (self, parameter) {
            (Self::RealScale, Parameter::IrregularityLevel) => REAL_LEVELS,
            _ => parameter.range().map(|v| parameter.enlarged(v, self.length_ratio())),
        };
        Axis { parameter, low, high, scale: Scale::Linear }
    }

    /// All six parameters over the ranges of Table D1; a real rail's surface has its own.
    pub fn space(self) -> ParameterSpace {
        let axes = Parameter::ALL.iter().map(|&parameter| self.axis(parameter)).collect();
        ParameterSpace::new(axes).expect("the catalogue's ranges are positive and in order")
    }

    /// The speeds at which the paper's vehicle runs over it, in km/h.
    pub fn speeds_km_h(self) -> Vec<f64> {
        [7.0, 10.0, 13.0].map(|speed| speed * self.length_ratio()).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_scale_has_the_ranges_of_table_d1() {
        let axis = Preset::RealScale.axis(Parameter::BallastStiffness);
        assert!((axis.low - 20e6).abs() < 1.0 && (axis.high - 110e6).abs() < 1.0);
        let damping = Preset::RealScale.axis(Parameter::RailpadDamping);
        let ratio = damping.low / Preset::VTrack.axis(Parameter::RailpadDamping).low;
        assert!((ratio - 25.0).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn a_real_rail_is_as_rough_as_a_reference_track() {
        // One-third-octave level in dB re 1 um of eq. B.6 at a wavelength in m; its integral over a band in
        // closed form, where the wave number is far above the cut-off of 0.8242 rad/m.
        let level_db = |level: f64, wavelength_m: f64| {
            let [low, high] = [-0.05, 0.05]
                .map(|share: f64| std::f64::consts::TAU / wavelength_m * 10f64.powf(share));
            let power =
                0.25 * 1e-4 * level * 0.8242_f64.powi(2) * (low.powi(-3) - high.powi(-3)) / 3.0;
            10.0 * (power / 1e-12).log10()
        };
        let crate::Axis { low, high, .. } = Preset::RealScale.axis(Parameter::IrregularityLevel);
        let nominal = Preset::RealScale.nominal()[Parameter::IrregularityLevel];
        assert!((level_db(nominal, 0.4) - 17.1).abs() < 0.1, "{}", level_db(nominal, 0.4));
        assert!((level_db(high, 0.2) - 11.0).abs() < 0.2, "{}", level_db(high, 0.2));
        assert!(low < nominal && nominal < high);
    }

    #[test]
    fn v_track_is_the_catalogue_itself() {
        assert_eq!(Preset::VTrack.nominal(), ParameterSet::nominal());
        assert_eq!(Preset::VTrack.design(), TrackDesign::v_track());
    }
}
