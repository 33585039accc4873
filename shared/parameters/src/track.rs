//! A track as a user describes it: a file in TOML, or one that comes with the program.

use crate::{Axis, Parameter, ParameterSet, ParameterSpace, Preset, Prior, Scale, TrackDesign};
use crate::{BeamSection, SleeperDesign, Wheel};
use crate::quantity::SPEED;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Format of a track file.
pub const TRACK_FORMAT: &str = "tracktwin-track/1";

/// A track, its vehicle and its measurement, with what is known of the parameters before anything is
/// measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// What it is called.
    pub name: String,
    /// Sections, masses, spacing and load.
    pub design: TrackDesign,
    /// Usual value of every parameter.
    pub nominal: ParameterSet,
    /// Lowest and highest usual value of every parameter, in catalogue order.
    pub ranges: [[f64; 2]; Parameter::COUNT],
    /// How campaigns sample each range, in catalogue order.
    pub scales: [Scale; Parameter::COUNT],
    /// What is known of the parameters before a recording is evaluated.
    pub prior: Prior,
    /// Shortest and longest wavelength of the irregularity in m.
    pub wavelengths_m: [f64; 2],
    /// Speeds of the passes in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
}

/// Why a track file is refused; one line each.
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
    /// A number that cannot be what it is given for.
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
        /// A guess at the mistake.
        hint: &'static str,
    },
    /// Two numbers that cannot go together.
    #[error("{key}: {message}")]
    Inconsistent {
        /// The key.
        key: &'static str,
        /// What is wrong, and what to do.
        message: String,
    },
    /// A parameter without a value.
    #[error("parameters.{0}: is missing; give {{ nominal = VALUE, range = [LOW, HIGH] }}")]
    Missing(Parameter),
}

/// The file as it is written.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    name: String,
    track: TrackTable,
    vehicle: VehicleTable,
    surface: SurfaceTable,
    measurement: MeasurementTable,
    parameters: BTreeMap<String, ParameterTable>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackTable {
    railhead_radius_m: f64,
    rail: RailTable,
    sleeper: SleeperTable,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RailTable {
    area_m2: f64,
    second_moment_m4: f64,
    #[serde(rename = "youngs_Pa")]
    youngs_pa: f64,
    density_kg_m3: f64,
    poisson: f64,
    shear_coefficient: f64,
    damping_s: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SleeperTable {
    spacing_m: f64,
    half_length_m: f64,
    rail_seat_m: f64,
    area_m2: f64,
    second_moment_m4: f64,
    #[serde(rename = "youngs_Pa")]
    youngs_pa: f64,
    density_kg_m3: f64,
    poisson: f64,
    shear_coefficient: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct VehicleTable {
    mass_kg: f64,
    #[serde(rename = "load_N")]
    load_n: f64,
    radius_m: f64,
    #[serde(default)]
    further_wheels_m: Vec<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceTable {
    wavelengths_m: [f64; 2],
    contact_patch_filter: bool,
    slope_deviation: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MeasurementTable {
    speeds_km_h: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterTable {
    nominal: f64,
    range: [f64; 2],
    #[serde(default)]
    scale: Scale,
}

/// What a number of the file is, and the values that it can have.
struct Limit {
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    of: fn(&File) -> f64,
}

/// Limits of single numbers: a tenth of what the smallest test rig has to ten times what the largest
/// railway has, so that a mistake of units by a thousand is seen.
const LIMITS: [Limit; 20] = [
    limit("track.railhead_radius_m", "m", [5e-3, 5.0], |it| it.track.railhead_radius_m),
    limit("track.rail.area_m2", "m2", [1e-4, 5e-2], |it| it.track.rail.area_m2),
    limit("track.rail.second_moment_m4", "m4", [1e-8, 1e-3], |it| it.track.rail.second_moment_m4),
    limit("track.rail.youngs_Pa", "Pa", [1e10, 1e12], |it| it.track.rail.youngs_pa),
    limit("track.rail.density_kg_m3", "kg/m3", [1e3, 2e4], |it| it.track.rail.density_kg_m3),
    limit("track.rail.poisson", "", [0.0, 0.49], |it| it.track.rail.poisson),
    limit("track.rail.shear_coefficient", "", [0.1, 1.0], |it| it.track.rail.shear_coefficient),
    limit("track.rail.damping_s", "s", [0.0, 1e-4], |it| it.track.rail.damping_s),
    limit("track.sleeper.spacing_m", "m", [0.02, 2.0], |it| it.track.sleeper.spacing_m),
    limit("track.sleeper.half_length_m", "m", [0.05, 3.0], |it| it.track.sleeper.half_length_m),
    limit("track.sleeper.area_m2", "m2", [1e-5, 0.5], |it| it.track.sleeper.area_m2),
    limit("track.sleeper.second_moment_m4", "m4", [1e-10, 1e-2], |it| {
        it.track.sleeper.second_moment_m4
    }),
    limit("track.sleeper.youngs_Pa", "Pa", [1e9, 1e12], |it| it.track.sleeper.youngs_pa),
    limit("track.sleeper.density_kg_m3", "kg/m3", [1e2, 2e4], |it| it.track.sleeper.density_kg_m3),
    limit("track.sleeper.poisson", "", [0.0, 0.49], |it| it.track.sleeper.poisson),
    limit("track.sleeper.shear_coefficient", "", [0.1, 1.0], |it| {
        it.track.sleeper.shear_coefficient
    }),
    limit("vehicle.mass_kg", "kg", [4.0, 1e4], |it| it.vehicle.mass_kg),
    limit("vehicle.load_N", "N", [4e2, 1e6], |it| it.vehicle.load_n),
    limit("vehicle.radius_m", "m", [0.01, 2.0], |it| it.vehicle.radius_m),
    limit("surface.slope_deviation", "", [0.0, 5.0], |it| it.surface.slope_deviation),
];

const fn limit(
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    of: fn(&File) -> f64,
) -> Limit {
    Limit { key, unit, range, of }
}

impl Track {
    /// Reads a track file.
    ///
    /// # Errors
    /// [`TrackError`] says in a line what is wrong, where, and what can be.
    pub fn parse(text: &str) -> Result<Self, TrackError> {
        let file: File = toml::from_str(text).map_err(|error| TrackError::Malformed {
            line: line_of(text, error.span()),
            message: error.message().lines().collect::<Vec<_>>().join(" "),
        })?;
        file.check()?;
        let mut nominal = ParameterSet::nominal();
        let mut ranges = [[0.0; 2]; Parameter::COUNT];
        let mut scales = [Scale::Linear; Parameter::COUNT];
        for (name, &ParameterTable { nominal: value, range, scale }) in &file.parameters {
            let parameter = Parameter::try_from(name.clone())
                .map_err(|message| TrackError::Inconsistent { key: "parameters", message })?;
            check_parameter(parameter, value, range)?;
            nominal[parameter] = value;
            ranges[parameter.index()] = range;
            scales[parameter.index()] = scale;
        }
        let missing = |parameter: &&Parameter| !file.parameters.contains_key(parameter.name());
        if let Some(&parameter) = Parameter::ALL.iter().find(missing) {
            return Err(TrackError::Missing(parameter));
        }
        Ok(Self {
            name: file.name.clone(),
            design: file.design(),
            prior: Prior::of_ranges(nominal, &ranges, file.surface.slope_deviation),
            nominal,
            ranges,
            scales,
            wavelengths_m: file.surface.wavelengths_m,
            speeds_km_h: file.measurement.speeds_km_h,
        })
    }

    /// The track as a file, without comments.
    pub fn to_toml(&self) -> String {
        let TrackDesign { rail, sleeper, wheel, .. } = &self.design;
        let section = &sleeper.section;
        let parameter = |&parameter: &Parameter| {
            let nominal = self.nominal[parameter];
            let range = self.ranges[parameter.index()];
            let scale = self.scales[parameter.index()];
            (parameter.name().to_owned(), ParameterTable { nominal, range, scale })
        };
        let file = File {
            format: TRACK_FORMAT.to_owned(),
            name: self.name.clone(),
            track: TrackTable {
                railhead_radius_m: self.design.railhead_radius_m,
                rail: RailTable {
                    area_m2: rail.area_m2,
                    second_moment_m4: rail.second_moment_m4,
                    youngs_pa: rail.youngs_modulus_pa,
                    density_kg_m3: rail.density_kg_m3,
                    poisson: rail.poisson,
                    shear_coefficient: rail.shear_coefficient,
                    damping_s: self.design.rail_damping_s,
                },
                sleeper: SleeperTable {
                    spacing_m: sleeper.spacing_m,
                    half_length_m: sleeper.half_length_m,
                    rail_seat_m: sleeper.rail_seat_m,
                    area_m2: section.area_m2,
                    second_moment_m4: section.second_moment_m4,
                    youngs_pa: section.youngs_modulus_pa,
                    density_kg_m3: section.density_kg_m3,
                    poisson: section.poisson,
                    shear_coefficient: section.shear_coefficient,
                },
            },
            vehicle: VehicleTable {
                mass_kg: wheel.mass_kg,
                load_n: wheel.load_n,
                radius_m: wheel.radius_m,
                further_wheels_m: wheel.further_wheels_m.clone(),
            },
            surface: SurfaceTable {
                wavelengths_m: self.wavelengths_m,
                contact_patch_filter: self.design.contact_patch_filter,
                slope_deviation: self.prior.slope_deviation,
            },
            measurement: MeasurementTable { speeds_km_h: self.speeds_km_h.clone() },
            parameters: Parameter::ALL.iter().map(parameter).collect(),
        };
        toml::to_string(&file).expect("numbers and names become TOML")
    }

    /// The usual range of one parameter, as an axis of a campaign.
    pub fn axis(&self, parameter: Parameter) -> Axis {
        let [low, high] = self.ranges[parameter.index()];
        Axis { parameter, low, high, scale: self.scales[parameter.index()] }
    }

    /// All six parameters over their usual ranges.
    pub fn space(&self) -> ParameterSpace {
        let axes = Parameter::ALL.iter().map(|&parameter| self.axis(parameter)).collect();
        ParameterSpace::new(axes).expect("ranges are checked")
    }

    /// The same track with another design; a stated section gives the sleeper's bending stiffness.
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

    /// What comes with the program and has this design, or else the one whose sleepers are spaced most
    /// like it, with this design.
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

impl File {
    fn design(&self) -> TrackDesign {
        let TrackTable { railhead_radius_m, rail, sleeper } = &self.track;
        TrackDesign {
            rail: BeamSection {
                area_m2: rail.area_m2,
                second_moment_m4: rail.second_moment_m4,
                youngs_modulus_pa: rail.youngs_pa,
                density_kg_m3: rail.density_kg_m3,
                poisson: rail.poisson,
                shear_coefficient: rail.shear_coefficient,
            },
            rail_damping_s: rail.damping_s,
            sleeper: SleeperDesign {
                spacing_m: sleeper.spacing_m,
                half_length_m: sleeper.half_length_m,
                rail_seat_m: sleeper.rail_seat_m,
                section: BeamSection {
                    area_m2: sleeper.area_m2,
                    second_moment_m4: sleeper.second_moment_m4,
                    youngs_modulus_pa: sleeper.youngs_pa,
                    density_kg_m3: sleeper.density_kg_m3,
                    poisson: sleeper.poisson,
                    shear_coefficient: sleeper.shear_coefficient,
                },
            },
            railhead_radius_m: *railhead_radius_m,
            wheel: Wheel {
                mass_kg: self.vehicle.mass_kg,
                load_n: self.vehicle.load_n,
                radius_m: self.vehicle.radius_m,
                further_wheels_m: self.vehicle.further_wheels_m.clone(),
            },
            contact_patch_filter: self.surface.contact_patch_filter,
        }
    }

    fn check(&self) -> Result<(), TrackError> {
        if self.format != TRACK_FORMAT {
            return Err(TrackError::Format(self.format.clone()));
        }
        for &Limit { key, unit, range: [low, high], of } in &LIMITS {
            let value = of(self);
            if !(low..=high).contains(&value) {
                let (key, hint) = (key.to_owned(), hint(value, [low, high]));
                return Err(TrackError::OutOfRange { key, value, unit, low, high, hint });
            }
        }
        self.check_together()
    }

    fn check_together(&self) -> Result<(), TrackError> {
        let SleeperTable { rail_seat_m, half_length_m, .. } = self.track.sleeper;
        if !(0.0..=half_length_m).contains(&rail_seat_m) {
            return Err(TrackError::Inconsistent {
                key: "track.sleeper.rail_seat_m",
                message: format!(
                    "{rail_seat_m} m lies outside the half sleeper of {half_length_m} m; give the \
                     distance of the rail seat from the sleeper's middle"
                ),
            });
        }
        let wheels = &self.vehicle.further_wheels_m;
        let radius_m = self.vehicle.radius_m;
        let overlaps = |place: &&f64| !place.is_finite() || place.abs() < 2.0 * radius_m;
        if let Some(place) = wheels.iter().find(overlaps) {
            return Err(TrackError::Inconsistent {
                key: "vehicle.further_wheels_m",
                message: format!(
                    "a wheel {place} m ahead touches the first one, whose radius is {radius_m} m; \
                     give the distance of the axles in m"
                ),
            });
        }
        let [shortest, longest] = self.surface.wavelengths_m;
        if !(shortest > 0.0 && shortest < longest && longest.is_finite()) {
            return Err(TrackError::Inconsistent {
                key: "surface.wavelengths_m",
                message: format!(
                    "[{shortest}, {longest}] must be two positive lengths in m, the shorter first"
                ),
            });
        }
        let speeds = &self.measurement.speeds_km_h;
        let ascending = speeds.windows(2).all(|pair| pair[0] < pair[1]);
        let [slowest, fastest] = SPEED.range;
        let possible = speeds.iter().all(|speed| (slowest..=fastest).contains(speed));
        if speeds.is_empty() || !ascending || !possible {
            return Err(TrackError::Inconsistent {
                key: "measurement.speeds_km_h",
                message: format!(
                    "{speeds:?} must be one or more speeds in km/h from {slowest} to {fastest}, \
                     ascending and without duplicates"
                ),
            });
        }
        Ok(())
    }
}

fn check_parameter(
    parameter: Parameter,
    nominal: f64,
    [low, high]: [f64; 2],
) -> Result<(), TrackError> {
    for (name, value) in [("nominal", nominal), ("range", low), ("range", high)] {
        let quantity = parameter.quantity();
        let [least, most] = quantity.range;
        if !(least..=most).contains(&value) {
            return Err(TrackError::OutOfRange {
                key: format!("parameters.{parameter}.{name}"),
                value,
                unit: parameter.unit(),
                low: least,
                high: most,
                hint: hint(value, quantity.range),
            });
        }
    }
    if !(low < high && (low..=high).contains(&nominal)) {
        return Err(TrackError::Inconsistent {
            key: "parameters",
            message: format!(
                "{parameter}: nominal {nominal} and range [{low}, {high}] do not go together; \
                 write the lower end first, and a nominal value inside"
            ),
        });
    }
    Ok(())
}

/// What is probably wrong with a value outside a range.
fn hint(value: f64, [low, high]: [f64; 2]) -> &'static str {
    let inside = |value: f64| (low..=high).contains(&value);
    if value < 0.0 && inside(-value) {
        "; the sign is wrong"
    } else if inside(value * 1e-3) || inside(value * 1e3) {
        "; is the unit wrong by a factor of 1000?"
    } else {
        ""
    }
}

/// The line, from 1, at which a span of `text` begins.
fn line_of(text: &str, span: Option<std::ops::Range<usize>>) -> usize {
    let start = span.map_or(0, |span| span.start.min(text.len()));
    text[..start].matches('\n').count() + 1
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
