//! Findings of the passes alone, as hypotheses beside those of the model.

use super::{Evidence, FAILED_SHARE, names};
use crate::estimate::Estimate;
use crate::outcome::{Hypothesis, Location, UNKNOWN};
use tracktwin_inspection::Finding;
use tracktwin_track::extension::{Class, Kind};

impl Evidence<'_> {
    /// A finding of the passes alone is a separate hypothesis if the model has not found it as
    /// well.
    pub(super) fn add_finding(&self, finding: &Finding, all: &mut Vec<Hypothesis>) {
        let Some(kind) = Kind::from_name(finding.physics) else { return };
        let probability = probability(finding);
        let same = all.iter_mut().filter(|known| known.physics == finding.physics);
        if let Some(known) = same.max_by_key(|known| known.accepted) {
            known.probability = known.probability.max(probability);
            if known.accepted {
                return;
            }
        }
        let at_wheel = |kind: &Kind| kind.classes.contains(&Class::WheelAngle);
        // What comes back with every turn is the wheel's, whatever else there is.
        let explains = |known: &Hypothesis| {
            let known_at_wheel = Kind::from_name(&known.physics).is_some_and(at_wheel);
            known.accepted && known.physics != UNKNOWN && (known_at_wheel || !at_wheel(kind))
        };
        let explained = !kind.measuring_chain && all.iter().any(explains);
        all.retain(|known| known.accepted || known.physics != finding.physics);
        if !explained {
            // The name that came near it is right after all.
            let is_it = |known: &&mut Hypothesis| {
                known.physics == UNKNOWN && known.look_alikes.iter().any(|it| it == finding.physics)
            };
            for unknown in all.iter_mut().filter(is_it) {
                unknown.accepted = false;
                unknown.probability *= FAILED_SHARE;
            }
        }
        all.push(Hypothesis {
            probability: if explained { probability.min(0.5) } else { probability },
            accepted: !explained,
            ..seen(finding, kind, self.location_of_finding(finding))
        });
    }
}

/// A finding as an accepted hypothesis with its probability.
pub(super) fn seen(finding: &Finding, kind: &Kind, location: Option<Location>) -> Hypothesis {
    let estimate =
        |(&name, &(mean, sd)): (&&str, &(f64, f64))| (name.to_owned(), Estimate { mean, sd });
    Hypothesis {
        physics: finding.physics.to_owned(),
        family: Some(kind.family.name().to_owned()),
        family_probability: probability(finding),
        probability: probability(finding),
        accepted: true,
        location,
        port: None,
        behaviour: None,
        parameters: finding.parameters.iter().map(estimate).collect(),
        look_alikes: names(kind),
        would_separate: kind.would_separate.to_owned(),
        detectability: 0.0,
        log_evidence: -finding.p_value.ln(),
    }
}

pub(super) fn probability(finding: &Finding) -> f64 {
    1.0 - finding.p_value.clamp(1e-6, 1.0)
}
