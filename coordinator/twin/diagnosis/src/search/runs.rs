//! Runs of sleepers, and sets of any: the signature at several sleepers is about the sum of the signatures at single
//! ones.

use super::choice::{choice_cost, on};
use crate::calibration::Calibration;
use crate::candidate::Candidate;
use crate::screen::Template;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of sleepers of the shortest run; pairs are candidates of their own.
const SHORTEST: usize = 3;

/// Number of sleepers of the longest run for a kind that affects few sleepers: over a longer run the rail
/// deflects until gaps close, and many cracked sleepers are softer sleepers.
const LONGEST_OF_FEW: usize = 5;

/// Smallest ratio of the gain of a run to that of the kind at a single location.
const BETTER: f64 = 1.2;

/// Smallest gain of a run in nats.
const GAIN_MIN: f64 = 4.0;

/// Signatures of a kind at each sleeper, for one trial of one family.
struct Singles<'a> {
    candidate: &'a Candidate,
    /// Signatures by index of the sleeper.
    templates: BTreeMap<usize, &'a Template>,
}

/// The best run or set of each kind whose gain is larger than that of any of its candidates.
pub(super) fn runs(
    templates: &[Template],
    all: &[Candidate],
    current: &Calibration,
) -> Vec<Candidate> {
    let mut best: BTreeMap<&str, (f64, Candidate)> = BTreeMap::new();
    for singles in singles(templates, all) {
        let alone = |template: &&Template| {
            all[template.candidate].kind.physics == singles.candidate.kind.physics
        };
        let least = templates.iter().filter(alone).map(|it| it.along(&current.residual));
        let least = (BETTER * least.fold(0.0, f64::max)).max(GAIN_MIN);
        let run = singles.best_run(current).map(|(gain, run)| (gain, singles.on_run(run)));
        let found = [run, singles.best_set(current)].into_iter().flatten();
        let Some((gain, candidate)) =
            found.filter(|(gain, _)| *gain > least).max_by(|a, b| a.0.total_cmp(&b.0))
        else {
            continue;
        };
        let known = best.get(candidate.kind.physics).map_or(0.0, |(known, _)| *known);
        if gain > known {
            best.insert(candidate.kind.physics, (gain, candidate));
        }
    }
    best.into_values().map(|(_, candidate)| candidate).collect()
}

fn singles<'a>(templates: &'a [Template], all: &'a [Candidate]) -> Vec<Singles<'a>> {
    let mut found: Vec<(usize, Singles<'a>)> = Vec::new();
    for template in templates {
        let candidate = &all[template.candidate];
        let Some([sleeper]) = candidate.extension.sleepers.as_deref() else { continue };
        // A force law depends on where the wheel stands: what it does does not add up.
        if candidate.is_under_load() && !candidate.free.is_empty() {
            continue;
        }
        let alike = |(trial, known): &(usize, Singles<'_>)| {
            let of = |it: &Candidate| (it.kind.physics, it.extension.parameters.clone());
            *trial == template.trial
                && of(known.candidate) == of(candidate)
                && known.candidate.free.len() == candidate.free.len()
        };
        if let Some((_, known)) = found.iter_mut().find(|known| alike(known)) {
            known.templates.insert(*sleeper, template);
        } else {
            let templates = BTreeMap::from([(*sleeper, template)]);
            found.push((template.trial, Singles { candidate, templates }));
        }
    }
    found.into_iter().map(|(_, singles)| singles).collect()
}

impl Singles<'_> {
    fn on_run(&self, run: Range<usize>) -> Candidate {
        let mut candidate = self.candidate.clone();
        candidate.extension.sleepers = Some(run.collect());
        candidate
    }

    /// The set of two or more sleepers whose summed signature gains most in the residual, less what the choice costs,
    /// and this gain in nats. Sleepers are added one by one. Not for a kind that affects few sleepers.
    fn best_set(&self, current: &Calibration) -> Option<(f64, Candidate)> {
        if self.candidate.is_of_few() {
            return None;
        }
        let count = self.templates.len();
        let mut chosen: Vec<usize> = Vec::new();
        let (mut sum, mut best) = (Sum::none(current), f64::NEG_INFINITY);
        loop {
            let left = self.templates.iter().filter(|(sleeper, _)| !chosen.contains(sleeper));
            let with = left.map(|(&sleeper, template)| {
                (sum.gain_with(template, current) - choice_cost(count, chosen.len() + 1), sleeper)
            });
            let further = with.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|it| it.0 > best);
            let Some((gain, sleeper)) = further else { break };
            best = gain;
            chosen.push(sleeper);
            sum.add(self.templates[&sleeper]);
        }
        chosen.sort_unstable();
        (chosen.len() > 1).then(|| (best, on(self.candidate, chosen, count)))
    }

    /// The run whose summed signature gains most in the residual, and its gain in nats.
    fn best_run(&self, current: &Calibration) -> Option<(f64, Range<usize>)> {
        let sleepers: Vec<usize> = self.templates.keys().copied().collect();
        let mut best: Option<(f64, Range<usize>)> = None;
        let longest = if self.candidate.is_of_few() { LONGEST_OF_FEW } else { sleepers.len() };
        for (index, &first) in sleepers.iter().enumerate() {
            let mut sum = Sum::none(current);
            for (length, &sleeper) in (1..=longest).zip(&sleepers[index..]) {
                if sleeper != first + length - 1 {
                    break;
                }
                sum.add(self.templates[&sleeper]);
                if length < SHORTEST {
                    continue;
                }
                let gain = sum.gain(current);
                if best.as_ref().is_none_or(|(known, _)| gain > *known) {
                    best = Some((gain, first..sleeper + 1));
                }
            }
        }
        best
    }
}

/// Sum of signatures; all its quantities except the norm are linear in them.
struct Sum {
    change: DVector<f64>,
    projected_gradient: DVector<f64>,
    imitation: DVector<f64>,
}

impl Sum {
    fn none(current: &Calibration) -> Self {
        let none = DVector::zeros(current.values.len());
        let change = DVector::zeros(current.residual.len());
        Self { change, projected_gradient: none.clone(), imitation: none }
    }

    fn add(&mut self, template: &Template) {
        self.change += &template.change;
        self.projected_gradient += &template.projected_gradient;
        self.imitation += &template.imitation;
    }

    /// Gain in nats of a signature with free strength in the residual, as [`Template::along`].
    fn gain(&self, current: &Calibration) -> f64 {
        let square = self.change.norm_squared() - self.projected_gradient.dot(&self.imitation);
        let along = self.change.dot(&current.residual).max(0.0);
        0.5 * along.powi(2) / square.max(f64::MIN_POSITIVE)
    }

    /// [`Sum::gain`] with one more signature.
    fn gain_with(&self, template: &Template, current: &Calibration) -> f64 {
        let mut with = Self {
            change: self.change.clone(),
            projected_gradient: self.projected_gradient.clone(),
            imitation: self.imitation.clone(),
        };
        with.add(template);
        with.gain(current)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Problem;
    use crate::candidate::candidates;
    use crate::screen::templates;
    use crate::search::testing::observed;
    use tracktwin_track::extension::ExtensionInstance;

    /// Sleepers of the candidate with clamps that is found on a track with clamps at these; `None` without any.
    fn clamps_found(clamped: &[usize]) -> Option<Vec<usize>> {
        let clamps = ExtensionInstance::new("fastening_clamp").on(clamped.iter().copied());
        let clamps = clamps.with("vertical_N_per_m", 5e7).with("rotational_N_m_per_rad", 3e5);
        let (forward, observation) = observed(16, &clamps);
        let problem = Problem { forward: &forward, observation: &observation, candidates: &[] };
        let current = problem.calibrate(forward.unknowns.typical()).unwrap();
        let is_clamp = |candidate: &Candidate| candidate.kind.physics == "fastening_clamp";
        let all: Vec<Candidate> =
            candidates(&forward.section).into_iter().filter(is_clamp).collect();
        let templates = templates(&problem, &current, &all, &|| ()).unwrap();
        let found = runs(&templates, &all, &current).pop()?;
        assert!(found.choice_nats > 0.0);
        found.extension.sleepers
    }

    #[test]
    fn clamps_are_found_at_every_third_or_fourth_sleeper_as_they_stand() {
        assert_eq!(clamps_found(&[1, 4, 8, 11, 15]), Some(vec![1, 4, 8, 11, 15]));
    }

    #[test]
    fn clamps_at_a_regular_distance_or_a_single_one_need_no_set() {
        assert_eq!(clamps_found(&[1, 5, 9, 13]), None);
        assert_eq!(clamps_found(&[7]), None);
    }
}
