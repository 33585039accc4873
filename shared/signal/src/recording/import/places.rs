//! Places of the wheel at every sample of a file: from positions, from speeds, or at constant speed.

use super::super::error::{Fault, RecordingError};
use super::unit::{PositionUnit, SpeedUnit, Unit, of_column};
use super::{Layout, Table};
use tracktwin_number::rounded;

/// Largest relative difference between two consistent values of one speed.
const ALIKE: f64 = 0.1;
/// Speeds in km/h within which a pass is plausible; the fastest train ran 575 km/h once.
const PLAUSIBLE_KM_H: [f64; 2] = [0.5, 500.0];
/// Changes to and fro from which on a column of speeds holds pulses.
const PULSES_MIN: usize = 8;
/// Part of its greatest value that a column of speeds covers where it holds pulses.
const PULSE_SHARE: f64 = 0.5;

/// Places as a file gives them.
pub(super) struct Places {
    /// What they were made from: the name of the column or entry.
    pub name: &'static str,
    /// Places in m at every sample, in the file's own direction.
    pub position_m: Vec<f64>,
    /// Unit of the column that they come from, and whether it was given.
    unit: (&'static str, bool),
    /// Speed of the speed column, where there is one beside the positions, in km/h.
    other_km_h: Option<f64>,
}

impl Places {
    /// From the first of position, column of speed, constant speed.
    pub(super) fn of(
        table: &Table,
        layout: &Layout,
        count: usize,
        rate_hz: f64,
        notes: &mut Vec<String>,
    ) -> Result<Self, RecordingError> {
        let speeds = speeds_m_s(table, layout, notes)?;
        let mean = |speeds: &(Vec<f64>, SpeedUnit)| {
            3.6 * speeds.0.iter().sum::<f64>() / speeds.0.len() as f64
        };
        let places = if layout.position.is_some() {
            let other_km_h = speeds.as_ref().map(mean);
            Self { other_km_h, ..Self::of_positions(table, layout, notes)? }
        } else if let Some((speeds, unit)) = speeds {
            let advance = |place: &mut f64, speed: f64| {
                let here = *place;
                *place += speed / rate_hz;
                Some(here)
            };
            let position_m = speeds.into_iter().scan(0.0, advance).collect();
            let unit = (unit.name(), layout.speed_unit.is_some());
            Self { name: "speed", position_m, unit, other_km_h: None }
        } else if let Some(speed) = layout.speed_km_h {
            let place = |index| index as f64 * speed / 3.6 / rate_hz;
            let position_m = (0..count).map(place).collect();
            Self { name: "speed_km_h", position_m, unit: ("km/h", true), other_km_h: None }
        } else {
            let remedy =
                "state `--speed KMH`, `--column position=NAME` or `--column speed=NAME`".to_owned();
            let fault = Fault::NoField { remedy };
            return Err(RecordingError::new(&table.path, "speed_km_h", fault));
        };
        if places.position_m.len() != count {
            let fault = Fault::LengthMismatch { rows: places.position_m.len(), others: count };
            return Err(RecordingError::new(&table.path, places.name, fault));
        }
        Ok(places)
    }

    fn of_positions(
        table: &Table,
        layout: &Layout,
        notes: &mut Vec<String>,
    ) -> Result<Self, RecordingError> {
        let column = table.column(layout.position.as_deref().unwrap_or_default())?;
        let fault = |fault| RecordingError::new(&table.path, "position", fault);
        let unit: PositionUnit = of_column(column, layout.position_unit, notes).map_err(fault)?;
        let position_m = column.values.iter().map(|value| unit.in_si() * value).collect();
        let unit = (unit.name(), layout.position_unit.is_some());
        Ok(Self { name: "position", position_m, unit, other_km_h: None })
    }

    /// Checks that the speed is possible and agrees with the other values given.
    ///
    /// # Errors
    /// [`Fault::Impossible`] or [`Fault::Contradiction`].
    pub(super) fn check_speed(&self, speed_km_h: f64, layout: &Layout) -> Result<(), Fault> {
        let (unit, is_told) = self.unit;
        let [slowest, fastest] = PLAUSIBLE_KM_H;
        let slowest = if is_told { 0.0 } else { slowest };
        if !(speed_km_h > slowest && speed_km_h <= fastest) {
            let remedy = self.other_unit(speed_km_h);
            return Err(Fault::Impossible { observed: speed_km_h, unit, remedy });
        }
        let stated = layout.speed_km_h.filter(|_| self.name != "speed_km_h");
        let others = [("the stated speed", stated), ("the speed column", self.other_km_h)];
        for (what, other) in others {
            if other.is_some_and(|other| (other / speed_km_h - 1.0).abs() > ALIKE) {
                return Err(Fault::Contradiction {
                    says: format!("advances at {} km/h in {unit}", rounded(speed_km_h, 4)),
                    but: format!("{what} is {} km/h", rounded(other.unwrap_or_default(), 4)),
                });
            }
        }
        Ok(())
    }

    /// The unit in which the speed would be plausible for a train.
    fn other_unit(&self, speed_km_h: f64) -> String {
        let (unit, _) = self.unit;
        let (factors, remedy): (Vec<(&str, f64)>, &str) = if self.name == "position" {
            (factors::<PositionUnit>(), PositionUnit::REMEDY)
        } else {
            (factors::<SpeedUnit>(), SpeedUnit::REMEDY)
        };
        let own = factors.iter().find(|(name, _)| *name == unit).map_or(1.0, |(_, factor)| *factor);
        let range = PLAUSIBLE_KM_H[0]..=PLAUSIBLE_KM_H[1];
        let fits: Vec<String> = factors
            .iter()
            .map(|(name, factor)| (name, speed_km_h * factor / own))
            .filter(|(_, speed)| range.contains(speed))
            .map(|(name, speed)| format!("in {name} it is {} km/h", rounded(speed, 3)))
            .collect();
        if fits.is_empty() {
            "check the column, its unit and the sample rate".to_owned()
        } else {
            format!("{}: {remedy}", fits.join(", "))
        }
    }
}

fn factors<U: Unit>() -> Vec<(&'static str, f64)> {
    U::ALL.iter().map(|(unit, _)| (unit.name(), unit.in_si())).collect()
}

/// The column of speeds in m/s, and its unit.
fn speeds_m_s(
    table: &Table,
    layout: &Layout,
    notes: &mut Vec<String>,
) -> Result<Option<(Vec<f64>, SpeedUnit)>, RecordingError> {
    let Some(name) = &layout.speed else { return Ok(None) };
    let column = table.column(name)?;
    let fault = |fault| RecordingError::new(&table.path, name.as_str(), fault);
    pulses(&column.values).map_err(fault)?;
    let unit = of_column(column, layout.speed_unit, notes).map_err(fault)?;
    Ok(Some((column.values.iter().map(|speed| unit.in_si() * speed).collect(), unit)))
}

/// Speeds that go to and fro between two ends from sample to sample are pulses of a tachometer.
fn pulses(speeds: &[f64]) -> Result<(), Fault> {
    let ends = |ends: [f64; 2], &v: &f64| [ends[0].min(v), ends[1].max(v)];
    let [low, high] = speeds.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    if high - low < PULSE_SHARE * high.abs().max(low.abs()) {
        return Ok(());
    }
    // With a dead band in between, as a trigger has: noise about the middle is no change.
    let quarter = 0.25 * (high - low);
    let mut is_up = speeds[0] > low + 2.0 * quarter;
    let mut changes = 0;
    for &speed in speeds {
        if (is_up && speed < low + quarter) || (!is_up && speed > high - quarter) {
            is_up = !is_up;
            changes += 1;
        }
    }
    if changes < PULSES_MIN { Ok(()) } else { Err(Fault::Pulses { changes, low, high }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_are_told_from_speeds() {
        let of = |speed: &dyn Fn(f64) -> f64| {
            pulses(&(0..4000).map(|i| speed(f64::from(i))).collect::<Vec<_>>())
        };
        let square = |i: f64| f64::from(u8::from((0.01 * i) % 1.0 < 0.3));
        assert!(matches!(of(&square), Err(Fault::Pulses { .. })));
        assert!(of(&|i| 5.0 * square(i) + 0.1 * (1.7 * i).sin()).is_err());
        assert!(of(&|_| 67.0).is_ok());
        assert!(of(&|i| 67.0 + 3.0 * (0.1 * i).sin()).is_ok());
        // A start, a stop, and a dip.
        assert!(of(&|i| 80.0 * (i / 4000.0 * std::f64::consts::PI).sin()).is_ok());
    }
}
