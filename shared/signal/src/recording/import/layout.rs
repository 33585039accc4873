//! Layout of a table: names and units of its columns, and values missing in the file.

use super::unit::{AccelerationUnit, PositionUnit, SpeedUnit, TimeUnit};
use serde::Deserialize;
use tracktwin_parameters::QuantityError;
use tracktwin_parameters::quantity::{PLACE, SAMPLE_RATE, SPACING, SPEED, WHEEL_RADIUS};

/// Meaning of the columns, from a TOML file or flags.
///
/// The position of the wheel comes from the column `position`, otherwise from the integral of the column
/// `speed`, otherwise from the constant speed `speed_km_h`. The sample rate comes from `sample_rate_hz`,
/// otherwise from `time`. Values given twice must agree. Units that are not given come from the file or
/// the column names, otherwise they are m/s2, s, m and km/h.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Layout {
    /// Columns of vertical axle-box acceleration; each becomes a recording.
    pub acceleration: Vec<String>,
    /// Column of the time.
    pub time: Option<String>,
    /// Column of the position.
    pub position: Option<String>,
    /// Column of the speed.
    pub speed: Option<String>,
    /// Unit of the accelerations.
    pub acceleration_unit: Option<AccelerationUnit>,
    /// Unit of the time.
    pub time_unit: Option<TimeUnit>,
    /// Unit of the position.
    pub position_unit: Option<PositionUnit>,
    /// Unit of the speed column.
    pub speed_unit: Option<SpeedUnit>,
    /// Whether the accelerations in the file are positive upwards. The import then changes their sign.
    pub upwards: bool,
    /// Samples per second in Hz.
    #[serde(rename = "sample_rate_Hz")]
    pub sample_rate_hz: Option<f64>,
    /// Speed of all passes in km/h.
    pub speed_km_h: Option<f64>,
    /// Sleeper spacing in m. `None`: the usual one of main lines is assumed ([`Layout::spacing_m`]).
    pub spacing_m: Option<f64>,
    /// Position of one sleeper in m. `None`: unknown; the recording then has no sleepers.
    pub sleeper_m: Option<f64>,
    /// Radius of the wheel in m, if known.
    pub wheel_radius_m: Option<f64>,
}

/// A value of a layout outside its limits.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{entry}: {source}")]
pub struct LayoutError {
    /// The entry.
    pub entry: &'static str,
    /// What is wrong.
    pub source: QuantityError,
}

/// Sleeper spacing in m that is assumed: the commonest in main lines.
const SPACING_M: f64 = 0.6;

impl Layout {
    /// The stated sleeper spacing in m, or the assumed one.
    pub fn spacing_m(&self) -> f64 {
        self.spacing_m.unwrap_or(SPACING_M)
    }

    /// Note on an assumed sleeper spacing.
    pub(super) fn assumed(&self) -> Option<String> {
        let note =
            format!("a sleeper spacing of {SPACING_M} m is assumed; state it with --spacing");
        self.spacing_m.is_none().then_some(note)
    }

    /// Checks that every number is within its limits.
    ///
    /// # Errors
    /// [`LayoutError`] names the first value out of limits.
    pub fn check(&self) -> Result<(), LayoutError> {
        let given = [
            ("sample_rate_Hz", self.sample_rate_hz, SAMPLE_RATE),
            ("speed_km_h", self.speed_km_h, SPEED),
            ("spacing_m", self.spacing_m, SPACING),
            ("sleeper_m", self.sleeper_m, PLACE),
            ("wheel_radius_m", self.wheel_radius_m, WHEEL_RADIUS),
        ];
        for (entry, value, of) in given {
            value
                .map(|value| of.check(value))
                .transpose()
                .map_err(|source| LayoutError { entry, source })?;
        }
        Ok(())
    }
}
