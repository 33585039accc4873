//! Locations of hypotheses and mismatches: in metres, sleepers and frequencies.

use super::Evidence;
use crate::candidate::Candidate;
use crate::outcome::{Levels, Location, Mismatch, Verdict};
use crate::port_scan::PortPlace;
use nalgebra::DVector;
use std::ops::Range;
use tracktwin_inspection::{Finding, Place};
use tracktwin_signal::recording::Sleeper;
use tracktwin_track::extension::PlaceKind;

/// Share of the largest squared signature from which a sleeper or band belongs to a mismatch.
const PLACE_SHARE: f64 = 0.1;

/// Position error in sleeper spacings: odometers deviate by millimetres.
const PLACE_ERROR: f64 = 0.04;

impl Evidence<'_> {
    pub(super) fn location_of(&self, candidate: &Candidate) -> Option<Location> {
        let section = &self.prepared.forward.section;
        match (candidate.kind.place, candidate.extension.x_m, &candidate.extension.sleepers) {
            (PlaceKind::Nowhere, _, _) => None,
            (_, Some([from_m, to_m]), _) => Some(self.location_between(from_m, to_m)),
            (_, None, Some(sleepers)) => (!sleepers.is_empty()).then(|| self.location(sleepers)),
            (_, None, None) => Some(self.location(&(0..section.sleepers()).collect::<Vec<_>>())),
        }
    }

    /// `None` at the wheel or if the stiffness is everywhere.
    pub(super) fn location_of_port(&self, place: &PortPlace) -> Option<Location> {
        let everywhere = self.prepared.forward.section.sleepers();
        match place {
            PortPlace::Seats(seats) if seats.len() < everywhere => Some(self.location(seats)),
            PortPlace::Between(pair) => Some(self.location(pair)),
            PortPlace::Seats(_) | PortPlace::Wheel => None,
        }
    }

    /// Location from the first to the last of some sleepers; the list must not be empty.
    pub(super) fn location(&self, sleepers: &[usize]) -> Location {
        let section = &self.prepared.forward.section;
        let [first, last] = [sleepers[0], sleepers[sleepers.len() - 1]];
        Location {
            x_m: [section.x_m(first), section.x_m(last)],
            sleepers: sleepers.iter().map(|&sleeper| self.id(sleeper)).collect(),
        }
    }

    /// A stretch in m, with the sleepers of the recording that are at most half a spacing away, or the nearest one within
    /// a spacing.
    pub(super) fn location_between(&self, from_m: f64, to_m: f64) -> Location {
        let half_m = (0.5 + PLACE_ERROR) * self.recording.spacing_m;
        let beyond_m = |it: &&Sleeper| (from_m - it.x_m).max(it.x_m - to_m).max(0.0);
        let all = || self.recording.sleepers.iter();
        let mut near: Vec<&Sleeper> = all().filter(|it| beyond_m(it) <= half_m).collect();
        if near.is_empty() {
            let nearest = all().min_by(|a, b| beyond_m(a).total_cmp(&beyond_m(b)));
            near.extend(nearest.filter(|it| beyond_m(it) <= self.recording.spacing_m));
        }
        let sleepers = near.into_iter().map(|sleeper| sleeper.id.clone()).collect();
        Location { x_m: [from_m, to_m], sleepers }
    }

    pub(super) fn location_of_finding(&self, finding: &Finding) -> Option<Location> {
        match finding.place {
            Place::Everywhere => None,
            Place::Stretch { from_m, to_m } => Some(self.location_between(from_m, to_m)),
        }
    }

    pub(super) fn id(&self, sleeper: usize) -> String {
        self.recording.sleepers[self.prepared.first_sleeper + sleeper].id.clone()
    }

    pub(super) fn mismatches(&self, verdict: Verdict, levels: &Levels) -> Vec<Mismatch> {
        if verdict == Verdict::Consistent {
            return Vec::new();
        }
        let rounds = self.search.rounds.iter().filter(|round| round.is_significant());
        let found = rounds.filter_map(|round| {
            let named = round.fitted.first().map(|fitted| &fitted.change);
            let unknown = round.port.as_ref().map(|port| &port.change);
            let change = if round.accepted { named } else { unknown.or(named) }?;
            Some(self.mismatch(change, round.p_value, levels))
        });
        found.take(self.search.accepted.len().max(1)).collect()
    }

    /// Sleepers and bands in which a whitened change of the prediction is greatest.
    fn mismatch(&self, change: &DVector<f64>, p_value: f64, levels: &Levels) -> Mismatch {
        let forward = &self.prepared.forward;
        let square = |row: usize| change[row].powi(2);
        let (mut by_sleeper, mut by_band) =
            (vec![0.0; forward.section.sleepers()], vec![0.0; forward.bands.count()]);
        for row in 0..forward.count() {
            let (sleeper, _, band) = forward.place(row);
            by_sleeper[sleeper] += square(row);
            by_band[band] += square(row);
        }
        let sleepers = loud(&by_sleeper);
        let bands = loud(&by_band);
        let mut sum = (0.0, 0.0);
        let speeds = levels.measured_db.iter().zip(&levels.before_db).zip(&levels.scatter_db);
        for ((measured, before), scatter) in speeds {
            for sleeper in sleepers.clone() {
                for band in bands.clone().filter(|&band| scatter[band].is_some()) {
                    sum.0 += (measured[sleeper][band] - before[sleeper][band]).powi(2);
                    sum.1 += 1.0;
                }
            }
        }
        let Location { x_m, sleepers } = self.location(&sleepers.collect::<Vec<_>>());
        let centres = forward.bands.centres_hz();
        Mismatch {
            x_m,
            sleepers,
            frequency_hz: [centres[bands.start], centres[bands.end - 1]],
            speeds_km_h: levels.speeds_km_h.clone(),
            level_db: f64::sqrt(sum.0 / sum.1),
            p_value,
        }
    }
}

/// Range of the entries above [`PLACE_SHARE`] of the largest entry.
fn loud(squares: &[f64]) -> Range<usize> {
    let highest = squares.iter().copied().fold(0.0, f64::max);
    let part = |square: &f64| *square >= PLACE_SHARE * highest;
    let first = squares.iter().position(part).unwrap_or(0);
    let last = squares.iter().rposition(part).unwrap_or(squares.len() - 1);
    first..last + 1
}
