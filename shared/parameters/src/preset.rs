//! Tracks that come with the program: a design, its nominal values, ranges and speeds.

use crate::{Axis, Parameter, ParameterSet, ParameterSpace, Prior, Scale, Track, TrackDesign};
use serde::{Deserialize, Serialize};

/// A track that comes with the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The downscaled test rig of the paper (Table D1).
    #[default]
    VTrack,
    /// V-Track enlarged five times by the scale factors of Table D1, with the surface of a real rail: a model
    /// of the rig at another scale, not of a line with 60E1 rails.
    RealScale,
    /// A line: rail 60E1 on concrete monobloc sleepers, railpads from soft to stiff.
    #[serde(rename = "60E1-concrete")]
    Concrete60E1,
    /// Rail 60E1 on concrete monobloc sleepers, with soft railpads.
    #[serde(rename = "60E1-concrete-soft")]
    SoftConcrete60E1,
    /// Rail 60E1 on concrete monobloc sleepers, with stiff railpads.
    #[serde(rename = "60E1-concrete-stiff")]
    StiffConcrete60E1,
    /// Rail 54E1 on concrete monobloc sleepers.
    #[serde(rename = "54E1-concrete")]
    Concrete54E1,
    /// Rail 54E1 on wooden sleepers.
    #[serde(rename = "54E1-wood")]
    Wood54E1,
    /// Rail 49E1 on bi-block sleepers.
    #[serde(rename = "49E1-bi-block")]
    BiBlock49E1,
}

/// Shortest and longest wavelength of the irregularity of V-Track in m. The paper does not state them.
/// At 7 km/h a wavelength of 0.5 mm has a frequency of 3.9 kHz, inside the range of the features.
const WAVELENGTHS_M: [f64; 2] = [0.25e-3, 1.0];

/// Sleeper spacing in m between the test rigs and the lines.
const LINE_SPACING_M: f64 = 0.35;

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
    /// All presets.
    pub const ALL: &'static [Self] = &[
        Self::VTrack,
        Self::RealScale,
        Self::Concrete60E1,
        Self::SoftConcrete60E1,
        Self::StiffConcrete60E1,
        Self::Concrete54E1,
        Self::Wood54E1,
        Self::BiBlock49E1,
    ];

    /// Name of the preset in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::VTrack => "v-track",
            Self::RealScale => "real-scale",
            Self::Concrete60E1 => "60E1-concrete",
            Self::SoftConcrete60E1 => "60E1-concrete-soft",
            Self::StiffConcrete60E1 => "60E1-concrete-stiff",
            Self::Concrete54E1 => "54E1-concrete",
            Self::Wood54E1 => "54E1-wood",
            Self::BiBlock49E1 => "49E1-bi-block",
        }
    }

    /// The preset with this name, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|preset| preset.name() == name)
    }

    /// The track description as the text of a track file, with the sources of its numbers if they are
    /// known.
    pub fn text(self) -> String {
        self.file().map_or_else(|| self.track().to_toml(), str::to_owned)
    }

    /// Track file of a preset that is a line; `None` for test rigs.
    const fn file(self) -> Option<&'static str> {
        Some(match self {
            Self::VTrack | Self::RealScale => return None,
            Self::Concrete60E1 => include_str!("presets/60E1-concrete.toml"),
            Self::SoftConcrete60E1 => include_str!("presets/60E1-concrete-soft.toml"),
            Self::StiffConcrete60E1 => include_str!("presets/60E1-concrete-stiff.toml"),
            Self::Concrete54E1 => include_str!("presets/54E1-concrete.toml"),
            Self::Wood54E1 => include_str!("presets/54E1-wood.toml"),
            Self::BiBlock49E1 => include_str!("presets/49E1-bi-block.toml"),
        })
    }

    /// The track description.
    ///
    /// # Panics
    /// Never: a test reads every file.
    pub fn track(self) -> Track {
        match self.file() {
            Some(text) => Track::parse(text).expect("a test reads every preset"),
            None if self == Self::VTrack => enlarged(self.name(), 1.0),
            None => enlarged(self.name(), REAL_SCALE),
        }
    }

    /// The preset to use for a track of which only the sleeper spacing in m is known.
    pub fn like(spacing_m: f64) -> Self {
        if spacing_m < LINE_SPACING_M { Self::VTrack } else { Self::Concrete60E1 }
    }

    /// Sections, masses, spacing and load.
    pub fn design(self) -> TrackDesign {
        self.track().design
    }

    /// Every parameter at its nominal value.
    pub fn nominal(self) -> ParameterSet {
        self.track().nominal
    }

    /// The range of one parameter.
    pub fn axis(self, parameter: Parameter) -> Axis {
        self.track().axis(parameter)
    }

    /// The space of all six parameters over their ranges.
    pub fn space(self) -> ParameterSpace {
        self.track().space()
    }

    /// The usual speeds in km/h.
    pub fn speeds_km_h(self) -> Vec<f64> {
        self.track().speeds_km_h
    }
}

/// V-Track with all lengths multiplied by `ratio`. If `ratio` is above one, the surface is that of a
/// real rail.
fn enlarged(name: &str, ratio: f64) -> Track {
    let mut nominal = ParameterSet::nominal();
    let mut ranges = [[0.0; 2]; Parameter::COUNT];
    for &parameter in Parameter::ALL {
        nominal[parameter] = parameter.enlarged(parameter.nominal(), ratio);
        ranges[parameter.index()] = parameter.range().map(|v| parameter.enlarged(v, ratio));
    }
    let mut prior = Prior::v_track().enlarged(ratio);
    if ratio > 1.0 {
        nominal[Parameter::IrregularityLevel] = REAL_LEVEL;
        prior.median[Parameter::IrregularityLevel] = REAL_LEVEL;
        ranges[Parameter::IrregularityLevel.index()] = REAL_LEVELS;
    }
    Track {
        name: name.to_owned(),
        design: TrackDesign::v_track().enlarged(ratio),
        nominal,
        ranges,
        scales: [Scale::Linear; Parameter::COUNT],
        prior,
        wavelengths_m: WAVELENGTHS_M,
        speeds_km_h: [7.0, 10.0, 13.0].map(|speed| speed * ratio).to_vec(),
    }
}

/// Length on the track `real-scale` over length on V-Track.
pub(crate) const REAL_SCALE: f64 = 5.0;

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
    fn every_preset_is_a_track_of_its_name() {
        for preset in Preset::ALL {
            let track = preset.track();
            assert_eq!(track.name, preset.name());
            assert_eq!(Preset::from_name(&track.name), Some(*preset));
            assert_eq!(Track::parse(&preset.text()).unwrap().design, track.design);
            // The section's bending stiffness is the nominal one.
            let stated = track.design.sleeper.section.bending_stiffness();
            let nominal = track.nominal[Parameter::SleeperBendingStiffness];
            let is_line = preset.file().is_some();
            assert!(!is_line || (stated / nominal - 1.0).abs() < 0.01, "{preset:?} {stated}");
        }
    }

    #[test]
    fn v_track_is_the_catalogue_itself() {
        assert_eq!(Preset::VTrack.nominal(), ParameterSet::nominal());
        assert_eq!(Preset::VTrack.design(), TrackDesign::v_track());
    }
}
