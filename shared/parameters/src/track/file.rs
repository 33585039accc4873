//! Reading and writing of a track file.

use super::limits::check_parameter;
use super::{TRACK_FORMAT, Track, TrackError};
use crate::{
    BeamSection, Parameter, ParameterSet, Prior, Scale, SleeperDesign, TrackDesign, Wheel,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Structure of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) format: String,
    pub(super) name: String,
    pub(super) track: TrackTable,
    pub(super) vehicle: VehicleTable,
    pub(super) surface: SurfaceTable,
    pub(super) measurement: MeasurementTable,
    pub(super) parameters: BTreeMap<String, ParameterTable>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrackTable {
    pub(super) railhead_radius_m: f64,
    pub(super) rail: RailTable,
    pub(super) sleeper: SleeperTable,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RailTable {
    pub(super) area_m2: f64,
    pub(super) second_moment_m4: f64,
    #[serde(rename = "youngs_Pa")]
    pub(super) youngs_pa: f64,
    pub(super) density_kg_m3: f64,
    pub(super) poisson: f64,
    pub(super) shear_coefficient: f64,
    pub(super) damping_s: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SleeperTable {
    pub(super) spacing_m: f64,
    pub(super) half_length_m: f64,
    pub(super) rail_seat_m: f64,
    pub(super) area_m2: f64,
    pub(super) second_moment_m4: f64,
    #[serde(rename = "youngs_Pa")]
    pub(super) youngs_pa: f64,
    pub(super) density_kg_m3: f64,
    pub(super) poisson: f64,
    pub(super) shear_coefficient: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VehicleTable {
    pub(super) mass_kg: f64,
    #[serde(rename = "load_N")]
    pub(super) load_n: f64,
    pub(super) radius_m: f64,
    #[serde(default)]
    pub(super) further_wheels_m: Vec<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceTable {
    pub(super) wavelengths_m: [f64; 2],
    pub(super) contact_patch_filter: bool,
    pub(super) slope_deviation: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeasurementTable {
    pub(super) speeds_km_h: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterTable {
    pub(super) nominal: f64,
    pub(super) range: [f64; 2],
    #[serde(default)]
    pub(super) scale: Scale,
}

impl Track {
    /// Reads a track file.
    ///
    /// # Errors
    /// [`TrackError`] states the fault, its place and the allowed values in one line.
    pub fn parse(text: &str) -> Result<Self, TrackError> {
        let file: File = toml::from_str(text).map_err(|error| {
            let (line, message) = toml_fault(text, &error);
            TrackError::Malformed { line, message }
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
}

impl File {
    pub(super) fn design(&self) -> TrackDesign {
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
}

/// The line number, from 1, of a syntax error in a TOML text, and the message of the parser in one line.
pub fn toml_fault(text: &str, error: &toml::de::Error) -> (usize, String) {
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    let message = error.message().lines().collect::<Vec<_>>().join(" ");
    (text[..start].matches('\n').count() + 1, message)
}
