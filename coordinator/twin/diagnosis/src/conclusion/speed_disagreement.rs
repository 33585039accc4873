//! Disagreement of speeds about the track.

use super::{Evidence, FAILED_SHARE};
use crate::outcome::Hypothesis;
use std::collections::BTreeMap;
use tracktwin_inspection::{Finding, Place};
use tracktwin_track::extension::{CLIPPING, POSITION_ERROR};

impl Evidence<'_> {
    /// Rejects all hypotheses if the speeds disagree about the track. A position error is then added,
    /// unless another fault of the measuring chain explains the disagreement.
    pub(super) fn add_speed_disagreement(&self, all: &mut Vec<Hypothesis>) {
        if !self.search.speeds_disagree() {
            return;
        }
        for known in all.iter_mut() {
            known.accepted = false;
            known.probability *= FAILED_SHARE;
        }
        let Some(evidence) = self.speed_disagreement() else { return };
        let finding = Finding {
            physics: POSITION_ERROR.physics,
            p_value: self.search.speed_disagreement_p_value(),
            place: Place::Everywhere,
            parameters: BTreeMap::new(),
            evidence,
        };
        self.add_finding(&finding, all);
    }

    /// Note on the disagreement, if there is one. Clipped passes always disagree, because clipping
    /// increases with the speed.
    pub(super) fn speed_disagreement(&self) -> Option<String> {
        let are_cut =
            self.inspection.findings.iter().any(|finding| finding.physics == CLIPPING.physics);
        (self.search.speeds_disagree() && !are_cut).then(|| {
            format!(
                "The speeds disagree about the track: a separate track for each speed explains the \
                     recording better than one for all, by {:.0} nats. The positions of some passes are \
                     wrong, or some passes are of the other rail.",
                self.search.speed_disagreement
            )
        })
    }
}
