//! The track description: a TOML file, or a preset of the program.

mod file;
mod limits;

pub use file::toml_fault;

use crate::{Axis, Parameter, ParameterSet, ParameterSpace, Preset, Prior, Scale, TrackDesign};

/// Format of a track file.
pub const TRACK_FORMAT: &str = "tracktwin-track/1";

/// A track description: track, vehicle, measurement, and priors of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Name of the track.
    pub name: String,
    /// Sections, masses, spacing and load.
    pub design: TrackDesign,
    /// Usual value of every parameter.
    pub nominal: ParameterSet,
    /// Lowest and highest usual value of every parameter, in catalogue order.
    pub ranges: [[f64; 2]; Parameter::COUNT],
    /// How campaigns sample each range, in catalogue order.
    pub scales: [Scale; Parameter::COUNT],
    /// Prior of the parameters.
    pub prior: Prior,
    /// Shortest and longest wavelength of the irregularity in m.
    pub wavelengths_m: [f64; 2],
    /// Speeds of the passes in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
}

/// Why a track file is invalid. Each message has one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// Not TOML, an unknown key, or a value of the wrong type.
    #[error("line {line}: {message}")]
    Malformed {
        /// The line, from 1.
        line: usize,
        /// Error of the parser.
        message: String,
    },
    /// The file has another format.
    #[error("format: {0:?} is not known; this version reads {TRACK_FORMAT:?}")]
    Format(String),
    /// A number is outside its allowed range.
    #[error("{key}: {value} {unit} cannot be; it must lie in {low} to {high} {unit}{hint}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Lowest possible value.
        low: f64,
        /// Highest possible value.
        high: f64,
        /// Probable cause.
        hint: &'static str,
    },
    /// Two numbers contradict each other.
    #[error("{key}: {message}")]
    Inconsistent {
        /// The key.
        key: &'static str,
        /// The contradiction and its remedy.
        message: String,
    },
    /// A parameter has no value.
    #[error("parameters.{0}: is missing; give {{ nominal = VALUE, range = [LOW, HIGH] }}")]
    Missing(Parameter),
}

impl Track {
    /// The usual range of one parameter, as an axis of a campaign.
    pub fn axis(&self, parameter: Parameter) -> Axis {
        let [low, high] = self.ranges[parameter.index()];
        Axis { parameter, low, high, scale: self.scales[parameter.index()] }
    }

    /// The space of all six parameters over their usual ranges.
    pub fn space(&self) -> ParameterSpace {
        let axes = Parameter::ALL.iter().map(|&parameter| self.axis(parameter)).collect();
        ParameterSpace::new(axes).expect("ranges are checked")
    }

    /// The track with another design. Nominal value, prior median and range of the bending stiffness of
    /// the sleeper scale with the section of the design.
    #[must_use]
    pub fn with_design(mut self, design: TrackDesign) -> Self {
        let index = Parameter::SleeperBendingStiffness.index();
        let ratio = design.sleeper.section.bending_stiffness()
            / self.design.sleeper.section.bending_stiffness();
        self.nominal[Parameter::SleeperBendingStiffness] *= ratio;
        self.prior.median[Parameter::SleeperBendingStiffness] *= ratio;
        self.ranges[index] = self.ranges[index].map(|end| end * ratio);
        Self { design, ..self }
    }

    /// The preset with this design. If there is none: the preset with the most similar sleeper spacing,
    /// with its design replaced by this one.
    pub fn of(design: TrackDesign) -> Self {
        let presets = Preset::ALL.iter().map(|preset| preset.track());
        let mut all: Vec<Self> = presets.collect();
        if let Some(same) = all.iter().position(|track| track.design == design) {
            return all.swap_remove(same);
        }
        Preset::like(design.sleeper.spacing_m).track().with_design(design)
    }
}

impl From<TrackDesign> for Track {
    fn from(design: TrackDesign) -> Self {
        Self::of(design)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text() -> String {
        Preset::Concrete60E1.track().to_toml()
    }

    fn refusal(from: &str, to: &str) -> String {
        let text = text();
        assert!(text.contains(from), "{text}");
        Track::parse(&text.replacen(from, to, 1)).unwrap_err().to_string()
    }

    #[test]
    fn a_track_survives_its_file() {
        let track = Preset::Concrete60E1.track();
        assert_eq!(Track::parse(&track.to_toml()).unwrap(), track);
    }

    #[test]
    fn a_bad_description_is_refused_in_a_line_that_names_the_key() {
        for (from, to, key) in [
            ("mass_kg = ", "mass_kg = -", "vehicle.mass_kg"),
            ("spacing_m = 0.6", "spacing_m = 600.0", "track.sleeper.spacing_m"),
            ("poisson = 0.3", "poisson = nan", "track.rail.poisson"),
            ("slope_deviation", "slop_deviation", "slop_deviation"),
            ("rail_seat_m = 0.75", "rail_seat_m = 1.75", "track.sleeper.rail_seat_m"),
            ("further_wheels_m = [", "further_wheels_m = [0.2, ", "vehicle.further_wheels_m"),
            ("tracktwin-track/1", "tracktwin-track/9", "tracktwin-track/9"),
        ] {
            let message = refusal(from, to);
            assert!(message.contains(key) && !message.contains('\n'), "{message}");
        }
        let message = refusal("spacing_m = 0.6", "spacing_m = 600.0");
        assert!(message.contains("factor of 1000"), "{message}");
    }

    #[test]
    fn a_design_without_a_preset_has_the_priors_of_the_preset_that_is_spaced_like_it() {
        let mut design = Preset::Concrete60E1.track().design;
        design.sleeper.section.second_moment_m4 *= 0.5;
        let track = Track::of(design.clone());
        assert_eq!(track.design, design);
        let preset = Preset::Concrete60E1.track().prior;
        let ratio = |parameter| track.prior.median[parameter] / preset.median[parameter];
        assert!((ratio(Parameter::SleeperBendingStiffness) - 0.5).abs() < 1e-12);
        assert!((ratio(Parameter::RailpadStiffness) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn v_track_is_the_catalogue_s() {
        let track = Track::of(TrackDesign::v_track());
        assert_eq!(track.prior, Prior::v_track());
        assert_eq!(track.nominal, ParameterSet::nominal());
    }
}
