//! Requirements of training, checked before a campaign is simulated.

use tracktwin_farm::campaign::Campaign;
use tracktwin_surrogate::ENTRIES_MIN;

/// Reasons for not training models on a campaign. Each message is one line with the remedy.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum Lack {
    /// The campaign has too few cases for training and testing.
    #[error("{cases} cases are too few for training; use `--cases {ENTRIES_MIN}` or more")]
    Cases {
        /// Number of cases.
        cases: u32,
    },
    /// No parameter is varied.
    #[error(
        "parameters: no parameter varies; give at least one a range, for example \
             `ballast_stiffness_N_m = [4e6, 22e6]`"
    )]
    Axes,
}

/// Checks whether models can be trained on a campaign after all its cases are finished.
///
/// # Errors
/// Returns [`Lack`] with the missing requirement.
pub fn check_for_training(campaign: &Campaign) -> Result<(), Lack> {
    if (campaign.cases as usize) < ENTRIES_MIN {
        return Err(Lack::Cases { cases: campaign.cases });
    }
    if campaign.definition.space.axes().is_empty() {
        return Err(Lack::Axes);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::train::TRAINED;
    use tracktwin_farm::campaign::DEFAULT;
    use tracktwin_parameters::{Parameter, ParameterSet};

    fn lack(text: &str) -> Option<Lack> {
        check_for_training(&Campaign::parse(text, "c.toml", None).unwrap()).err()
    }

    #[test]
    fn the_built_in_campaign_can_be_trained_on() {
        assert_eq!(lack(DEFAULT), None);
    }

    #[test]
    fn what_training_would_find_out_late_is_found_out_at_once() {
        assert_eq!(
            lack(&DEFAULT.replace("cases = 800", "cases = 199")),
            Some(Lack::Cases { cases: 199 })
        );
        let line = |&it: &Parameter| format!("{} = {:e}\n", it.name(), ParameterSet::nominal()[it]);
        let held = Parameter::ALL.iter().map(line).collect::<Vec<_>>().concat();
        let held = format!("{DEFAULT}\n[parameters]\n{held}");
        assert_eq!(lack(&held), Some(Lack::Axes));
    }

    #[test]
    fn every_feature_vector_has_bins_in_the_coarsest_definition_that_is_let_in() {
        let coarse = format!("{DEFAULT}\n[features]\nvoices_per_octave = 4\n");
        let campaign = Campaign::parse(&coarse, "c.toml", None).unwrap();
        let frequencies_hz = campaign.definition.experiment.features.frequencies_hz();
        assert!(TRAINED.into_iter().all(|set| !set.bins(&frequencies_hz).is_empty()));
        let coarser = coarse.replace("voices_per_octave = 4", "voices_per_octave = 3");
        Campaign::parse(&coarser, "c.toml", None).unwrap_err();
    }
}
