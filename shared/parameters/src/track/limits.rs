//! Limits of the numbers of a track file, singly and in combination.

use super::file::{File, SleeperTable};
use super::{TRACK_FORMAT, TrackError};
use crate::Parameter;
use crate::quantity::SPEED;

/// A number of the file and its allowed values.
struct Limit {
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    of: fn(&File) -> f64,
}

/// Limits of single numbers: from a tenth of the value of the smallest test rig to ten times that of the
/// largest railway. They detect an error of units by a factor of a thousand.
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

impl File {
    pub(super) fn check(&self) -> Result<(), TrackError> {
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

pub(super) fn check_parameter(
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

/// Probable cause of a value outside its range.
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
