//! Mean spectra of a library's cases, in dB.

use crate::average::Average;
use crate::{Error, Figure};
use std::f64::consts::LN_10;
use tracktwin_surrogate::TrainingSet;

/// Speed in km/h of the figures of the paper that show only one speed.
pub const SPEED_KM_H: f64 = 13.0;

/// Decibels a unit of the natural logarithm of a power.
pub(crate) const DB: f64 = 10.0 / LN_10;

/// Cases that a group needs for a mean with an error.
const GROUP_MIN: usize = 4;

/// Place of the paper's speed among the library's.
pub(crate) fn speed_index(set: &TrainingSet, figure: Figure) -> Result<usize, Error> {
    let known = &set.speeds_km_h;
    let found = known.iter().position(|&speed| speed == SPEED_KM_H);
    let missing = || Error::NoSpeed { figure, wanted: SPEED_KM_H, known: known.clone() };
    found.ok_or_else(missing)
}

/// The ln LWPS of a case at a speed, a value a bin.
pub(crate) fn log_power(set: &TrainingSet, speed: usize, case: usize) -> &[f64] {
    let bins = set.frequencies_hz.len();
    &set.log_power[speed][case * bins..][..bins]
}

/// Mean LWPS of these cases in dB re 1 (m/s2)2, a value a bin.
pub(crate) fn mean_spectrum(set: &TrainingSet, speed: usize, cases: &[usize]) -> Vec<Average> {
    let bin = |bin: usize| {
        let values: Vec<f64> =
            cases.iter().map(|&case| DB * log_power(set, speed, case)[bin]).collect();
        Average::of(&values)
    };
    (0..set.frequencies_hz.len()).map(bin).collect()
}

/// The mean values with their frequencies.
pub(crate) fn points(frequencies_hz: &[f64], spectrum: &[Average]) -> Vec<(f64, f64)> {
    frequencies_hz.iter().copied().zip(spectrum.iter().map(|bin| bin.mean)).collect()
}

/// Refuses a library of too few cases to be split into this many groups.
pub(crate) fn enough(set: &TrainingSet, figure: Figure, groups: usize) -> Result<(), Error> {
    let (found, least) = (set.entries(), GROUP_MIN * groups);
    if found >= least { Ok(()) } else { Err(Error::TooFewCases { figure, found, least }) }
}
