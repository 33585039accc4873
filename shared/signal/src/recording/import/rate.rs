//! The sample rate of a file, from the stated rate and the column of times.

use super::super::clock::{SampleClock, Stamps};
use super::super::error::{Fault, RecordingError};
use super::column::Column;
use super::unit::{TimeUnit, Unit, bare_name, of_column};
use super::{Layout, Table};
use tracktwin_number::{rounded, significant};

/// Largest relative difference between two consistent values of one sample rate.
const ALIKE: f64 = 1e-3;
/// Relative difference from a column that only seems to hold times.
const NEAR: f64 = 0.02;
/// Rates in Hz within which accelerations of an axle box are recorded.
const PLAUSIBLE_HZ: [f64; 2] = [50.0, 1e7];
/// Smallest step in sample intervals at which a sample is missing.
const MISSING: f64 = 1.5;
/// Names of columns that hold times, in lower case.
const TIMES: [&str; 8] = ["t", "time", "zeit", "t_s", "time_s", "t_ms", "time_ms", "timestamp"];

/// Sample rate in Hz: as stated, else from the time column; both must agree.
pub(super) fn of(
    table: &Table,
    layout: &Layout,
    notes: &mut Vec<String>,
) -> Result<f64, RecordingError> {
    match (&layout.time, layout.sample_rate_hz) {
        (None, None) => {
            let remedy = "state `--sample-rate HZ` or `--column time=NAME`".to_owned();
            let fault = Fault::NoField { remedy };
            Err(RecordingError::new(&table.path, "sample_rate_Hz", fault))
        }
        (None, Some(stated)) => {
            notes.extend(doubt(table, stated));
            Ok(stated)
        }
        (Some(name), stated) => {
            let clock = clock(table, name, layout.time_unit, notes)?;
            let Some(stated) = stated else { return Ok(clock.round_rate_hz()) };
            if (clock.rate_hz / stated - 1.0).abs() <= ALIKE.max(clock.uncertainty) {
                return Ok(stated);
            }
            let fault = Fault::Contradiction {
                says: format!("is {} Hz", rounded(stated, 8)),
                but: format!("column {name} advances at {} Hz", rounded(clock.rate_hz, 6)),
            };
            Err(RecordingError::new(&table.path, "sample_rate_Hz", fault))
        }
    }
}

/// How the column of times advances.
fn clock(
    table: &Table,
    name: &str,
    told: Option<TimeUnit>,
    notes: &mut Vec<String>,
) -> Result<SampleClock, RecordingError> {
    let column = table.column(name)?;
    let fault = |fault| RecordingError::new(&table.path, name, fault);
    let unit = of_column(column, told, notes).map_err(fault)?;
    let clock = in_unit(column, unit).map_err(|uneven| fault(or_omit(uneven)))?;
    let observed = clock.rate_hz;
    let is_sure = told.is_some() || column.unit.is_some();
    if !is_sure && !(PLAUSIBLE_HZ[0]..=PLAUSIBLE_HZ[1]).contains(&observed) {
        let remedy = other_unit(observed * unit.in_si());
        return Err(fault(Fault::ImpossibleRate { observed, unit: unit.name(), remedy }));
    }
    let (interval, shown) = (1.0 / observed, |seconds: f64| significant(1e3 * seconds, 2));
    match clock.stamps {
        Stamps::Even => {}
        Stamps::Coarse(step_s) => notes.push(format!(
            "column {name} advances in steps of {} ms, but the sample interval is {} ms: evenly \
                 spaced samples are assumed",
            shown(step_s),
            shown(interval)
        )),
        Stamps::Jitter(off_s) => notes.push(format!(
            "column {name} has a jitter of up to {} ms, and the sample interval is {} ms: \
                 evenly spaced samples are assumed",
            shown(off_s),
            shown(interval)
        )),
    }
    Ok(clock)
}

fn in_unit(column: &Column, unit: TimeUnit) -> Result<SampleClock, Fault> {
    let begin = column.values[0];
    // From the first on: a time since 1970 leaves no digits for the steps.
    let times: Vec<f64> = column.values.iter().map(|time| unit.in_si() * (time - begin)).collect();
    SampleClock::of(&times)
}

/// The fault of uneven times with the remedy that only an import has: where samples are missing, a rate instead of the times
/// would place all that follows wrongly.
fn or_omit(fault: Fault) -> Fault {
    match fault {
        Fault::UnevenTime { row, step, expected, .. } if step < MISSING * expected => {
            let alternative = ", or state `--sample-rate HZ` instead of the time column";
            Fault::UnevenTime { row, step, expected, alternative }
        }
        other => other,
    }
}

/// The unit in which the times would be plausible; `per_unit` is the number of samples per unit.
fn other_unit(per_unit: f64) -> String {
    let rates = TimeUnit::ALL.iter().map(|(unit, _)| (unit.name(), per_unit / unit.in_si()));
    let range = PLAUSIBLE_HZ[0]..=PLAUSIBLE_HZ[1];
    let fits: Vec<String> = rates
        .filter(|(_, rate)| range.contains(rate))
        .map(|(unit, rate)| format!("in {unit} it is {} Hz", rounded(rate, 4)))
        .collect();
    if fits.is_empty() {
        "use another column, or give the sample rate".to_owned()
    } else {
        format!("{}: {}", fits.join(", "), TimeUnit::REMEDY)
    }
}

/// Doubt about a column that looks like times with another rate than the stated one, or with a gap.
fn doubt(table: &Table, stated: f64) -> Option<String> {
    let is_time = |column: &&Column| {
        TIMES.contains(&bare_name(&column.name).to_ascii_lowercase().as_str())
            && column.oddity.is_none()
            && column.values.len() > 2
            && column.values.iter().all(|time| time.is_finite())
    };
    let column = table.columns.iter().find(is_time)?;
    if let Err(Fault::UnevenTime { row, step, expected, .. }) = in_unit(column, TimeUnit::Second)
        && step >= MISSING * expected
    {
        return Some(format!(
            "doubt: column {} has a gap before row {row}; if it holds times, samples are missing, and all places behind are \
             wrong: split the file there",
            column.name
        ));
    }
    let rate = |unit: TimeUnit| Some(in_unit(column, unit).ok()?.rate_hz);
    let rates: Vec<f64> = TimeUnit::ALL.iter().filter_map(|(unit, _)| rate(*unit)).collect();
    let agrees = rates.iter().any(|rate| (rate / stated - 1.0).abs() < NEAR);
    let first = rates.first().filter(|_| !agrees)?;
    Some(format!(
        "doubt: column {} advances at {} Hz if it holds times in s, but the stated rate is \
             {} Hz; if it is the time, use --column \"time={}\"",
        column.name,
        rounded(*first, 4),
        rounded(stated, 8),
        column.name
    ))
}
