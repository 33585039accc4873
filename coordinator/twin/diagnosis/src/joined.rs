//! One diagnosis of a long track, from the diagnoses of its overlapping sections.

mod hypotheses;

use crate::conclusion::{further, verdict};
use crate::outcome::{
    BeforeAfter, Confirmation, ConfirmedSpeed, Diagnosis, FORMAT, FitScores, Levels, Mismatch,
    Score, Scores, SectionVerdict, Verdict,
};
use crate::prepared_recording::overlapping;
use crate::section::owner;
use crate::sentence::sentence;
use crate::spectra::are_one_speed;
use crate::variation::joined_support_changes;
use std::collections::BTreeMap;
use std::ops::Range;
use tracktwin_inspection::chain::LossOfContact;

/// Largest number of sleepers that are diagnosed as a whole.
const WHOLE_MAX: usize = 48;

/// Number of sleepers in a section of a longer track, and number of sleepers that two neighbouring sections
/// share. An effect at the end of one section is thus inside the next.
const LENGTH: usize = 30;
const OVERLAP: usize = 6;

/// The sections in which a recording of this number of sleepers is diagnosed.
pub fn diagnosed_sections(sleepers: usize) -> Vec<Range<usize>> {
    let length = if sleepers <= WHOLE_MAX { WHOLE_MAX } else { LENGTH };
    overlapping(0..sleepers, length, OVERLAP)
}

/// Diagnosis of a section of a track.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosedSection {
    /// Number of the section along the track, from 1.
    pub number: usize,
    /// Indices of its sleepers in the whole recording.
    pub sleepers: Range<usize>,
    /// The diagnosis.
    pub diagnosis: Diagnosis,
}

/// Joins the diagnoses of sections. `ids` and `x_m` are names and positions of all sleepers of the
/// recording; `loss_of_contact` is that of the whole recording. `None` without any section.
///
/// A sleeper has the values of the section in which it lies farthest from the ends. Of two findings at one
/// place in two sections, the one farther from the ends is kept. A finding that continues in the next
/// section is one finding.
pub fn joined(
    ids: &[String],
    x_m: &[f64],
    sections: &[DiagnosedSection],
    loss_of_contact: Option<LossOfContact>,
) -> Option<Diagnosis> {
    if sections.is_empty() {
        return None;
    }
    let whole = Whole { ids, x_m, sections };
    let mut hypotheses = whole.hypotheses();
    hypotheses
        .sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.accepted.cmp(&a.accepted)));
    let verdict = verdict(&hypotheses);
    if verdict == Verdict::Consistent {
        hypotheses.clear();
    }
    let all = || sections.iter().map(|section| &section.diagnosis);
    let nothing = all().filter_map(|it| it.nothing_left_out).reduce(f64::min);
    let (fit, bias_removed) = (whole.fit(), whole.bias_removed());
    let said =
        sentence(verdict, &hypotheses, nothing.unwrap_or_default(), ids, &fit, &bias_removed);
    // A section without a fitted track says nothing about the support.
    let fitted = sections.iter().filter(|it| !it.diagnosis.track.is_empty());
    let found = fitted.map(|it| (it.sleepers.clone(), &it.diagnosis.support_changes[..]));
    let support_changes = joined_support_changes(ids, &found.collect::<Vec<_>>());
    Some(Diagnosis {
        format: FORMAT.to_owned(),
        recording: sections[0].diagnosis.recording.clone(),
        verdict,
        sentence: said + &further(&support_changes, loss_of_contact.as_ref()),
        nothing_left_out: nothing,
        mismatches: whole.mismatches(),
        hypotheses,
        fit,
        bias_removed,
        track: whole.own_entries(|it| &it.track),
        levels: whole.levels(),
        confirmation: whole.confirmation(),
        support_changes,
        loss_of_contact,
        notes: whole.notes(),
        sections: sections.iter().map(|section| whole.verdict_of(section)).collect(),
    })
}

/// All sections of a recording.
struct Whole<'a> {
    ids: &'a [String],
    x_m: &'a [f64],
    sections: &'a [DiagnosedSection],
}

impl Whole<'_> {
    /// Index of a sleeper in the whole recording.
    fn index(&self, id: &String) -> Option<usize> {
        self.ids.iter().position(|known| known == id)
    }

    /// The section to which a sleeper belongs.
    fn owner(&self, sleeper: usize) -> Option<usize> {
        let ranges: Vec<_> = self.sections.iter().map(|it| it.sleepers.clone()).collect();
        owner(&ranges, sleeper)
    }

    /// Indices of the sleepers that belong to a section.
    fn own(&self, section: usize) -> Vec<usize> {
        let all = self.sections[section].sleepers.clone();
        all.filter(|&sleeper| self.owner(sleeper) == Some(section)).collect()
    }

    /// Values of each section's own sleepers, in the order of the track. `of` are the values of all compared
    /// sleepers of a section.
    fn own_entries<T: Clone>(&self, of: impl Fn(&Diagnosis) -> &Vec<T>) -> Vec<T> {
        let mut all = Vec::new();
        for (number, section) in self.sections.iter().enumerate() {
            let own = self.own(number);
            let compared = section.diagnosis.track.iter().map(|it| self.index(&it.id));
            let values = compared.zip(of(&section.diagnosis));
            let is_own = |sleeper: Option<usize>| sleeper.is_some_and(|it| own.contains(&it));
            all.extend(values.filter(|(sleeper, _)| is_own(*sleeper)).map(|(_, it)| it.clone()));
        }
        all
    }

    /// Mismatches whose middle is a section's own. The probability is that of such a patch anywhere in all
    /// sections.
    fn mismatches(&self) -> Vec<Mismatch> {
        let mut all = Vec::new();
        for (number, section) in self.sections.iter().enumerate() {
            for mismatch in &section.diagnosis.mismatches {
                let middle = &mismatch.sleepers[mismatch.sleepers.len() / 2..];
                let middle = middle.first().and_then(|id| self.index(id));
                if middle.and_then(|sleeper| self.owner(sleeper)) == Some(number) {
                    let p_value = (self.sections.len() as f64 * mismatch.p_value).min(1.0);
                    all.push(Mismatch { p_value, ..mismatch.clone() });
                }
            }
        }
        all
    }

    /// Mean scores over all sleepers, and sums of the gains.
    fn fit(&self) -> FitScores {
        let all: Vec<(f64, &FitScores)> = self
            .sections
            .iter()
            .map(|it| (it.diagnosis.track.len().max(1) as f64, &it.diagnosis.fit))
            .collect();
        let weights: f64 = all.iter().map(|(weight, _)| weight).sum();
        let mean = |of: &dyn Fn(&FitScores) -> Option<Score>| {
            let scores: Option<Vec<f64>> =
                all.iter().map(|(weight, fit)| Some(weight * of(fit)?.score)).collect();
            scores.map(|scores| Score { score: scores.iter().sum::<f64>() / weights })
        };
        let scores = |of: fn(&FitScores) -> Scores| Scores {
            in_sample: mean(&|fit| Some(of(fit).in_sample)).unwrap_or(Score { score: 0.0 }),
            held_out: mean(&|fit| of(fit).held_out),
        };
        let mut held_out_gain_nats = BTreeMap::new();
        for (speed, gain) in all.iter().flat_map(|(_, fit)| &fit.held_out_gain_nats) {
            *held_out_gain_nats.entry(speed.clone()).or_insert(0.0) += gain;
        }
        FitScores {
            score: all[0].1.score.clone(),
            before: scores(|fit| fit.before),
            after: scores(|fit| fit.after),
            held_out_gain_nats,
        }
    }

    /// Means over the sections that have a parameter, weighted by their numbers of sleepers.
    fn bias_removed(&self) -> BTreeMap<String, BeforeAfter<f64>> {
        let mut sums: BTreeMap<String, (f64, BeforeAfter<f64>)> = BTreeMap::new();
        for DiagnosedSection { diagnosis, .. } in self.sections {
            let weight = diagnosis.track.len() as f64;
            for (name, pair) in &diagnosis.bias_removed {
                let none = BeforeAfter { before: 0.0, after: 0.0 };
                let (weights, sum) = sums.entry(name.clone()).or_insert((0.0, none));
                *weights += weight;
                sum.before += weight * pair.before;
                sum.after += weight * pair.after;
            }
        }
        let mean = |(weight, sum): (f64, BeforeAfter<f64>)| BeforeAfter {
            before: sum.before / weight,
            after: sum.after / weight,
        };
        sums.into_iter().map(|(name, sum)| (name, mean(sum))).collect()
    }

    /// Levels of all sleepers; none if the sections were compared in different bands or at different speeds.
    fn levels(&self) -> Levels {
        let all: Vec<&Levels> = self.sections.iter().map(|it| &it.diagnosis.levels).collect();
        let first = all[0];
        let is_alike = |levels: &&Levels| {
            levels.frequency_hz == first.frequency_hz
                && levels.speeds_km_h.len() == first.speeds_km_h.len()
                && levels
                    .speeds_km_h
                    .iter()
                    .zip(&first.speeds_km_h)
                    .all(|(a, b)| are_one_speed(*a, *b))
        };
        if !all.iter().all(is_alike) {
            return Levels::default();
        }
        let speeds = 0..first.speeds_km_h.len();
        let of = |levels: fn(&Levels) -> &Vec<Vec<Vec<f64>>>| -> Vec<Vec<Vec<f64>>> {
            let at = |speed: usize| self.own_entries(|it| &levels(&it.levels)[speed]);
            speeds.clone().map(at).collect()
        };
        let scatter = |speed: usize, band: usize| {
            let known: Vec<f64> =
                all.iter().filter_map(|levels| levels.scatter_db[speed][band]).collect();
            (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
        };
        let bands = 0..first.frequency_hz.len();
        Levels {
            frequency_hz: first.frequency_hz.clone(),
            speeds_km_h: first.speeds_km_h.clone(),
            measured_db: of(|levels| &levels.measured_db),
            before_db: of(|levels| &levels.before_db),
            after_db: of(|levels| &levels.after_db),
            scatter_db: speeds
                .map(|speed| bands.clone().map(|band| scatter(speed, band)).collect())
                .collect(),
        }
    }

    /// Comparison with withheld passes over all sections that have one.
    fn confirmation(&self) -> Option<Confirmation> {
        let mut all = self.sections.iter().filter_map(|it| it.diagnosis.confirmation.as_ref());
        let mut whole = all.next()?.clone();
        for other in all {
            let [a, b] = [whole.sleepers, other.sleepers].map(|sleepers| sleepers as f64);
            let mean = |one: f64, two: f64| ((a * one * one + b * two * two) / (a + b)).sqrt();
            for further in &other.speeds {
                let is_it = |known: &&mut ConfirmedSpeed| {
                    are_one_speed(known.speed_km_h, further.speed_km_h)
                };
                if let Some(speed) = whole.speeds.iter_mut().find(is_it) {
                    speed.before_db = mean(speed.before_db, further.before_db);
                    speed.after_db = mean(speed.after_db, further.after_db);
                } else {
                    whole.speeds.push(further.clone());
                }
            }
            let is_new = |file: &&String| !whole.passes.contains(file);
            let further: Vec<String> = other.passes.iter().filter(is_new).cloned().collect();
            whole.passes.extend(further);
            whole.sleepers += other.sleepers;
            whole.gain_nats += other.gain_nats;
            whole.is_confirmed &= other.is_confirmed;
        }
        Some(whole)
    }

    /// Notes of all sections; those that not every section has begin with the section's sleepers.
    fn notes(&self) -> Vec<String> {
        let all = || self.sections.iter().map(|section| &section.diagnosis.notes);
        let is_common = |note: &&String| all().all(|notes| notes.contains(note));
        let mut notes: Vec<String> =
            self.sections[0].diagnosis.notes.iter().filter(is_common).cloned().collect();
        for section in self.sections {
            let [first, last] = self.ends(section);
            let own = section.diagnosis.notes.iter().filter(|note| !is_common(note));
            notes.extend(own.map(|note| format!("{first} to {last}: {note}")));
        }
        notes
    }

    /// Ids of the first and the last sleeper of a section.
    fn ends(&self, section: &DiagnosedSection) -> [String; 2] {
        let Range { start, end } = section.sleepers;
        [start, end - 1].map(|sleeper| self.ids[sleeper].clone())
    }

    fn verdict_of(&self, section: &DiagnosedSection) -> SectionVerdict {
        let DiagnosedSection { diagnosis, .. } = section;
        SectionVerdict {
            number: section.number,
            sleepers: self.ends(section),
            verdict: diagnosis.verdict,
            sentence: diagnosis.sentence.clone(),
            nothing_left_out: diagnosis.nothing_left_out,
        }
    }
}

#[cfg(test)]
mod tests;
