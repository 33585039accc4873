//! Start values for candidates without a location, on a typical track: the fitted baseline reproduces the
//! effect of such a candidate by values far from those of the track.

use crate::calibration::{CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::screen::Template;
use nalgebra::DVector;
use rayon::prelude::*;

/// Selects the best trial of each candidate without a location for which `may_be` is true. The trial is
/// combined with a linear change of a track with the values `typical`.
///
/// # Errors
/// [`CalibrationError`] if no track exists for the values.
pub(super) fn everywhere<'t>(
    problem: &Problem<'_>,
    typical: &DVector<f64>,
    all: &[Candidate],
    templates: &'t [Template],
    may_be: impl Fn(&Candidate) -> bool,
) -> Result<Vec<&'t Template>, CalibrationError> {
    let Problem { forward, observation, .. } = *problem;
    let is_one = |candidate: &Candidate| candidate.is_everywhere() && may_be(candidate);
    let trials: Vec<&Template> =
        templates.iter().filter(|template| is_one(&all[template.candidate])).collect();
    if trials.is_empty() {
        return Ok(Vec::new());
    }
    let track = problem.at(typical)?;
    let accepted = problem.extensions(typical)?;
    let known = forward.transfer_to_vary(typical, &accepted)?;
    let plain = forward.levels(&known, typical);
    let section = &forward.section;
    let objective = |template: &&'t Template| {
        let candidate = &all[template.candidate];
        let extension = section.in_model(&candidate.with(&candidate.trials[template.trial]));
        let built = extension.build(&section.track.design, section.spans()).ok()?;
        let extensions = [&accepted[..], &[built]].concat();
        let transfer = forward.transfer_beside(&known, typical, &extensions).ok()?;
        let change = observation.whiten(&(forward.levels(&transfer, typical) - &plain));
        let change = observation.fitted(&change);
        let gradient = &track.gradient - track.jacobian.tr_mul(&change);
        let residual = &track.residual - change;
        let explained = gradient.dot(&track.precision.solve(&gradient));
        Some((template.candidate, 0.5 * (residual.norm_squared() - explained), *template))
    };
    let mut tried: Vec<_> = trials.par_iter().filter_map(objective).collect();
    tried.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    tried.dedup_by_key(|(candidate, ..)| *candidate);
    Ok(tried.into_iter().map(|(.., template)| template).collect())
}
