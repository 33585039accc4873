//! Sleepers without an effect: a bolt that is missing where all others are bolted down, or a sleeper that a freely chosen
//! set contains by chance.

use super::Fitted;
use super::choice::on;
use super::fit::log_evidence;
use super::threshold::first_evidence;
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::screen::templates_instead;
use tracktwin_track::extension::PlaceKind;

/// Share of the best log evidence from which holes of a candidate are searched for.
const NEAR_SHARE: f64 = 0.3;

/// Largest share of the sleepers that may be without the effect.
const HOLES_MAX: f64 = 0.25;

/// Searches the fits of candidates that act on all sleepers, or on a freely chosen set, for sleepers without the effect.
/// Returns the fits with such holes.
pub(super) fn with_holes(
    problem: &Problem<'_>,
    current: &Calibration,
    fitted: &[Fitted],
) -> Vec<Fitted> {
    let best = fitted.first().map_or(f64::INFINITY, |best| best.log_evidence);
    let may_have_some = |fitted: &&Fitted| {
        let Fitted { candidate, log_evidence, .. } = fitted;
        let acts_on_all = candidate.is_everywhere() && candidate.kind.place == PlaceKind::Sleepers;
        (acts_on_all || candidate.choice_nats > 0.0) && *log_evidence >= NEAR_SHARE * best.max(0.0)
    };
    let tried = fitted.iter().filter(may_have_some);
    tried.filter_map(|fitted| Holes { problem, current }.of(fitted).ok().flatten()).collect()
}

struct Holes<'a> {
    problem: &'a Problem<'a>,
    current: &'a Calibration,
}

impl Holes<'_> {
    /// The fit with the holes that raise its evidence, one after the other; `None` without any.
    fn of(&self, fitted: &Fitted) -> Result<Option<Fitted>, CalibrationError> {
        // A hole in what all have is an effect of its own; a choice has its cost.
        let least = if fitted.candidate.is_everywhere() { first_evidence() } else { 0.0 };
        let acting = fitted.candidate.extension.sleepers.as_ref().map(Vec::len);
        let acting = acting.unwrap_or_else(|| self.problem.forward.section.sleepers());
        let most = (HOLES_MAX * acting as f64) as usize;
        let mut best: Option<Fitted> = None;
        for _ in 0..most {
            let known = best.as_ref().unwrap_or(fitted);
            let Some(further) = self.further(known, least)? else { break };
            if further.log_evidence < known.log_evidence + least {
                break;
            }
            best = Some(further);
        }
        Ok(best)
    }

    /// The fit with one more hole, where the signature promises most; `None` if it promises less than `least` nats.
    fn further(&self, known: &Fitted, least: f64) -> Result<Option<Fitted>, CalibrationError> {
        let sleepers = self.problem.forward.section.sleepers();
        let acting = known.candidate.extension.sleepers.clone();
        let acting = acting.unwrap_or_else(|| (0..sleepers).collect());
        let without = |hole: &usize| {
            let left = acting.iter().copied().filter(|sleeper| sleeper != hole);
            on(&known.candidate, left.collect(), sleepers)
        };
        let tried: Vec<Candidate> = acting.iter().map(without).collect();
        let with = |candidate: &Candidate| {
            [self.problem.candidates, std::slice::from_ref(candidate)].concat()
        };
        let Calibration { values, residual, gradient, .. } = &known.calibration;
        let candidates = with(&known.candidate);
        let all = Problem { candidates: &candidates, ..*self.problem };
        let templates = templates_instead(&all, &known.calibration, &tried)?;
        let evidence = templates.iter().map(|it| (it.log_evidence(residual, gradient), it));
        let Some((promised, template)) = evidence.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Ok(None);
        };
        let candidate = tried[template.candidate].clone();
        if promised + known.candidate.choice_nats < least {
            return Ok(None);
        }
        let candidates = with(&candidate);
        let problem = Problem { candidates: &candidates, ..*self.problem };
        let calibration = problem.calibrate_in_range(values.clone())?;
        let log_evidence = log_evidence(&candidate, &calibration, self.current);
        let Fitted { detectability, change, .. } = known.clone();
        Ok(Some(Fitted { candidate, calibration, log_evidence, detectability, change }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::candidates;
    use crate::search::testing::observed;
    use tracktwin_track::extension::ExtensionInstance;

    const BOLT_N_M: f64 = 3e7;

    /// Sleepers with bolts as found on a track with bolts at these; `None` where no hole is found.
    fn found(bolted: &[usize]) -> Option<Vec<usize>> {
        let bolts = ExtensionInstance::new("sleeper_bolt").on(bolted.iter().copied());
        let (forward, observation) = observed(10, &bolts.with("stiffness_N_per_m", BOLT_N_M));
        let typical = forward.unknowns.typical();
        let plain = Problem { forward: &forward, observation: &observation, candidates: &[] };
        let current = plain.at(&typical).unwrap();

        let all = candidates(&forward.section);
        let are_everywhere = |candidate: &&Candidate| {
            candidate.kind.physics == "sleeper_bolt" && candidate.is_everywhere()
        };
        let candidate = all.iter().find(are_everywhere).unwrap().clone();
        let candidates = [candidate.clone()];
        let with = Problem { candidates: &candidates, ..plain };
        let calibration = with.calibrate(with.start(&typical, &[&[BOLT_N_M]])).unwrap();
        let log_evidence = calibration.log_evidence - current.log_evidence;
        let change = calibration.residual.clone();
        let fitted = Fitted { candidate, calibration, log_evidence, detectability: 1.0, change };
        let holed = with_holes(&plain, &current, &[fitted]).pop()?;
        assert!(holed.log_evidence > log_evidence + first_evidence());
        holed.candidate.extension.sleepers
    }

    #[test]
    fn a_missing_bolt_is_found_where_all_other_sleepers_have_one_and_none_where_all_have() {
        assert_eq!(found(&[0, 1, 2, 3, 5, 6, 7, 8, 9]), Some(vec![0, 1, 2, 3, 5, 6, 7, 8, 9]));
        assert_eq!(found(&(0..10).collect::<Vec<_>>()), None);
    }
}
