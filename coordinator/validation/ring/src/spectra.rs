//! Spectra of the rails (paper, section 5.1 and Fig. 21).

use crate::estimates::mean;
use crate::statement::{Found, Statement};
use crate::{Method, Study, Truth};
use std::collections::BTreeMap;
use tracktwin_evaluation::SleeperFeatures;
use tracktwin_number::rounded;

/// The band in Hz in which the paper's rails differ most.
const BAND_HZ: [f64; 2] = [700.0, 4000.0];

/// Mean LWPS of each rail at one speed, without the sleepers at joints.
#[derive(Clone, Debug, PartialEq)]
pub struct RailSpectra {
    /// The speed in km/h.
    pub speed_km_h: f64,
    /// Frequencies of the bins in Hz.
    pub frequencies_hz: Vec<f64>,
    /// Level of each bin in dB re 1 (m/s2)2, by the number of the rail.
    pub levels_db: BTreeMap<usize, Vec<f64>>,
}

impl RailSpectra {
    /// Spectra from the features of a recording of one speed, whose sleepers are those of the truth.
    pub fn new(
        truth: &Truth,
        speed_km_h: f64,
        frequencies_hz: Vec<f64>,
        features: &[SleeperFeatures],
    ) -> Self {
        let mut by_rail: BTreeMap<usize, Vec<&[f64]>> = BTreeMap::new();
        for known in features {
            let sleeper = &truth.sleepers[known.sleeper];
            let measured = known.speeds.iter().filter(|_| sleeper.joint.is_none());
            let log_powers = measured.map(|of| of.log_power.as_slice());
            by_rail.entry(sleeper.rail).or_default().extend(log_powers);
        }
        let level = |rows: Vec<&[f64]>| -> Option<Vec<f64>> {
            let bin = |bin: usize| mean(rows.iter().map(|row| 10.0 * row[bin] / 10.0_f64.ln()));
            (0..frequencies_hz.len()).map(bin).collect()
        };
        let levels = by_rail.into_iter().filter_map(|(rail, rows)| Some((rail, level(rows)?)));
        Self { speed_km_h, levels_db: levels.collect(), frequencies_hz }
    }

    /// Mean level of rails 1 and 3 less that of rails 2 and 4, inside and outside the band, in dB.
    fn difference_db(&self) -> Option<[f64; 2]> {
        let side = |odd: bool, inside: bool| {
            let rails = self.levels_db.iter().filter(move |(rail, _)| (*rail % 2 == 1) == odd);
            let levels = rails.flat_map(|(_, levels)| self.frequencies_hz.iter().zip(levels));
            let [low, high] = BAND_HZ;
            mean(levels.filter(|(hz, _)| (low <= **hz && **hz <= high) == inside).map(|it| *it.1))
        };
        Some([side(true, true)? - side(false, true)?, side(true, false)? - side(false, false)?])
    }
}

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    let Some(spectra) = &study.spectra else { return Vec::new() };
    let found = spectra.difference_db().map(|[inside, outside]| {
        let text = format!(
            "{} dB higher between 700 and 4000 Hz, {} dB elsewhere",
            rounded(inside, 2),
            rounded(outside, 2)
        );
        Found::new(inside > outside && outside > 0.0, text)
    });
    vec![Statement::of(
        ("Fig. 21", Method::Recording),
        [
            "The spectra of rails 1 and 3 are higher than those of rails 2 and 4",
            "higher, most notably between 700 and 4000 Hz",
            "higher in both, and more between 700 and 4000 Hz",
        ],
        found,
    )]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::study;
    use tracktwin_evaluation::SpeedFeatures;
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn rails_that_are_rougher_in_the_band_are_seen() {
        let mut study = study();
        let spectra = |factor: f64| {
            let features = study.truth.sleepers.iter().enumerate().map(|(sleeper, it)| {
                let rough = if it.rail % 2 == 1 { 1.0 } else { 0.0 };
                // Joints would spoil the mean.
                let spoilt = if it.joint.is_some() { 50.0 } else { 0.0 };
                let log_power = vec![rough + spoilt, factor * rough + spoilt];
                let speeds = vec![SpeedFeatures { speed: 0, passes: 1, log_power }];
                SleeperFeatures { sleeper, speeds, flags: Vec::new() }
            });
            RailSpectra::new(&study.truth, 13.0, vec![100.0, 1000.0], &features.collect::<Vec<_>>())
        };
        let [higher, even] = [2.0, 1.0].map(spectra);
        study.spectra = Some(higher);
        let all = statements(&study);
        assert_eq!(all[0].verdict, ClaimVerdict::Reproduced, "{all:?}");
        assert!(all[0].found.starts_with("8.7 dB higher"), "{}", all[0].found);
        study.spectra = Some(even);
        assert_eq!(statements(&study)[0].verdict, ClaimVerdict::Differs);
    }
}
