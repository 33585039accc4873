//! What the baseline imitates by the stiffness of single sleepers: effects under those that lie far
//! from their neighbours, tried from the neighbours' values.
//!
//! A sleeper that is bolted down is stiff, and so is one on a railpad of a tenth of the stiffness
//! to a wheel that hardly feels what is below; beside such a railpad no trial of bolts gains
//! anything.

use super::limits::REFINED_PER_KIND;
use crate::baseline::Unknowns;
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::screen::{Template, templates};
use nalgebra::DVector;
use tracktwin_inspection::median;

/// Logarithm of a stiffness over its neighbours' from which it is far: three deviations of what
/// varies from railpad to railpad.
const FAR: f64 = 0.6;

/// Sleepers on either side that a sleeper is compared with.
const NEIGHBOURS: usize = 3;

/// Trials of effects under sleepers that lie far from their neighbours.
pub(super) struct OutlierStarts {
    /// The unknowns, with the neighbours' stiffness under those sleepers.
    values: DVector<f64>,
    templates: Vec<Template>,
}

impl OutlierStarts {
    /// What such sleepers may have instead, best of each kind.
    ///
    /// # Errors
    /// [`CalibrationError`] when their neighbours' stiffness makes no track.
    pub(super) fn new(
        problem: &Problem<'_>,
        current: &Calibration,
        all: &[Candidate],
    ) -> Result<Self, CalibrationError> {
        let (values, sleepers) = smoothed_outliers(&problem.forward.unknowns, &current.values);
        let is_there = |candidate: &&Candidate| {
            let under = candidate.extension.sleepers.as_ref();
            under.is_some_and(|under| under.iter().all(|sleeper| sleepers.contains(sleeper)))
        };
        let (numbers, there): (Vec<usize>, Vec<Candidate>) = all
            .iter()
            .enumerate()
            .filter(|(_, candidate)| is_there(candidate))
            .map(|(number, candidate)| (number, candidate.clone()))
            .unzip();
        if there.is_empty() {
            return Ok(Self { values, templates: Vec::new() });
        }
        let smoothed = problem.at(&values)?;
        let mut tried = templates(problem, &smoothed, &there, || {})?;
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
        Ok(Self { values, templates: best })
    }

    /// Trials to be fitted, each with the values that it is fitted from.
    pub(super) fn starts(&self) -> impl Iterator<Item = (&Template, DVector<f64>)> {
        self.templates.iter().map(|template| (template, self.values.clone()))
    }
}

/// Values in which each stiffness that is far from its neighbours' is their median instead, and the
/// sleepers whose it is.
fn smoothed_outliers(unknowns: &Unknowns, values: &DVector<f64>) -> (DVector<f64>, Vec<usize>) {
    let mut smoothed = values.clone();
    let mut sleepers = Vec::new();
    for field in [unknowns.ballast(), unknowns.railpad()] {
        let count = field.len();
        for sleeper in 0..count {
            let near = sleeper.saturating_sub(NEIGHBOURS)..(sleeper + NEIGHBOURS + 1).min(count);
            let others = near.filter(|other| *other != sleeper);
            let usual = median(others.map(|other| values[field.start + other]).collect());
            if (values[field.start + sleeper] - usual).abs() > FAR {
                smoothed[field.start + sleeper] = usual;
                sleepers.push(sleeper);
            }
        }
    }
    (smoothed, sleepers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::candidate::candidates;
    use crate::forward::Forward;
    use crate::observation::Observation;
    use crate::section::Section;
    use nalgebra::DMatrix;
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
        assert_eq!(smoothed_outliers(&unknowns, &values), (values.clone(), vec![]));
        let (ballast, railpad) = (unknowns.ballast().start, unknowns.railpad().start);
        // A track that changes along the way, and three sleepers that do not follow.
        for sleeper in 0..10 {
            values[railpad + sleeper] += 0.05 * sleeper as f64;
        }
        let usual = values.clone();
        values[railpad + 4] -= 1.5;
        values[railpad + 5] -= 1.4;
        values[ballast + 9] += 0.7;
        let (smoothed, sleepers) = smoothed_outliers(&unknowns, &values);
        assert_eq!(sleepers, [9, 4, 5]);
        assert!((smoothed - usual).amax() < 0.2);
    }

    #[test]
    fn bolts_are_tried_on_usual_railpads_where_soft_ones_imitate_them() {
        let forward = forward();
        let all = candidates(&forward.section);
        let typical = forward.unknowns.typical();
        let section = &forward.section;
        let bolts = ExtensionInstance::new("sleeper_bolt").on([4, 5]);
        let bolts = section.in_model(&bolts.with("stiffness_N_per_m", 4.5e7));
        let bolts = bolts.build(&section.design, section.spans()).unwrap();
        let log_power = forward.log_power(&typical, &[bolts]).unwrap();
        let covariance = 0.02 * DMatrix::identity(forward.per_sleeper(), forward.per_sleeper());
        let observation = Observation::new(log_power, &covariance, |_| false).unwrap();
        let problem = Problem { forward: &forward, observation: &observation, candidates: &[] };

        let smoothed = problem.at(&typical).unwrap();
        assert_eq!(OutlierStarts::new(&problem, &smoothed, &all).unwrap().starts().count(), 0);

        let mut soft = typical.clone();
        for sleeper in [4, 5] {
            soft[forward.unknowns.railpad().start + sleeper] -= 1.5;
        }
        let soft = problem.at(&soft).unwrap();
        let outlier_starts = OutlierStarts::new(&problem, &soft, &all).unwrap();
        let (best, values) = outlier_starts.starts().next().unwrap();
        assert_eq!(all[best.candidate].kind.physics, "sleeper_bolt");
        assert_eq!(all[best.candidate].extension.sleepers, Some(vec![4, 5]));
        assert_eq!(values, typical);
    }
}
