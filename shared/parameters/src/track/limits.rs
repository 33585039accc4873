//! Limits of the numbers of a track file, singly and in combination.

use super::file::{File, SleeperTable};
use super::{TRACK_FORMAT, TrackError};
use crate::quantity::SPEED;
use crate::{DesignNumber, Parameter, check_wavelengths};

/// Largest distance of a further wheel in m.
const WHEELS_MAX_M: f64 = 30.0;

impl File {
    pub(super) fn check(&self) -> Result<(), TrackError> {
        if self.format != TRACK_FORMAT {
            return Err(TrackError::Format(self.format.clone()));
        }
        let design = self.design();
        for number in DesignNumber::ALL {
            in_range(number.key(), number.value(&design), number.unit(), number.range())?;
        }
        let deviation = self.surface.slope_deviation;
        in_range("surface.slope_deviation", deviation, "", [0.0, 5.0])?;
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
        let all = || [0.0].iter().chain(wheels);
        let touches = |(number, place): &(usize, &f64)| {
            let mut before = all().take(number + 1);
            before.any(|other| (*place - other).abs() < 2.0 * radius_m)
        };
        let possible = -WHEELS_MAX_M..=WHEELS_MAX_M;
        if let Some(place) = wheels.iter().find(|place| !possible.contains(place)) {
            let wanted =
                format!("{place} m is no distance of an axle; it is at most {WHEELS_MAX_M} m");
            return Err(TrackError::Inconsistent {
                key: "vehicle.further_wheels_m",
                message: wanted,
            });
        }
        if let Some((_, place)) = wheels.iter().enumerate().find(touches) {
            return Err(TrackError::Inconsistent {
                key: "vehicle.further_wheels_m",
                message: format!(
                    "a wheel {place} m ahead touches another one; their radius is {radius_m} m; give the distance of \
                     each axle from the first in m"
                ),
            });
        }
        check_wavelengths(self.surface.wavelengths_m).map_err(|error| {
            TrackError::Inconsistent { key: "surface.wavelengths_m", message: error.to_string() }
        })?;
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
        let key = format!("parameters.{parameter}.{name}");
        in_range(&key, value, parameter.unit(), parameter.quantity().range)?;
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

fn in_range(
    key: &str,
    value: f64,
    unit: &'static str,
    [low, high]: [f64; 2],
) -> Result<(), TrackError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let (key, hint) = (key.to_owned(), hint(value, [low, high]));
    Err(TrackError::OutOfRange { key, value, unit, low, high, hint })
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
