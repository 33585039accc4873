//! Start values at outliers of the stiffness: single sleepers that differ much from their neighbours, and
//! runs of sleepers that differ much from all others. The candidates there start from the stiffness of the
//! other sleepers.
//!
//! The baseline reproduces many effects by a stiffness. Sleeper bolts, for example, have nearly the same
//! effect on the wheel as a railpad with a tenth of the stiffness. At such a railpad stiffness no trial of
//! bolts improves the fit.

use super::limits::REFINED_PER_KIND;
use crate::baseline::Unknowns;
use crate::calibration::{CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::neighbours::{FAR, usual_near};
use crate::screen::{Template, templates};
use nalgebra::DVector;
use std::ops::Range;
use tracktwin_inspection::median;

/// Smallest number of sleepers of a run: five lie within the reach of one or two effects at single
/// sleepers.
const SHORTEST: usize = 6;

/// Smallest number of sleepers outside a run.
const REST: usize = 3;

/// Smallest difference of the means inside and outside a run, in standard deviations.
const DEVIATIONS: f64 = 3.0;

/// Outliers of the stiffness along a section.
pub(super) struct Far {
    /// The unknowns, with the typical stiffness of the other sleepers at the outliers.
    values: DVector<f64>,
    /// Sleepers that differ much from their neighbours.
    sleepers: Vec<usize>,
    /// Runs that differ much from the rest of the track.
    runs: Vec<Range<usize>>,
}

impl Far {
    pub(super) fn new(unknowns: &Unknowns, values: &DVector<f64>) -> Self {
        let mut far = Self { values: values.clone(), sleepers: Vec::new(), runs: Vec::new() };
        for field in [unknowns.ballast(), unknowns.railpad()] {
            let stiffness = &values.as_slice()[field.clone()];
            if let Some(run) = run_apart(stiffness) {
                let outside = (0..field.len()).filter(|sleeper| !run.contains(sleeper));
                let usual = median(outside.map(|other| stiffness[other]).collect());
                run.clone().for_each(|sleeper| far.values[field.start + sleeper] = usual);
                far.runs.push(run);
                continue;
            }
            for (sleeper, &own) in stiffness.iter().enumerate() {
                let usual = usual_near(stiffness, sleeper);
                if (own - usual).abs() > FAR {
                    far.values[field.start + sleeper] = usual;
                    far.sleepers.push(sleeper);
                }
            }
        }
        far.runs.dedup();
        far
    }

    /// Candidates on each run, one of each kind that acts at single sleepers and does not depend on the wheel
    /// load: gaps under this many sleepers close under the wheel.
    pub(super) fn on_runs(&self, all: &[Candidate]) -> Vec<Candidate> {
        let at_first = |candidate: &&Candidate| {
            let acts = candidate.extension.sleepers.as_deref() == Some(&[0]);
            acts && !candidate.is_under_load()
        };
        let on = |run: &Range<usize>, candidate: &Candidate| {
            let mut candidate = candidate.clone();
            candidate.extension.sleepers = Some(run.clone().collect());
            candidate
        };
        let kinds = all.iter().filter(at_first);
        kinds.flat_map(|kind| self.runs.iter().map(move |run| on(run, kind))).collect()
    }

    /// Whether a candidate acts at some of the single sleepers, or at one of the runs.
    fn is_at(&self, candidate: &Candidate) -> bool {
        let Some(under) = candidate.extension.sleepers.as_ref() else { return false };
        let is_run = |run: &Range<usize>| under.iter().copied().eq(run.clone());
        under.iter().all(|sleeper| self.sleepers.contains(sleeper)) || self.runs.iter().any(is_run)
    }
}

/// The run of sleepers whose log stiffness differs most from that of all others; `None` if the difference
/// may be random variation.
fn run_apart(stiffness: &[f64]) -> Option<Range<usize>> {
    let count = stiffness.len();
    let runs = (0..count).flat_map(|from| (from + SHORTEST..=count).map(move |to| from..to));
    let apart = |run: Range<usize>| {
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..count).partition(|it| run.contains(it));
        if outside.len() < REST {
            return None;
        }
        let mean = |of: &[usize]| of.iter().map(|&it| stiffness[it]).sum::<f64>() / of.len() as f64;
        let means = [mean(&inside), mean(&outside)];
        let square = |it: usize| (stiffness[it] - means[usize::from(!run.contains(&it))]).powi(2);
        let scatter = ((0..count).map(square).sum::<f64>() / count as f64).sqrt();
        let step = (means[0] - means[1]).abs();
        (step > FAR && step > DEVIATIONS * scatter).then_some((scatter, run))
    };
    let best = runs.filter_map(apart).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, run)| run)
}

/// Trials of candidates at outliers.
pub(super) struct OutlierStarts {
    far: Far,
    templates: Vec<Template>,
    /// The unknowns at their prior mean.
    typical: DVector<f64>,
}

impl OutlierStarts {
    /// Selects the best trials of each kind at the outliers.
    ///
    /// # Errors
    /// [`CalibrationError`] if no track exists for the stiffness of the other sleepers.
    pub(super) fn new(
        problem: &Problem<'_>,
        far: Far,
        all: &[Candidate],
    ) -> Result<Self, CalibrationError> {
        let typical = problem.forward.unknowns.with_typical(&far.values);
        let (numbers, there): (Vec<usize>, Vec<Candidate>) = all
            .iter()
            .enumerate()
            .filter(|(_, candidate)| far.is_at(candidate))
            .map(|(number, candidate)| (number, candidate.clone()))
            .unzip();
        if there.is_empty() {
            return Ok(Self { far, templates: Vec::new(), typical });
        }
        let smoothed = problem.at(&far.values)?;
        let mut tried = templates(problem, &smoothed, &there, &|| {})?;
        tried.sort_by(|a, b| b.along(&smoothed.residual).total_cmp(&a.along(&smoothed.residual)));
        let kind = |template: &Template| there[template.candidate].kind.physics;
        let mut best: Vec<Template> = Vec::new();
        for template in tried {
            let same_kind = best.iter().filter(|known| kind(known) == kind(&template)).count();
            let is_known = best.iter().any(|known| known.candidate == template.candidate);
            if !is_known && same_kind < REFINED_PER_KIND {
                best.push(template);
            }
        }
        for template in &mut best {
            template.candidate = numbers[template.candidate];
        }
        Ok(Self { far, templates: best, typical })
    }

    /// Trials to be fitted, each with its start values. If there is a run, each trial also starts from
    /// typical values, because the baseline reproduces a run all along the track.
    pub(super) fn starts(&self) -> impl Iterator<Item = (&Template, DVector<f64>)> {
        let typical = (!self.far.runs.is_empty()).then_some(&self.typical);
        let from = move || [Some(&self.far.values), typical].into_iter().flatten().cloned();
        self.templates.iter().flat_map(move |template| from().map(move |values| (template, values)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::calibration::Calibration;
    use crate::candidate::candidates;
    use crate::forward::Forward;
    use crate::search::testing::observed;
    use crate::section::Section;
    use tracktwin_parameters::TrackDesign;
    use tracktwin_track::extension::ExtensionInstance;

    fn forward() -> Forward {
        let section = Section::new(TrackDesign::v_track(), 10, 1.0);
        Forward::new(section, Bands::new(100.0, 3300.0), &[7.0, 13.0], vec![0.0; 2])
    }

    #[test]
    fn a_stiffness_far_from_its_neighbours_becomes_theirs_and_all_others_stay() {
        let unknowns = forward().unknowns;
        let mut values = unknowns.typical();
        let far = Far::new(&unknowns, &values);
        assert_eq!((far.values, far.sleepers, far.runs), (values.clone(), vec![], vec![]));
        let (ballast, railpad) = (unknowns.ballast().start, unknowns.railpad().start);
        // A track that changes along the way, and three sleepers that do not follow.
        for sleeper in 0..10 {
            values[railpad + sleeper] += 0.05 * sleeper as f64;
        }
        let usual = values.clone();
        values[railpad + 4] -= 1.5;
        values[railpad + 5] -= 1.4;
        values[ballast + 9] += 0.7;
        let far = Far::new(&unknowns, &values);
        assert_eq!(far.sleepers, [9, 4, 5]);
        assert!((far.values - usual).amax() < 0.2 && far.runs.is_empty());
    }

    #[test]
    fn a_run_far_from_the_rest_becomes_the_rest_and_scatter_makes_none() {
        let unknowns = forward().unknowns;
        let mut values = unknowns.typical();
        let railpad = unknowns.railpad().start;
        for (sleeper, scatter) in
            [0.1, -0.1, 0.05, 0.2, -0.15, 0.1, -0.05, 0.0, 0.1, -0.1].iter().enumerate()
        {
            values[railpad + sleeper] += scatter;
        }
        assert!(Far::new(&unknowns, &values).runs.is_empty());
        let usual = values.clone();
        (2..8).for_each(|sleeper| values[railpad + sleeper] -= 1.1);
        let far = Far::new(&unknowns, &values);
        assert_eq!(far.runs, vec![2..8]);
        assert!((&far.values - usual).amax() < 0.3);
        let section = forward().section;
        let on_runs = far.on_runs(&candidates(&section));
        assert!(on_runs.iter().any(|it| it.kind.physics == "sleeper_bolt"));
        assert!(on_runs.iter().all(|it| it.extension.sleepers == Some(vec![2, 3, 4, 5, 6, 7])));
    }

    #[test]
    fn bolts_are_tried_on_usual_railpads_where_soft_ones_imitate_them() {
        let bolts = ExtensionInstance::new("sleeper_bolt").on([4, 5]);
        let (forward, observation) = observed(10, &bolts.with("stiffness_N_per_m", 4.5e7));
        let all = candidates(&forward.section);
        let typical = forward.unknowns.typical();
        let problem = Problem { forward: &forward, observation: &observation, candidates: &[] };

        let outlier_starts = |current: &Calibration| {
            let far = Far::new(&forward.unknowns, &current.values);
            OutlierStarts::new(&problem, far, &all).unwrap()
        };
        let smoothed = problem.at(&typical).unwrap();
        assert_eq!(outlier_starts(&smoothed).starts().count(), 0);

        let mut soft = typical.clone();
        for sleeper in [4, 5] {
            soft[forward.unknowns.railpad().start + sleeper] -= 1.5;
        }
        let soft = problem.at(&soft).unwrap();
        let outlier_starts = outlier_starts(&soft);
        let (best, values) = outlier_starts.starts().next().unwrap();
        assert_eq!(all[best.candidate].kind.physics, "sleeper_bolt");
        assert_eq!(all[best.candidate].extension.sleepers, Some(vec![4, 5]));
        assert_eq!(values, typical);
    }
}
