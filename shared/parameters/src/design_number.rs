//! Numbers of a track's design, and their variation from case to case of a campaign.

use crate::{Scale, TrackDesign};
use serde::de::{Deserializer, Error};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A number of a [`TrackDesign`]: its key in a track file, its unit and its allowed range.
#[derive(Clone, Copy, Serialize)]
#[serde(into = "String")]
pub struct DesignNumber {
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    place: fn(&mut TrackDesign) -> &mut f64,
}

impl DesignNumber {
    /// All numbers, in the order of a track file. Their ranges extend from a tenth of the value of the
    /// smallest test rig to ten times that of the largest railway. They detect an error of units by a
    /// factor of a thousand.
    pub const ALL: [Self; 20] = [
        number("track.railhead_radius_m", "m", [5e-3, 5.0], |it| &mut it.railhead_radius_m),
        number("track.rail.area_m2", "m2", [1e-4, 5e-2], |it| &mut it.rail.area_m2),
        number("track.rail.second_moment_m4", "m4", [1e-8, 1e-3], |it| {
            &mut it.rail.second_moment_m4
        }),
        number("track.rail.youngs_Pa", "Pa", [1e10, 1e12], |it| &mut it.rail.youngs_modulus_pa),
        number("track.rail.density_kg_m3", "kg/m3", [1e3, 2e4], |it| &mut it.rail.density_kg_m3),
        number("track.rail.poisson", "", [0.0, 0.49], |it| &mut it.rail.poisson),
        number("track.rail.shear_coefficient", "", [0.1, 1.0], |it| &mut it.rail.shear_coefficient),
        number("track.rail.damping_s", "s", [0.0, 1e-4], |it| &mut it.rail_damping_s),
        number("track.sleeper.spacing_m", "m", [0.02, 2.0], |it| &mut it.sleeper.spacing_m),
        number("track.sleeper.half_length_m", "m", [0.05, 3.0], |it| &mut it.sleeper.half_length_m),
        number("track.sleeper.rail_seat_m", "m", [0.0, 3.0], |it| &mut it.sleeper.rail_seat_m),
        number("track.sleeper.area_m2", "m2", [1e-5, 0.5], |it| &mut it.sleeper.section.area_m2),
        number("track.sleeper.second_moment_m4", "m4", [1e-10, 1e-2], |it| {
            &mut it.sleeper.section.second_moment_m4
        }),
        number("track.sleeper.youngs_Pa", "Pa", [1e9, 1e12], |it| {
            &mut it.sleeper.section.youngs_modulus_pa
        }),
        number("track.sleeper.density_kg_m3", "kg/m3", [1e2, 2e4], |it| {
            &mut it.sleeper.section.density_kg_m3
        }),
        number("track.sleeper.poisson", "", [0.0, 0.49], |it| &mut it.sleeper.section.poisson),
        number("track.sleeper.shear_coefficient", "", [0.1, 1.0], |it| {
            &mut it.sleeper.section.shear_coefficient
        }),
        number("vehicle.mass_kg", "kg", [4.0, 1e4], |it| &mut it.wheel.mass_kg),
        number("vehicle.load_N", "N", [4e2, 1e6], |it| &mut it.wheel.load_n),
        number("vehicle.radius_m", "m", [0.01, 2.0], |it| &mut it.wheel.radius_m),
    ];

    /// The number with this key. `None` for an unknown key.
    pub fn named(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|number| number.key == key)
    }

    /// Index in [`DesignNumber::ALL`].
    pub fn index(self) -> usize {
        Self::ALL.iter().position(|number| *number == self).unwrap_or(Self::ALL.len())
    }

    /// Key in a track file: `vehicle.mass_kg`.
    pub const fn key(self) -> &'static str {
        self.key
    }

    /// Unit as plain text. Empty for ratios.
    pub const fn unit(self) -> &'static str {
        self.unit
    }

    /// Lowest and highest allowed value.
    pub const fn range(self) -> [f64; 2] {
        self.range
    }

    /// Returns the value if it is in the allowed range.
    ///
    /// # Errors
    /// [`DesignAxisError::OutOfRange`] if the value is out of range, infinite or NaN.
    pub fn check(self, value: f64) -> Result<f64, DesignAxisError> {
        let Self { key, unit, range: [low, high], .. } = self;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(DesignAxisError::OutOfRange { key, value, unit, low, high })
    }

    /// The value in a design.
    pub fn value(self, design: &TrackDesign) -> f64 {
        *(self.place)(&mut design.clone())
    }

    /// Changes the value in a design.
    pub fn set(self, design: &mut TrackDesign, value: f64) {
        *(self.place)(design) = value;
    }
}

const fn number(
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    place: fn(&mut TrackDesign) -> &mut f64,
) -> DesignNumber {
    DesignNumber { key, unit, range, place }
}

impl PartialEq for DesignNumber {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl fmt::Debug for DesignNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.key)
    }
}

impl From<DesignNumber> for String {
    fn from(number: DesignNumber) -> Self {
        number.key.to_owned()
    }
}

impl TryFrom<String> for DesignNumber {
    type Error = String;

    fn try_from(key: String) -> Result<Self, Self::Error> {
        Self::named(&key).ok_or_else(|| {
            let keys: Vec<_> = Self::ALL.iter().map(|number| number.key).collect();
            format!(
                "`{key}` is not a number of a track file that can vary; these can: {}",
                keys.join(", ")
            )
        })
    }
}

impl<'de> Deserialize<'de> for DesignNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::try_from(String::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

/// A number of the design that differs from case to case of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignAxis {
    /// The number.
    pub number: DesignNumber,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Scale on which the values are uniform.
    #[serde(default)]
    pub scale: Scale,
}

/// Why a [`DesignAxis`] is invalid. Each message has one line and begins with the key.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignAxisError {
    /// A value is outside the allowed range of its number.
    #[error("{key}: {value} {unit} cannot be; it must lie in {low} to {high} {unit}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// The value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Lowest possible value.
        low: f64,
        /// Highest possible value.
        high: f64,
    },
    /// The range is empty or reversed.
    #[error("{key}: the range [{low}, {high}] is reversed or empty; write the lower end first")]
    Reversed {
        /// The key.
        key: &'static str,
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
    },
    /// A logarithmic scale begins at zero.
    #[error("{0}: a logarithmic scale needs a lower end above zero")]
    NotPositive(&'static str),
    /// A number has two axes.
    #[error("{0}: duplicate axis")]
    Twice(&'static str),
    /// The rail seat can lie beyond the end of the sleeper.
    #[error(
        "track.sleeper.rail_seat_m: {seat_m} m lies outside the half sleeper of {half_length_m} m"
    )]
    RailSeat {
        /// Largest distance of the rail seat from the sleeper's middle in m.
        seat_m: f64,
        /// Smallest half length in m.
        half_length_m: f64,
    },
}

impl DesignAxis {
    /// The value at a relative position in the range, from 0 (lowest) to 1 (highest).
    pub fn at(&self, share: f64) -> f64 {
        self.scale.at([self.low, self.high], share)
    }

    /// Checks the axes of a campaign on a track of this design.
    ///
    /// # Errors
    /// [`DesignAxisError`] with the key of the invalid axis.
    pub fn check_all(axes: &[Self], design: &TrackDesign) -> Result<(), DesignAxisError> {
        for (place, axis) in axes.iter().enumerate() {
            axis.check()?;
            if axes[..place].iter().any(|other| other.number == axis.number) {
                return Err(DesignAxisError::Twice(axis.number.key));
            }
        }
        let [mut low, mut high] = [design.clone(), design.clone()];
        for axis in axes {
            axis.number.set(&mut low, axis.low);
            axis.number.set(&mut high, axis.high);
        }
        let (seat_m, half_length_m) = (high.sleeper.rail_seat_m, low.sleeper.half_length_m);
        if seat_m > half_length_m {
            return Err(DesignAxisError::RailSeat { seat_m, half_length_m });
        }
        Ok(())
    }

    fn check(&self) -> Result<(), DesignAxisError> {
        let &Self { number, low, high, scale } = self;
        let key = number.key;
        number.check(low).and_then(|_| number.check(high))?;
        if low >= high {
            return Err(DesignAxisError::Reversed { key, low, high });
        }
        if scale == Scale::Logarithmic && low <= 0.0 {
            return Err(DesignAxisError::NotPositive(key));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(key: &str, low: f64, high: f64) -> DesignAxis {
        let number = DesignNumber::named(key).unwrap();
        DesignAxis { number, low, high, scale: Scale::Linear }
    }

    #[test]
    fn every_number_is_read_where_it_is_written() {
        for number in DesignNumber::ALL {
            let mut design = TrackDesign::v_track();
            let other = 1.5 * number.value(&design) + 0.01 * number.range()[1];
            number.set(&mut design, other);
            assert_eq!(number.value(&design), other, "{}", number.key());
            let mut reset = design.clone();
            number.set(&mut reset, number.value(&TrackDesign::v_track()));
            assert_eq!(reset, TrackDesign::v_track(), "{} changes one number only", number.key());
        }
    }

    #[test]
    fn an_axis_survives_its_json_and_an_unknown_key_does_not() {
        let mass = axis("vehicle.mass_kg", 40.0, 50.0);
        let json = serde_json::to_string(&mass).unwrap();
        assert_eq!(serde_json::from_str::<DesignAxis>(&json).unwrap(), mass);
        let error = serde_json::from_str::<DesignAxis>(&json.replace("mass_kg", "mas_kg"));
        let message = error.unwrap_err().to_string();
        assert!(message.contains("vehicle.mas_kg") && message.contains("vehicle.mass_kg"));
    }

    #[test]
    fn axes_that_cannot_be_are_refused_with_their_key() {
        let refused = |axes: &[DesignAxis]| {
            DesignAxis::check_all(axes, &TrackDesign::v_track()).unwrap_err().to_string()
        };
        let mass = axis("vehicle.mass_kg", 40.0, 50.0);
        assert_eq!(DesignAxis::check_all(&[mass], &TrackDesign::v_track()), Ok(()));
        for (axes, beginning) in [
            (vec![axis("vehicle.mass_kg", 50.0, 40.0)], "vehicle.mass_kg: the range [50, 40]"),
            (vec![axis("vehicle.mass_kg", 0.05, 50.0)], "vehicle.mass_kg: 0.05 kg cannot be"),
            (vec![axis("vehicle.mass_kg", f64::NAN, 50.0)], "vehicle.mass_kg: NaN kg cannot be"),
            (vec![mass, mass], "vehicle.mass_kg: duplicate axis"),
            (
                vec![DesignAxis {
                    scale: Scale::Logarithmic,
                    ..axis("track.rail.damping_s", 0.0, 1e-6)
                }],
                "track.rail.damping_s: a logarithmic scale",
            ),
            (
                vec![axis("track.sleeper.rail_seat_m", 0.0, 0.3)],
                "track.sleeper.rail_seat_m: 0.3 m lies outside",
            ),
        ] {
            let message = refused(&axes);
            assert!(message.starts_with(beginning), "{message}");
        }
    }
}
