//! Runs of sleepers: the signature at three or more sleepers is about the sum of the signatures at single
//! sleepers.

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

/// The best run of each kind whose gain is larger than at any single location.
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
}
