//! Smallest evidence of a candidate, alone or in addition to accepted ones.

use super::detected_shape::is_detected;
use super::extent::Extent;
use super::probability::EVIDENCE_TEMPERING;
use crate::candidate::Candidate;
use crate::section::Section;
use tracktwin_track::extension::{Class, PlaceKind};

/// Smallest ratio of a candidate's log evidence to the part of an accepted one's that belongs to its
/// location. A model error looks like a small second effect there, except for an effect without a location
/// in addition to a local shape.
const FURTHER_SHARE_MIN: f64 = 0.25;

/// The same near a shape that the passes alone show.
const NEAR_SHAPE_SHARE_MIN: f64 = 1.0;

/// Smallest log evidence in nats, on a track other than V-Track, of a local shape of the rail that the passes alone do
/// not show: it is a random part of the surface rather than a defect. All speeds pass the same surface, so that a
/// held-out speed does not tell. On a recording of another simulator corrugation that did not exist had 21 nats over
/// one spacing.
const UNSEEN_SHAPE_MIN: f64 = 25.0;

/// Largest ratio of the gain of a fit to that of the best trial with free strength. A candidate that cannot
/// reach the threshold in addition to an accepted one is not fitted.
const FITTED_GAIN: f64 = 3.0;

/// Smallest log evidence of a candidate, given the accepted ones with their log evidence.
#[derive(Clone, Copy)]
pub(super) struct EvidenceThreshold<'a> {
    pub(super) accepted: &'a [(Candidate, f64)],
    pub(super) section: &'a Section,
    /// Stretches in m in which an inspection detected a shape of the rail.
    pub(super) detected_shapes_m: &'a [[f64; 2]],
    /// Ratio, at least one, of the squared residual that the accepted ones leave to that of null simulations.
    pub(super) excess: f64,
}

impl<'a> EvidenceThreshold<'a> {
    /// Thresholds beside these accepted candidates, which leave the residual of null simulations.
    pub(super) const fn new(
        accepted: &'a [(Candidate, f64)],
        section: &'a Section,
        detected_shapes_m: &'a [[f64; 2]],
    ) -> Self {
        Self { accepted, section, detected_shapes_m, excess: 1.0 }
    }

    /// The smallest log evidence of this candidate in nats.
    ///
    /// A shape that the inspection detected away from all accepted candidates is no residual of another
    /// effect and needs only the evidence of a first candidate. So does an effect at one or two sleepers beside
    /// one that has no place on the track, such as an axle box: its model error is the same at all sleepers, and
    /// their residual tells its size. Bolts everywhere have a place at each sleeper, where one may be missing.
    pub(super) fn of(self, candidate: &Candidate) -> f64 {
        let alone = first_evidence();
        if is_local_shape(candidate) && self.is_detected_by_passes(candidate) {
            return alone;
        }
        let beside = self.accepted.iter().map(|(known, evidence)| {
            if known.kind.place == PlaceKind::Nowhere && is_at_few_sleepers(candidate) {
                self.excess * alone
            } else {
                self.share(known, candidate) * evidence
            }
        });
        beside.fold(alone, f64::max)
    }

    /// The threshold in a round with this ratio of squared residuals.
    pub(super) const fn with_excess(self, excess: f64) -> Self {
        Self { excess, ..self }
    }

    /// Whether a candidate fits a random part of the surface: a local shape of the rail, on a track other than
    /// V-Track, that the passes alone do not show.
    pub(super) fn is_random_surface(self, candidate: &Candidate, log_evidence: f64) -> bool {
        !self.section.is_v_track()
            && is_local_shape(candidate)
            && !is_detected(candidate, self.section, self.detected_shapes_m)
            && log_evidence < UNSEEN_SHAPE_MIN
    }

    fn is_detected_by_passes(self, candidate: &Candidate) -> bool {
        let Some(x_m) = candidate.extension.x_m else { return false };
        let places = self.accepted.iter().filter_map(|(known, _)| known.extension.x_m);
        let are_beside = |one, other| self.section.are_beside(one, other);
        self.detected_shapes_m.iter().any(|&shape_m| {
            are_beside(shape_m, x_m) && !places.clone().any(|known_m| are_beside(shape_m, known_m))
        })
    }

    /// Share of an accepted candidate's log evidence that a further candidate needs.
    fn share(self, known: &Candidate, candidate: &Candidate) -> f64 {
        if candidate.is_everywhere() && is_local_shape(known) {
            return 0.0;
        }
        let [one, other] =
            [known, candidate].map(|candidate| Extent::of(candidate, self.section).with_reach());
        let is_shown = is_detected(known, self.section, self.detected_shapes_m);
        let least = if is_shown { NEAR_SHAPE_SHARE_MIN } else { FURTHER_SHARE_MIN };
        if one.meets(other) { least * (other.length() / one.length()).min(1.0) } else { 0.0 }
    }

    /// Whether the fit of a candidate may reach the threshold, from the gain in nats of a trial with free
    /// strength.
    pub(super) fn may_be_reached(self, candidate: &Candidate, gain: f64) -> bool {
        self.accepted.is_empty() || FITTED_GAIN * gain >= self.of(candidate)
    }
}

/// Smallest log evidence of a first candidate in nats: 9.
pub(super) fn first_evidence() -> f64 {
    EVIDENCE_TEMPERING * 20_f64.ln()
}

/// Whether a candidate acts at one sleeper or at a pair.
fn is_at_few_sleepers(candidate: &Candidate) -> bool {
    candidate.extension.sleepers.as_ref().is_some_and(|sleepers| sleepers.len() <= 2)
}

/// Whether a candidate is a local shape of the rail. It adds power there, and its model error does not look
/// like another track.
pub(super) fn is_local_shape(candidate: &Candidate) -> bool {
    candidate.kind.classes.contains(&Class::Wavelength) && !candidate.is_everywhere()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;
    use tracktwin_parameters::Preset;

    #[test]
    fn on_a_line_a_squat_that_the_passes_do_not_show_is_a_part_of_the_surface() {
        let (section, all) = section_with_candidates();
        let line = Section { track: Preset::like(0.6).track(), ..section.clone() };
        let named = |wanted: &str| all.iter().find(|it| it.kind.physics == wanted).unwrap();
        let (squat, gap) = (named("squat"), named("hanging_sleeper"));
        let [x_m, _] = squat.extension.x_m.unwrap();
        let is_random = |section: &Section, detected_shapes_m: &[[f64; 2]], candidate, evidence| {
            EvidenceThreshold::new(&[], section, detected_shapes_m)
                .is_random_surface(candidate, evidence)
        };
        assert!(is_random(&line, &[], squat, 24.0));
        assert!(!is_random(&line, &[], squat, 26.0) && !is_random(&line, &[], gap, 24.0));
        assert!(!is_random(&line, &[[x_m, x_m]], squat, 24.0));
        assert!(!is_random(&section, &[], squat, 24.0));
    }

    #[test]
    fn beside_an_effect_a_candidate_needs_a_quarter_of_what_falls_to_its_place() {
        let (section, all) = section_with_candidates();
        let of = |physics: &str, sleepers: Option<&[usize]>| {
            let found = all.iter().find(|candidate| {
                candidate.kind.physics == physics
                    && candidate.extension.x_m.is_none()
                    && candidate.extension.sleepers.as_deref() == sleepers
            });
            found.unwrap()
        };
        let joint_at = |span: f64| {
            let x_m = section.x_m(0) + span * section.track.design.sleeper.spacing_m;
            let is_there = |at: [f64; 2]| (at[0] - x_m).abs() < 1e-9;
            let is_it = |candidate: &&Candidate| {
                candidate.kind.physics == "rail_joint"
                    && candidate.extension.x_m.is_some_and(is_there)
            };
            all.iter().find(is_it).unwrap()
        };
        let threshold = EvidenceThreshold::new(&[], &section, &[]);
        let (bolts, axle_box) = (of("sleeper_bolt", None), of("flexible_axle_box", None));
        let (gap, far) = (of("hanging_sleeper", Some(&[3])), of("sleeper_bolt", Some(&[20])));
        let near = of("missing_railpad", Some(&[4]));
        assert_eq!(threshold.share(gap, near), 0.25);
        assert_eq!(threshold.share(gap, far), 0.0);
        // Two spans on either side of one sleeper, and of twenty-four.
        assert_eq!(threshold.share(axle_box, gap), 0.25 * 4.0 / 27.0);
        assert_eq!(threshold.share(axle_box, bolts), 0.25);
        assert_eq!(threshold.share(gap, bolts), 0.25);
        assert_eq!(threshold.share(joint_at(10.0), bolts), 0.0);
        assert_eq!(threshold.share(joint_at(10.0), joint_at(10.5)), 0.25);

        let known = [(axle_box.clone(), 9000.0)];
        let beside = EvidenceThreshold { accepted: &known, ..threshold };
        assert_eq!(beside.of(gap), first_evidence());
        assert_eq!(beside.with_excess(4.0).of(gap), 4.0 * first_evidence());
        assert_eq!(beside.of(bolts), 0.25 * 9000.0);
        let known = [(bolts.clone(), 9000.0)];
        let beside = EvidenceThreshold { accepted: &known, ..threshold };
        assert_eq!(beside.of(gap), 0.25 * 4.0 / 27.0 * 9000.0);

        let joint_m = joint_at(10.0).extension.x_m.unwrap();
        let shown = EvidenceThreshold { detected_shapes_m: &[joint_m], ..threshold };
        let [near, far] = [11, 20].map(|sleeper| of("missing_railpad", Some(&[sleeper])));
        assert_eq!(shown.share(joint_at(10.0), near), 1.0);
        assert_eq!(shown.share(joint_at(10.0), far), 0.0);
    }
}
