//! One file's columns as accelerations, a rate and places, before passes are made of them.

use super::super::error::{Fault, RecordingError};
use super::super::folder::straightened;
use super::super::odometer::{Odometer, steps_back_and_ahead};
use super::super::{Pass, check};
use super::places::Places;
use super::unit::{Unit, of_column};
use super::{AccelerationUnit, Layout, Table, doubt, rate};
use crate::Signal;
use std::path::PathBuf;
use tracktwin_number::{rounded, significant};

/// A pass as stored in its file.
pub(super) struct Raw {
    /// The file.
    pub path: PathBuf,
    /// Unit of the accelerations.
    pub unit: AccelerationUnit,
    /// Accelerations in m/s2 or the unknown unit, positive downwards, with their constant.
    pub samples: Vec<f64>,
    /// Samples per second in Hz.
    pub rate_hz: f64,
    /// Places of the wheel.
    pub places: Places,
}

impl Raw {
    /// The pass of a table; what is assumed or doubtful goes into `notes`.
    pub(super) fn of(
        table: &Table,
        column: &str,
        layout: &Layout,
        notes: &mut Vec<String>,
    ) -> Result<Self, RecordingError> {
        let mut own = table.notes.clone();
        let acceleration = table.column(column)?;
        let fault = |fault| RecordingError::new(&table.path, column, fault);
        let unit = of_column(acceleration, layout.acceleration_unit, &mut own).map_err(fault)?;
        own.extend(doubt::of_acceleration(acceleration, unit, layout.upwards));
        let rate_hz = rate::of(table, layout, &mut own)?;
        let count = acceleration.values.len();
        let places = Places::of(table, layout, count, rate_hz, &mut own)?;
        let factor = unit.in_si() * if layout.upwards { -1.0 } else { 1.0 };
        let samples = acceleration.values.iter().map(|value| factor * value).collect();
        let raw = Self { path: table.path.clone(), unit, samples, rate_hz, places };
        let file = raw.file();
        notes.extend(own.into_iter().map(|note| match note.strip_prefix("doubt: ") {
            Some(doubt) => format!("doubt: {file}: {doubt}"),
            None => format!("{file}: {note}"),
        }));
        Ok(raw)
    }

    /// Whether most steps of the positions lead to smaller ones. A counter that restarts leads far back in one.
    pub(super) fn is_backwards(&self) -> bool {
        let [back, ahead] = steps_back_and_ahead(&self.places.position_m);
        back > ahead
    }

    /// The pass, without the constant, along the direction of travel. What was done goes into `notes`, what
    /// results depend on into `corrections`.
    pub(super) fn into_pass(
        mut self,
        column: &str,
        is_backwards: bool,
        layout: &Layout,
        (notes, corrections): (&mut Vec<String>, &mut Vec<String>),
    ) -> Result<Pass, RecordingError> {
        let file = self.file();
        let fault = |fault| RecordingError::new(&self.path, self.places.name, fault);
        if is_backwards {
            self.places.position_m.iter_mut().for_each(|place| *place = -*place);
        }
        let position_m = std::mem::take(&mut self.places.position_m);
        let odometer = Odometer::straightened(position_m, self.rate_hz, layout.spacing_m())
            .map_err(|found| if is_backwards { found.with_signs_changed() } else { found })
            .map_err(|found| fault(found.into()))?;
        if layout.sleeper_m.is_some() {
            let told = odometer.tells_sleepers(layout.spacing_m());
            told.map_err(|found| fault(found.into()))?;
        }
        let Odometer { position_m, step_m } = odometer;
        corrections.extend(step_m.map(|step_m| straightened(&file, step_m)));
        let last = position_m.len() - 1;
        let speed_km_h = 3.6 * (position_m[last] - position_m[0]) * self.rate_hz / last as f64;
        self.places.check_speed(speed_km_h, layout).map_err(fault)?;
        check::length(&self.path, &position_m, layout.spacing_m())?;
        let mean = self.samples.iter().sum::<f64>() / self.samples.len() as f64;
        // Gravity and the amplifier's offset; nothing of the track is that slow.
        let samples: Vec<f64> = self.samples.iter().map(|value| value - mean).collect();
        notes.push(format!(
            "{file}: {column}: {} samples at {} Hz, {} km/h; a constant offset of {} {} was removed",
            samples.len(),
            rounded(self.rate_hz, 8),
            significant(speed_km_h, 4),
            rounded(mean, 3),
            self.unit_name()
        ));
        let signal = Signal::new(self.rate_hz, samples).map_err(|error| {
            let fault = Fault::Unreadable { reason: error.to_string() };
            RecordingError::new(&self.path, column, fault)
        })?;
        Ok(Pass { file, speed_km_h, axle: None, signal, position_m, contact_loss_share: None })
    }

    const fn unit_name(&self) -> &'static str {
        match self.unit {
            AccelerationUnit::Unknown => "in the unknown unit",
            _ => "m/s2",
        }
    }

    fn file(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}
