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
    /// V-Track enlarged five times by the scale factors of Table D1.
    RealScale,
}

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
            set.with(parameter, parameter.enlarged(parameter.nominal(), self.length_ratio()))
        })
    }

    /// The range of one parameter.
    pub fn axis(self, parameter: Parameter) -> Axis {
        let [low, high] = parameter.range().map(|v| parameter.enlarged(v, self.length_ratio()));
        Axis { parameter, low, high, scale: Scale::Linear }
    }

    /// All six parameters over the ranges of Table D1.
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
    fn v_track_is_the_catalogue_itself() {
        assert_eq!(Preset::VTrack.nominal(), ParameterSet::nominal());
        assert_eq!(Preset::VTrack.design(), TrackDesign::v_track());
    }
}
