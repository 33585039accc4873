//! Probability of each explanation of a search: tempered evidence times prior.

use super::{Fitted, Round};
use crate::candidate::Candidate;
use crate::port_scan::{PortPlace, UnknownElement};
use crate::screen::STRENGTHS;
use std::collections::BTreeMap;
use tracktwin_track::extension::{Kind, LookAlikeGroup, PlaceKind};

/// Divisor of log evidence (tempering): the model is not exact, and its errors are correlated.
pub(crate) const EVIDENCE_TEMPERING: f64 = 3.0;

/// Increase of the tempering per nat of the greatest evidence: the error of an extension's model grows with
/// the extension.
const INEXACT_SHARE: f64 = 1e-3;

/// Increase of the tempering between look-alikes of one group per nat of their evidence. A hanging sleeper
/// or rail joint of reality or of another simulator differs from ours, and the common error would decide
/// between look-alikes.
const MEMBER_SHARE: f64 = 0.03;

/// Prior of unknown physics relative to a known kind: most faults of a track are in the catalogue.
const UNKNOWN_PRIOR: f64 = 0.1;

/// Share of the evidence for unknown physics from which a known kind explains it, if the model of the kind
/// is not exact. Unknown physics is free at every frequency and fits model errors as well.
const EXPLAINED_SHARE: f64 = 2.0 / 3.0;

/// The same for a linear kind at the place of the unknown physics. Of our own model it explains more than unknown
/// physics; on a recording of another simulator a flexible axle box explained 0.968 of it.
const EXPLAINED_SHARE_LINEAR: f64 = 0.95;

/// Smallest prior of nothing being left out.
const NOTHING_PRIOR: f64 = 0.5;

/// Probabilities of the explanations of a search. They sum to less than one; the rest belongs to effects
/// too weak to detect.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Probabilities {
    /// Probability of each fitted candidate.
    pub(crate) named: Vec<f64>,
    /// Probability of the best candidate's group of look-alikes.
    pub(crate) group: f64,
    /// Probability of an unknown dynamic stiffness.
    pub(crate) unknown: f64,
    /// Probability that nothing is left out.
    pub(crate) nothing: f64,
}

impl Probabilities {
    /// Probability that something is left out which the recording shows.
    pub(super) fn something(&self) -> f64 {
        self.named.iter().sum::<f64>() + self.unknown
    }
}

impl Round {
    /// Probabilities of the fitted candidates, of unknown physics and of nothing; the rest is that of
    /// effects too weak to detect.
    pub(crate) fn probabilities(&self) -> Probabilities {
        self.against(self.port.as_ref())
    }

    /// As [`Round::probabilities`], with the given unknown physics.
    pub(super) fn against(&self, unknown: Option<&UnknownElement>) -> Probabilities {
        let of_fitted = |fitted: &Fitted| (fitted.log_evidence, fitted.candidate.kind.group);
        let named: Vec<_> = self.fitted.iter().map(of_fitted).collect();
        let explained_share = match (self.fitted.first(), unknown) {
            (Some(best), Some(port)) => explained_share(&best.candidate, &port.place),
            _ => 1.0,
        };
        let unknown = unknown.map(|port| port.log_evidence);
        tempered(&named, unknown, explained_share, self.unseen)
    }
}

/// Share of the evidence for unknown physics at `port` from which a candidate explains it.
fn explained_share(candidate: &Candidate, port: &PortPlace) -> f64 {
    let is_there = match port {
        PortPlace::Wheel => candidate.kind.place == PlaceKind::Nowhere,
        PortPlace::Seats(seats) => candidate.extension.sleepers.as_ref() == Some(seats),
        PortPlace::Between(_) => false,
    };
    match (candidate.is_linear(), is_there) {
        (true, true) => EXPLAINED_SHARE_LINEAR,
        (true, false) => 1.0,
        (false, _) => EXPLAINED_SHARE,
    }
}

/// Share of the catalogue that a recording would not show: mean, over all kinds, locations and strengths,
/// of the evidence relative to nothing, at most one.
///
/// Each trial has its kind and its log evidence at several strengths in nats.
pub(super) fn unseen(trials: impl Iterator<Item = (&'static str, [f64; STRENGTHS.len()])>) -> f64 {
    let mut kinds: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for (kind, evidences) in trials {
        let (sum, count) = kinds.entry(kind).or_default();
        *sum += evidences
            .map(|evidence| (evidence.min(0.0) / EVIDENCE_TEMPERING).exp())
            .iter()
            .sum::<f64>();
        *count += evidences.len() as f64;
    }
    kinds.values().map(|(sum, count)| sum / count).sum::<f64>() / kinds.len().max(1) as f64
}

/// Computes probabilities from log ratios of the evidence of known kinds and of unknown physics to nothing,
/// in nats. `explained_share` is the share of the unknown's evidence from which the best kind explains it;
/// `unseen` is the share of all kinds that would not be detected.
///
/// The function weighs groups of look-alikes against each other and against nothing by their best member's
/// evidence, and then the members of each group. Log evidence is divided by [`EVIDENCE_TEMPERING`].
fn tempered(
    named: &[(f64, LookAlikeGroup)],
    unknown: Option<f64>,
    explained_share: f64,
    unseen: f64,
) -> Probabilities {
    let prior = (1.0 - NOTHING_PRIOR) / Kind::all().count() as f64;
    let best = named.iter().map(|(evidence, _)| *evidence).fold(f64::NEG_INFINITY, f64::max);
    let temperature = EVIDENCE_TEMPERING + INEXACT_SHARE * best.max(0.0);
    let logarithms: Vec<f64> = named
        .iter()
        .map(|&(evidence, group)| {
            let members = || named.iter().filter(move |(_, other)| *other == group);
            let most = members().map(|(evidence, _)| *evidence).fold(f64::NEG_INFINITY, f64::max);
            let apart = EVIDENCE_TEMPERING + MEMBER_SHARE * most.max(0.0);
            let share = |evidence: f64| ((evidence - most) / apart).exp();
            let all: f64 = members().map(|(evidence, _)| share(*evidence)).sum();
            prior.ln() + most / temperature + (share(evidence) / all).max(f64::MIN_POSITIVE).ln()
        })
        .collect();
    let unknown = unknown.map_or(f64::NEG_INFINITY, |evidence| {
        let is_explained = best >= explained_share * evidence;
        let evidence = if is_explained { evidence.min(best) } else { evidence };
        (UNKNOWN_PRIOR * prior).ln() + evidence / temperature
    });
    let nothing = NOTHING_PRIOR.ln();
    let highest = logarithms.iter().copied().fold(unknown.max(nothing), f64::max);
    let weight = |logarithm: f64| (logarithm - highest).exp();
    let too_weak = (1.0 - NOTHING_PRIOR) * unseen * (-highest).exp();
    let all = weight(nothing)
        + too_weak
        + weight(unknown)
        + logarithms.iter().copied().map(weight).sum::<f64>();
    let named_share: Vec<f64> =
        logarithms.iter().map(|&logarithm| weight(logarithm) / all).collect();
    let leading = named.first().map(|(_, group)| *group);
    let of_leading = named.iter().zip(&named_share).filter(|((_, it), _)| Some(*it) == leading);
    Probabilities {
        group: of_leading.map(|(_, share)| share).sum(),
        named: named_share,
        unknown: weight(unknown) / all,
        nothing: weight(nothing) / all,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;

    /// Names of different groups.
    fn apart(evidences: &[f64]) -> Vec<(f64, LookAlikeGroup)> {
        let groups =
            [LookAlikeGroup::Support, LookAlikeGroup::RailDefect, LookAlikeGroup::Fastening];
        evidences.iter().copied().zip(groups).collect()
    }

    #[test]
    fn look_alikes_are_less_sure_than_their_group() {
        let alike = [(1000.0, LookAlikeGroup::Support), (960.0, LookAlikeGroup::Support)];
        let both = tempered(&alike, None, 1.0, 0.0);
        assert!(both.group > 0.999 && both.named[0] > both.named[1]);
        // Forty nats in a thousand: nothing that another void could not turn.
        assert!(both.named[1] > 0.15, "{both:?}");
        let unlike = tempered(&apart(&[1000.0, 960.0]), None, 1.0, 0.0);
        assert!(unlike.named[1] < 1e-3, "{unlike:?}");
    }

    #[test]
    fn of_two_names_far_above_nothing_the_better_one_is_sure() {
        let Probabilities { named, unknown, .. } =
            tempered(&apart(&[12_797.0, 1201.0]), Some(600.0), 1.0, 0.3);
        assert!((named[0] - 1.0).abs() < 1e-12);
        assert!(named[1] < 1e-12 && unknown < 1e-12);
    }

    #[test]
    fn look_alikes_a_thousandth_apart_are_both_possible() {
        let strong = tempered(&apart(&[10_657.5, 10_647.6]), None, 1.0, 0.0).named;
        assert!(strong[1] > 0.25 && strong[1] < 0.5, "{strong:?}");
        let weak = tempered(&apart(&[100.0, 90.1]), None, 1.0, 0.0).named;
        assert!(weak[1] < 0.05, "{weak:?}");
    }

    #[test]
    fn a_few_nats_leave_something_less_probable_than_nothing() {
        let something = |evidence| tempered(&apart(&[evidence]), None, 1.0, 0.3).something();
        assert!(something(9.0) < 0.5 && something(15.0) > 0.5);
    }

    #[test]
    fn without_evidence_a_name_has_its_prior() {
        let Probabilities { named, unknown, .. } = tempered(&apart(&[0.0]), None, 1.0, 0.0);
        let prior = 0.5 / Kind::all().count() as f64;
        assert!((named[0] - prior / (0.5 + prior)).abs() < 1e-12);
        assert_eq!(unknown, 0.0);
    }

    #[test]
    fn a_linear_kind_need_not_explain_all_that_is_unknown_at_its_own_place() {
        let (_, all) = section_with_candidates();
        let named = |wanted: &str| all.iter().find(|it| it.kind.physics == wanted).unwrap();
        let seats = |of: &[usize]| PortPlace::Seats(of.to_vec());
        let axle_box = named("flexible_axle_box");
        assert_eq!(explained_share(axle_box, &PortPlace::Wheel), EXPLAINED_SHARE_LINEAR);
        assert_eq!(explained_share(axle_box, &seats(&[0, 1, 2])), 1.0);
        let pad = named("missing_railpad");
        let under = pad.extension.sleepers.clone().unwrap();
        assert_eq!(explained_share(pad, &seats(&under)), EXPLAINED_SHARE_LINEAR);
        assert_eq!(explained_share(pad, &PortPlace::Wheel), 1.0);
        assert_eq!(explained_share(named("hanging_sleeper"), &PortPlace::Wheel), EXPLAINED_SHARE);
    }

    #[test]
    fn the_unknown_needs_more_evidence_than_a_name() {
        let equal = tempered(&apart(&[100.0]), Some(100.0), 1.0, 0.0);
        assert!((equal.unknown / equal.named[0] - UNKNOWN_PRIOR).abs() < 1e-12);
        // What a name explains for the most part is not unknown, if its model is not exact.
        let more = |unknown| tempered(&apart(&[100.0]), Some(unknown), EXPLAINED_SHARE, 0.0);
        let [little, much] = [140.0, 160.0].map(more);
        assert!((little.unknown / little.named[0] - UNKNOWN_PRIOR).abs() < 1e-12);
        assert!(much.unknown > much.named[0]);
        let exact = tempered(&apart(&[100.0]), Some(140.0), 1.0, 0.0);
        assert!(exact.unknown > exact.named[0]);
    }

    #[test]
    fn nothing_is_as_sure_as_what_is_hidden_would_show() {
        let certain = tempered(&apart(&[]), None, 1.0, 0.0).nothing;
        let blind = tempered(&apart(&[]), None, 1.0, 1.0).nothing;
        assert_eq!((certain, blind), (1.0, NOTHING_PRIOR));
    }

    #[test]
    fn half_of_two_kinds_is_unseen_if_one_shows_at_every_strength_and_one_at_none() {
        let shows = ("rail_joint", [-500.0; STRENGTHS.len()]);
        let hides = ("squat", [0.3; STRENGTHS.len()]);
        assert!((unseen([shows, shows, hides].into_iter()) - 0.5).abs() < 1e-12);
    }
}
