//! Runs of sleepers: what a kind does at three sleepers or more is about the sum of what it does at each.

use crate::calibration::Calibration;
use crate::candidate::Candidate;
use crate::screen::Template;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::ops::Range;

/// Sleepers of the shortest run; pairs are screened as they are.
const SHORTEST: usize = 3;

/// Sleepers of the longest run of a kind that the wheel's load decides about: over more of them the rail
/// sinks until gaps close.
const LONGEST_UNDER_LOAD: usize = 5;

/// By how much a run must gain more than the kind at a single place to be tried.
const BETTER: f64 = 1.2;

/// Least gain of a run in nats.
const GAIN_MIN: f64 = 4.0;

/// What a kind does at each sleeper, by one trial of one family.
struct Singles<'a> {
    candidate: &'a Candidate,
    /// By number of the sleeper.
    templates: BTreeMap<usize, &'a Template>,
}

/// The best run of each kind that gains more there than at any single place.
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
        let Some((gain, run)) = singles.best_run(current).filter(|(gain, _)| *gain > least) else {
            continue;
        };
        let mut candidate = singles.candidate.clone();
        candidate.extension.sleepers = Some(run.collect());
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
    /// The run whose summed trace gains most in the residual, and its gain in nats.
    fn best_run(&self, current: &Calibration) -> Option<(f64, Range<usize>)> {
        let sleepers: Vec<usize> = self.templates.keys().copied().collect();
        let mut best: Option<(f64, Range<usize>)> = None;
        let longest =
            if self.candidate.is_under_load() { LONGEST_UNDER_LOAD } else { sleepers.len() };
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

/// Sum of traces: all that is asked of it but its length is linear in them.
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

    /// Nats that a trace of free size gains in the residual, as [`Template::along`].
    fn gain(&self, current: &Calibration) -> f64 {
        let square = self.change.norm_squared() - self.projected_gradient.dot(&self.imitation);
        let along = self.change.dot(&current.residual).max(0.0);
        0.5 * along.powi(2) / square.max(f64::MIN_POSITIVE)
    }
}
