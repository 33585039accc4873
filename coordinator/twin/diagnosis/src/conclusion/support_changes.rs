//! Support changes of the last fit, and the sentences on what is no left-out physics.

use super::Evidence;
use crate::outcome::Verdict;
use crate::variation::{Amplitude, FoundSupportChange, Quadratic, learn_variation};
use tracktwin_inspection::chain::LossOfContact;

impl Evidence<'_> {
    /// Changes of the support along the track that are more than its variation between sleepers. None beside unknown
    /// physics or a fault of the chain, which the ballast of the last fit may imitate, and none if this fit has no
    /// posterior.
    pub(super) fn support_changes(&self, verdict: Verdict) -> Vec<FoundSupportChange> {
        if matches!(verdict, Verdict::UnknownPhysics | Verdict::MeasurementChain) {
            return Vec::new();
        }
        let mut unknowns = self.prepared.forward.unknowns.clone();
        let (calibration, known) = (&self.search.estimates, &self.search.accepted);
        let Some(data) = Quadratic::new(calibration, unknowns.typical(), known) else {
            return Vec::new();
        };
        let most = self.probability_max();
        let probabilities = learn_variation(&mut unknowns, &data);
        let probabilities: Vec<f64> = probabilities.into_iter().map(|it| it.min(most)).collect();
        let Some((values, covariance)) = data.posterior(&unknowns) else { return Vec::new() };
        let amplitudes = Amplitude::all(&unknowns, &probabilities, &values, &covariance);
        let found = unknowns.support_changes.iter().zip(amplitudes);
        let id = |sleeper| self.id(sleeper);
        found.map(|(&change, amplitude)| FoundSupportChange::new(change, amplitude, id)).collect()
    }
}

/// Sentences on what is no left-out physics: changes of the support, which the baseline contains, and contact loss,
/// which no fit includes. Each begins with a space.
pub(crate) fn further(
    support_changes: &[FoundSupportChange],
    lost: Option<&LossOfContact>,
) -> String {
    let changes: Vec<String> = support_changes.iter().map(FoundSupportChange::summary).collect();
    let changes = (!changes.is_empty()).then(|| {
        format!(
            " Probable changes of the ballast stiffness along the track: {}.",
            changes.join("; ")
        )
    });
    let lost = lost.map(|lost| {
        let [from_m, to_m] = lost.reach_m();
        format!(
            " The wheel loses contact with the rail from {from_m:.2} to {to_m:.2} m, where no linear fit holds."
        )
    });
    changes.into_iter().chain(lost).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variation::SupportChange;

    #[test]
    fn support_changes_are_stated_in_one_sentence() {
        let step = SupportChange::Transition { before: 19, after: 20 };
        let spot = SupportChange::Spot { first: 26, last: 29 };
        let amplitude = Amplitude { log: -0.54, deviation: 0.04, probability: 0.94 };
        let found = [step, spot].map(|change| {
            FoundSupportChange::new(change, amplitude, |sleeper| format!("SN{sleeper}"))
        });
        let expected = " Probable changes of the ballast stiffness along the track: transition from SN19 to SN20, -42 % \
                        (probability 94 %); soft spot from SN26 to SN29, -42 % (probability 94 %).";
        assert_eq!(further(&found, None), expected);
        assert_eq!(further(&[], None), "");
    }
}
