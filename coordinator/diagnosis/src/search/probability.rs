//! How probable each explanation of a search is: evidence, tempered, times prior.

use super::Round;
use tracktwin_track::extension::KINDS;

/// Nats by which the likelihood is tempered: the model is not exact, and its errors hang together.
pub(super) const TEMPERATURE: f64 = 3.0;

/// Probability of an unnamed alternative against a name of equal evidence: most of what goes wrong
/// on a track is in the catalogue.
const UNKNOWN_PRIOR: f64 = 0.1;

/// Share of the unknown's evidence from which a name explains what it does: the unknown is free at
/// every frequency, and fits what is not exact in a name's model as well.
const EXPLAINED_SHARE: f64 = 2.0 / 3.0;

/// Least prior of nothing at all.
const NOTHING_PRIOR: f64 = 0.5;

/// What a search's explanations are worth; what is missing to one has nothing at all.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Probabilities {
    /// Of each candidate that was fitted.
    pub(crate) named: Vec<f64>,
    /// Of an unknown dynamic stiffness.
    pub(crate) unknown: f64,
}

impl Round {
    /// Probabilities of what was fitted, of something unknown and of nothing at all.
    pub(crate) fn probabilities(&self) -> Probabilities {
        let named = self.fitted.iter().map(|fitted| fitted.log_evidence);
        of(named, self.port.as_ref().map(|port| port.log_evidence))
    }
}

/// Log evidences of names and of the unknown against nothing, in nats.
fn of(named: impl Iterator<Item = f64>, unknown: Option<f64>) -> Probabilities {
    let prior = (1.0 - NOTHING_PRIOR) / KINDS.len() as f64;
    let named: Vec<f64> = named.collect();
    let best = named.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let named: Vec<f64> =
        named.into_iter().map(|evidence| prior.ln() + evidence / TEMPERATURE).collect();
    let unknown = unknown.map_or(f64::NEG_INFINITY, |evidence| {
        let is_explained = best >= EXPLAINED_SHARE * evidence;
        let evidence = if is_explained { evidence.min(best) } else { evidence };
        (UNKNOWN_PRIOR * prior).ln() + evidence / TEMPERATURE
    });
    let nothing = NOTHING_PRIOR.ln();
    let highest = named.iter().copied().fold(unknown.max(nothing), f64::max);
    let weight = |logarithm: f64| (logarithm - highest).exp();
    let all = weight(nothing) + weight(unknown) + named.iter().copied().map(weight).sum::<f64>();
    Probabilities {
        named: named.iter().map(|&logarithm| weight(logarithm) / all).collect(),
        unknown: weight(unknown) / all,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_names_far_above_nothing_the_better_one_is_sure() {
        let Probabilities { named, unknown } = of([12_797.0, 1201.0].into_iter(), Some(600.0));
        assert!((named[0] - 1.0).abs() < 1e-12);
        assert!(named[1] < 1e-12 && unknown < 1e-12);
    }

    #[test]
    fn without_evidence_a_name_has_its_prior() {
        let Probabilities { named, unknown } = of([0.0].into_iter(), None);
        let prior = 0.5 / KINDS.len() as f64;
        assert!((named[0] - prior / (0.5 + prior)).abs() < 1e-12);
        assert_eq!(unknown, 0.0);
    }

    #[test]
    fn the_unknown_needs_more_evidence_than_a_name() {
        let equal = of([100.0].into_iter(), Some(100.0));
        assert!((equal.unknown / equal.named[0] - UNKNOWN_PRIOR).abs() < 1e-12);
        // What a name explains for the most part is not unknown.
        let little_more = of([100.0].into_iter(), Some(140.0));
        assert!((little_more.unknown / little_more.named[0] - UNKNOWN_PRIOR).abs() < 1e-12);
        let much_more = of([100.0].into_iter(), Some(160.0));
        assert!(much_more.unknown > much_more.named[0]);
    }
}
