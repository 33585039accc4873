//! Combination of fitted sections into one track.

use crate::fit::Fitted;
use crate::record::{Along, Inversion, Parts, Prior, Provenance, Sleeper, Unusual, log_normal};
use std::collections::BTreeMap;
use tracktwin_diagnosis::{
    Amplitude, Common, FoundSupportChange, Mean, Own, PreparedRecording, SleeperPattern, Unknowns,
    joined_support_changes, owner, separate_wavelengths,
};
use tracktwin_evaluation::{Estimates, Flag, Unevaluated};
use tracktwin_parameters::Parameter;
use tracktwin_signal::recording::Recording;

/// Limit of a sleeper's misfit; above it the estimates are not valid.
const MISFIT_MAX: f64 = 2.0;

/// Largest railpad stiffness in N/m that a recording of V-Track resolves; a stiffer railpad hardly changes
/// the recording. For other tracks it is multiplied by the length ratio (docs/inversion.md; paper, Table
/// D1).
const RAILPAD_RESOLVED: f64 = 2e8;

/// Distance of a value from its prior, in prior standard deviations, from which it is unusual.
const UNUSUAL: f64 = 3.0;

/// Largest probability of a support change if all passes have nearly one speed: a change of the surface has a similar effect.
const ONE_SPEED_MAX: f64 = 0.5;

impl Inversion {
    /// Combines the sections of a recording, which must be in order. A sleeper that lies in several
    /// sections takes its estimates from the section in which its distance from an end is largest.
    pub fn of(recording: &Recording, sections: &[(PreparedRecording, Fitted)]) -> Self {
        let ranges: Vec<_> = sections.iter().map(|(prepared, _)| prepared.sleepers()).collect();
        let mut sleepers = Vec::new();
        let mut unevaluated = Vec::new();
        for (number, place) in recording.sleepers.iter().enumerate() {
            let Some(section) = owner(&ranges, number) else {
                let reason = "at some speed no pass covers its window with a margin";
                unevaluated.push(Unevaluated { id: place.id.clone(), x_m: place.x_m, reason });
                continue;
            };
            let (prepared, fitted) = &sections[section];
            let resolved = RAILPAD_RESOLVED * prepared.forward.section.track.design.length_ratio();
            let index = number - prepared.first_sleeper;
            sleepers.push(fitted.sleeper(index, &place.id, place.x_m, resolved));
        }
        let found: Vec<_> = sections.iter().map(|it| support_changes(recording, it)).collect();
        let found: Vec<_> =
            ranges.iter().cloned().zip(found.iter().map(|found| &found[..])).collect();
        let ids: Vec<String> = recording.sleepers.iter().map(|place| place.id.clone()).collect();
        let changes = joined_support_changes(&ids, &found);
        let unusual = sections.iter().filter_map(|(prepared, fitted)| fitted.unusual(prepared));
        let fitted: Vec<_> =
            sections.iter().map(|(prepared, it)| (prepared, &it.unknowns, &it.values)).collect();
        let parts = Parts {
            sleepers,
            unevaluated,
            support_changes: changes,
            unusual: unusual.max_by(|a, b| a.deviations.total_cmp(&b.deviations)),
            sleeper_pattern: SleeperPattern::of(recording, &fitted),
        };
        Self::new(recording.name.clone(), provenance(sections), parts)
    }
}

/// The support changes of a fitted section.
fn support_changes(
    recording: &Recording,
    (prepared, fitted): &(PreparedRecording, Fitted),
) -> Vec<FoundSupportChange> {
    let id = |sleeper: usize| recording.sleepers[prepared.first_sleeper + sleeper].id.clone();
    let are_apart = separate_wavelengths(&recording.speeds_km_h());
    let most = if are_apart { 1.0 } else { ONE_SPEED_MAX };
    let limited = |amplitude: Amplitude| Amplitude {
        probability: amplitude.probability.min(most),
        ..amplitude
    };
    let found = fitted.unknowns.support_changes.iter().zip(&fitted.changes);
    found
        .map(|(&change, &amplitude)| FoundSupportChange::new(change, limited(amplitude), id))
        .collect()
}

impl Fitted {
    /// The gain of a speed or the common value that is farthest from its prior, if that is unusual. It may be so
    /// where all misfits are small.
    fn unusual(&self, prepared: &PreparedRecording) -> Option<Unusual> {
        let Self { unknowns, values, .. } = self;
        let speeds =
            prepared.forward.speeds_m_s.iter().zip(unknowns.gains()).map(|(speed, at)| {
                (format!("the power of the passes at {:.0} km/h", 3.6 * speed), at)
            });
        let common =
            Common::ALL.map(|of| (format!("the {}", common(of).label()), unknowns.common(of)));
        let (typical, deviations) = (unknowns.typical(), unknowns.prior_deviations());
        let level = unknowns.level();
        let expected = unknowns.mean[Own::Level as usize];
        let log = values.rows(level.start, level.len()).mean() - expected.log;
        let level = Unusual {
            quantity: format!("the {}", Parameter::IrregularityLevel.label()),
            ratio: log.exp(),
            deviations: log.abs() / expected.deviation,
        };
        speeds
            .chain(common)
            .map(|(quantity, at)| {
                let log = values[at] - typical[at];
                Unusual { quantity, ratio: log.exp(), deviations: log.abs() / deviations[at] }
            })
            .chain([level])
            .max_by(|a, b| a.deviations.total_cmp(&b.deviations))
            .filter(|found| found.deviations > UNUSUAL)
    }

    fn sleeper(&self, index: usize, id: &str, x_m: f64, railpad_resolved: f64) -> Sleeper {
        let estimates: Estimates = places(&self.unknowns, index)
            .map(|(of, at)| (of, log_normal(self.values[at], self.deviations[at])))
            .collect();
        let misfit = self.misfit[index];
        let mut flags = Vec::new();
        if self.unknowns.exceptions.iter().any(|exception| exception.sleeper == index) {
            flags.push(Flag::UnlikeNeighbours);
        }
        // The median: the mean of a log-normal estimate rises with its uncertainty.
        if self.values[self.unknowns.at(Own::RailpadStiffness, index)] > railpad_resolved.ln() {
            flags.push(Flag::RailpadNotResolved);
        }
        if misfit > MISFIT_MAX {
            flags.push(Flag::OutsideLibrary);
        }
        Sleeper { id: id.to_owned(), x_m, estimates, misfit, flags }
    }
}

/// Parameters of a sleeper with the indices of their values.
fn places(unknowns: &Unknowns, sleeper: usize) -> impl Iterator<Item = (Parameter, usize)> {
    let own = Own::ALL.map(|it| (own(it), unknowns.at(it, sleeper)));
    let common = Common::ALL.map(|it| (common(it), unknowns.common(it)));
    own.into_iter().chain(common)
}

const fn own(quantity: Own) -> Parameter {
    match quantity {
        Own::BallastStiffness => Parameter::BallastStiffness,
        Own::RailpadStiffness => Parameter::RailpadStiffness,
        Own::Level => Parameter::IrregularityLevel,
    }
}

const fn common(quantity: Common) -> Parameter {
    match quantity {
        Common::SleeperBendingStiffness => Parameter::SleeperBendingStiffness,
        Common::RailpadDamping => Parameter::RailpadDamping,
        Common::BallastDamping => Parameter::BallastDamping,
    }
}

fn provenance(sections: &[(PreparedRecording, Fitted)]) -> Provenance {
    let middle = sections.get(sections.len() / 2);
    let speeds = middle.map_or(&[][..], |(prepared, _)| &prepared.forward.speeds_m_s);
    let passes = middle.map_or(&[][..], |(prepared, _)| &prepared.pass_numbers);
    let mut prior = BTreeMap::new();
    let mut variation = BTreeMap::new();
    if let Some((_, fitted)) = middle {
        let unknowns = &fitted.unknowns;
        let typical = unknowns.typical();
        let spread = unknowns.prior_deviations();
        for (of, at) in places(unknowns, 0) {
            prior.insert(of, Prior { median: typical[at].exp(), log_sd: spread[at] });
        }
        // Without the variation between sleepers.
        for field in Own::ALL {
            let Mean { log, deviation } = unknowns.mean[field as usize];
            prior.insert(own(field), Prior { median: log.exp(), log_sd: deviation });
        }
        let along = Own::ALL.map(own).into_iter().zip(unknowns.variation);
        variation.extend(along.map(|(of, variation)| (of, Along::from(variation))));
    }
    Provenance {
        code_version: env!("CARGO_PKG_VERSION"),
        speeds_km_h: speeds.iter().map(|speed| 3.6 * speed).collect(),
        passes: passes.iter().map(Vec::len).collect(),
        prior,
        variation,
    }
}
